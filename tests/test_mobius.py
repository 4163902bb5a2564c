import meshes
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import cdcp_igl
from cdcp_igl.distortion import plane_angles
from cdcp_igl.libigl import internal_angles
from cdcp_igl.mobius import (
    angle_change,
    conformal_barycenter,
    least_angle_distortion,
    least_angle_distortion_nelder_mead,
    mobius,
)

V, F = meshes.grid(10, 12)
UV = cdcp_igl.cdcp(V, F)
Z = UV @ [1, 1j]

in_disk = st.complex_numbers(max_magnitude=0.9)


def angles_of(z):
    return plane_angles(z, F)


@given(in_disk)
def test_inverse_and_circle(w):
    image = mobius(Z, w)
    np.testing.assert_allclose(mobius(image, -w), Z, atol=1e-13)
    on_circle = abs(Z) == abs(Z).max()
    np.testing.assert_allclose(abs(image[on_circle]), 1, atol=1e-13)
    assert mobius(np.array([w]), w)[0] == 0


@given(st.complex_numbers(max_magnitude=0.3))
def test_angle_change_is_exact(w):
    np.testing.assert_allclose(
        angles_of(mobius(Z, w)), angles_of(Z) + angle_change(F, Z, w), atol=1e-11
    )


@given(st.complex_numbers(max_magnitude=0.6))
def test_newton_undoes_any_moebius_transformation(w):
    moved = mobius(Z, w)
    found = least_angle_distortion(F, moved, angles_of(Z))
    np.testing.assert_allclose(found, -w, atol=1e-7)


@given(st.complex_numbers(max_magnitude=0.6))
def test_barycenter_is_at_zero(w):
    mass = np.linspace(1, 2, len(Z))
    moved = mobius(Z, w)
    found = conformal_barycenter(moved, mass)
    assert abs(mass @ mobius(moved, found)) / mass.sum() < 1e-12


def test_newton_ends_where_nelder_mead_ends(real_mesh):
    V, F = real_mesh("camelhead_11381")
    z = cdcp_igl.disk_map(V, F, mobius=None).uv @ [1, 1j]
    residual = plane_angles(z, F) - internal_angles(V, F)

    def mean(w):
        return np.degrees(abs(residual + angle_change(F, z, w)).mean())

    newton = least_angle_distortion(F, z, internal_angles(V, F))
    simplex = least_angle_distortion_nelder_mead(F, z, internal_angles(V, F))
    assert mean(newton) < mean(0) - 0.001
    assert mean(newton) < mean(simplex) + 1e-4


def test_normalisations_of_a_map():
    none, angle, area = (cdcp_igl.disk_map(V, F, mobius=kind) for kind in (None, "angle", "area"))
    assert none.mobius.method == "none"
    assert none.mobius.w == 0
    assert angle.distortion.mean < none.distortion.mean
    assert area.mobius.method == "area"
    for result in (none, angle, area):
        first = result.uv[0]  # vertex 0 is a corner of the grid
        np.testing.assert_allclose(first, [1, 0], atol=1e-15)


def test_area_normalisation_balances_the_hemispheres():
    V, F, _ = cdcp_igl.datasets.spherical_cap(12)
    shifted = cdcp_igl.disk_map(V, F, center=5, mobius="area")
    assert np.hypot(*shifted.uv[0]) < 1e-3  # the pole


def test_a_transformation_that_does_harm_is_not_applied(monkeypatch):
    monkeypatch.setattr("cdcp_igl.mobius.least_angle_distortion", lambda *_: 0.5j)
    harmed, none = cdcp_igl.disk_map(V, F), cdcp_igl.disk_map(V, F, mobius=None)
    assert (harmed.mobius.w, harmed.mobius.rejected) == (0, "no improvement")
    assert "rejected: no improvement" in str(harmed)
    np.testing.assert_array_equal(harmed.uv, none.uv)


def test_bad_options():
    with pytest.raises(ValueError, match="mobius"):
        cdcp_igl.disk_map(V, F, mobius="best")
    with pytest.raises(ValueError, match="preset"):
        cdcp_igl.disk_map(V, F, preset="thesis")
    with pytest.raises(ValueError, match="preset"):
        cdcp_igl.disk_map(V, F, preset="paper", center="centroid")
