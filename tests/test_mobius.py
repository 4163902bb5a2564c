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
from cdcp_igl.steps.mobius import (
    conformal_barycenter,
    harmless,
    mobius_transformation,
    normalize,
)
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
    harm = lambda w, errors: (0.5j, errors.mean(0j))  # noqa: E731
    monkeypatch.setattr("cdcp_igl.steps.mobius.nearest_to", harm)
    harmed, none = cdcp_igl.disk_map(V, F), cdcp_igl.disk_map(V, F, mobius=None)
    assert (harmed.mobius.w, harmed.mobius.rejected) == (0, "no improvement")
    assert "rejected: no improvement" in str(harmed)
    np.testing.assert_array_equal(harmed.uv, none.uv)
    assert (harmed.mobius.reached, none.mobius.reached) == (0, 1)


def gutter(length, n=12):
    """Half of a tube, so many times longer than wide: turned by half a turn, it is the same."""
    shape = n + 1, n * length + 1
    i, j = np.divmod(np.arange(shape[0] * shape[1]), shape[1])
    V = np.column_stack([np.cos(np.pi * i / n), np.sin(np.pi * i / n), np.pi * j / n])
    return V, meshes.grid(*shape)[1]


def test_a_part_of_the_way_is_sought_only_where_it_may_help():
    tried = []

    def attempt(w):
        tried.append(w)
        return w, np.array([3, 5] if abs(w) > 0.2 else [3])

    def without():
        return "plain", np.array([3])

    given = lambda w: True, attempt, without
    moved, done = harmless("angle", 0.5, *given, repaired=True)
    assert (moved, done.w, done.rejected, tried) == ("plain", 0, "flipped faces", [0.5])
    # What is flipped without it is no harm, and may be repaired later on.
    assert harmless("angle", 0.1, *given, repaired=True)[0] == 0.1
    moved, done = harmless("angle", 0.5, *given)
    assert (moved, done.reached) == (0.125, 0.25)
    # What only psi_w flips is worth a shorter way.
    none = np.array([], dtype=int)

    def alone(w):
        return w, none if w < 0.2 else np.array([5])

    moved, done = harmless("angle", 0.5, lambda w: True, alone, lambda: (0, none), repaired=True)
    assert (moved, done.reached) == (0.125, 0.25)


@pytest.mark.parametrize("length", [1, 2, 4])
def test_a_surface_that_is_scanned_again_has_the_same_map(length):
    """With 2 % of an edge of noise. By least distortion alone, vertices moved by up to 2."""
    V, F = gutter(length)
    scans = [np.random.default_rng(seed).normal(V, 0.02 * np.pi / 12) for seed in range(3)]
    maps = [[cdcp_igl.cdcp(scan, F, mobius=mobius) for mobius in ("angle", None)] for scan in scans]
    assert max(np.hypot(*(one - maps[0][0]).T).max() for one, _ in maps) < 0.06
    for (one, plain), V in zip(maps, scans, strict=True):
        means = [cdcp_igl.angle_distortion(V, F, uv).mean() for uv in (one, plain)]
        assert means[0] < max(1.01 * means[1], means[1] + 0.05)


def test_the_map_turns_with_the_surface():
    """In any unit; and the Möbius step in a mirror and in any order, too."""
    V, F = gutter(2)
    turned = Rotation.from_euler("xyz", [20, 30, 40], degrees=True).apply(25.4 * V)
    np.testing.assert_allclose(cdcp_igl.cdcp(turned, F), cdcp_igl.cdcp(V, F), atol=1e-9)
    f = cdcp_igl.cdcp(V, F, mobius=None) @ [1, 1j]
    w = normalize(DiskMesh(V, F), f, "angle")[1].w
    assert abs(w) > 1e-3
    assert abs(normalize(DiskMesh(V, F[:, ::-1]), f.conj(), "angle")[1].w.conjugate() - w) < 1e-9
    order = np.random.default_rng(0).permutation(len(V))
    shuffled = DiskMesh(V[order], np.argsort(order)[F][::-1])
    assert abs(normalize(shuffled, f[order], "angle")[1].w - w) < 1e-9
