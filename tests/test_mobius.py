import meshes
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from igl import internal_angles
from scipy.spatial.transform import Rotation

import cdcp_igl
from cdcp_igl.steps.least_distortion import (
    AngleErrors,
    angle_change,
    faces_to_judge_by,
    least_angle_distortion,
    least_angle_distortion_nelder_mead,
)
from cdcp_igl.steps.mobius import conformal_barycenter, mobius_transformation
from cdcp_igl.surface.mesh import DiskMesh
from cdcp_igl.verdict.distortion import plane_angles

V, F = meshes.grid(10, 12)
UV = cdcp_igl.cdcp(V, F)
Z = UV @ [1, 1j]

in_disk = st.complex_numbers(max_magnitude=0.9)


def angles_of(z):
    return plane_angles(z, F)


@given(in_disk)
def test_inverse_and_circle(w):
    image = mobius_transformation(Z, w)
    np.testing.assert_allclose(mobius_transformation(image, -w), Z, atol=1e-13)
    on_circle = abs(Z) == abs(Z).max()
    np.testing.assert_allclose(abs(image[on_circle]), 1, atol=1e-13)
    assert mobius_transformation(np.array([w]), w)[0] == 0


@given(st.complex_numbers(max_magnitude=0.3))
def test_angle_change_is_exact(w):
    np.testing.assert_allclose(
        angles_of(mobius_transformation(Z, w)), angles_of(Z) + angle_change(F, Z, w), atol=1e-11
    )


@given(st.complex_numbers(max_magnitude=0.6))
@example(6e-8 + 0j)
def test_newton_undoes_any_moebius_transformation(w):
    moved = mobius_transformation(Z, w)
    found = least_angle_distortion(AngleErrors.of(F, moved, angles_of(Z)))
    np.testing.assert_allclose(found, -w, atol=1e-7)


def test_roughness_does_not_choose_the_transformation():
    """Of a conformal map of a rough sheet of five million faces; by 10,000 faces, |w| is 0.9999."""
    x, y, F = meshes.cells(1600, 1600)
    F = F[faces_to_judge_by(len(F))]
    z = (x + 1j * y) / 1600 - 0.5 - 0.5j
    noise = np.random.default_rng(0).normal(scale=np.radians(3), size=F.shape)
    angles = plane_angles(z, F) + noise - noise.mean(axis=1, keepdims=True)
    assert abs(least_angle_distortion(AngleErrors.of(F, z, angles))) < 0.5


@given(st.complex_numbers(max_magnitude=0.6))
def test_barycenter_is_at_zero(w):
    moved = mobius_transformation(Z, w)
    for mass in (np.linspace(1, 2, len(Z)), 1e-3 + Z.real**8):  # at two opposite places
        found = conformal_barycenter(moved, mass)
        assert abs(mass @ mobius_transformation(moved, found)) / mass.sum() < 1e-12


def test_newton_ends_where_nelder_mead_ends(real_mesh):
    V, F = real_mesh("camelhead_11381")
    z = cdcp_igl.disk_map(V, F, mobius=None).uv @ [1, 1j]
    residual = plane_angles(z, F) - internal_angles(V, F)

    def mean(w):
        return np.degrees(abs(residual + angle_change(F, z, w)).mean())

    newton = least_angle_distortion(AngleErrors.of(F, z, internal_angles(V, F)))
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


@pytest.mark.parametrize("refine", [0, 2])
def test_align_to_a_boundary_vertex(refine):
    vertex = DiskMesh(V, F).loop[7]
    plain = cdcp_igl.cdcp(V, F, refine=refine) @ [1, 1j]
    turned = cdcp_igl.cdcp(V, F, refine=refine, align=vertex) @ [1, 1j]
    np.testing.assert_allclose(turned[vertex], 1, atol=1e-15)
    np.testing.assert_allclose(turned, plain / plain[vertex], atol=1e-13)


def test_align_to_a_direction():
    east = cdcp_igl.cdcp(V, F, align=[1, 0, 0])
    north = cdcp_igl.cdcp(V, F, align=[0, 1, 0])
    right, left = V[:, 0] > V[:, 0].max() - 0.5, V[:, 0] < 0.5
    assert (east[right, 0] > 0.5).all()
    assert (east[left, 0] < -0.5).all()
    turn = np.vdot(east @ [1, 1j], north @ [1, 1j])
    assert np.degrees(np.angle(turn)) == pytest.approx(-90, abs=10)


def test_align_follows_the_surface():
    turn = Rotation.from_euler("xyz", [20, 30, 40], degrees=True)
    d = np.array([1.0, -2.0, 0.5])
    moved = cdcp_igl.cdcp(3 * turn.apply(V) + 5, F, align=turn.apply(d))
    np.testing.assert_allclose(moved, cdcp_igl.cdcp(V, F, align=d), atol=1e-9)


def test_a_transformation_that_does_harm_is_not_applied(monkeypatch):
    monkeypatch.setattr("cdcp_igl.steps.mobius.least_angle_distortion", lambda *_: 0.5j)
    harmed, none = cdcp_igl.disk_map(V, F), cdcp_igl.disk_map(V, F, mobius=None)
    assert (harmed.mobius.w, harmed.mobius.rejected) == (0, "no improvement")
    assert "rejected: no improvement" in str(harmed)
    np.testing.assert_array_equal(harmed.uv, none.uv)
