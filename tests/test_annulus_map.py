"""Maps onto rings: moduli that are known, what is refined and filled, and what is refused."""

import meshes
import numpy as np
import pytest
from commands import invoke
from scipy.spatial import KDTree
from surfaces import pierced_sphere, ring, spiky_ring, star

import cdcp_igl
from cdcp_igl.arrays import coordinates
from cdcp_igl.descent.targets import Ring
from cdcp_igl.maps.rings import embedded_ring
from cdcp_igl.starts.boundary import arc_length_map
from cdcp_igl.starts.tutte import centered, tutte_embedding
from cdcp_igl.surface.mesh import AnnulusMesh, DiskMesh
from cdcp_igl.verdict.certificate import certify, certify_ring


@pytest.mark.parametrize(
    ("profile", "modulus"),
    [
        (lambda s: (0.3**s, 0 * s), np.log(1 / 0.3) / (2 * np.pi)),
        (lambda s: (np.cos(s - 0.2), np.sin(s - 0.2)), None),
        (lambda s: (1 + 0 * s, 2 * s), 1 / np.pi),
        # Half of a torus of revolution: the integral of ds / r, over 2 pi.
        (lambda s: (2 + np.cos(np.pi * s), np.sin(np.pi * s)), 1 / (2 * np.sqrt(3))),
    ],
    ids=["plane", "sphere", "cylinder", "torus"],
)
def test_moduli_and_radii_converge_at_second_order(profile, modulus):
    if modulus is None:  # of a zone of the sphere, by its isometric latitudes
        modulus = np.diff(np.arctanh(np.sin([-0.2, 0.8])))[0] / (2 * np.pi)
    errors, ratios = [], []
    for k in (1, 2, 4):
        V, F, t = ring(8 * k, 20 * k, profile)
        harmonic, refined = (cdcp_igl.annulus_map(V, F, refine=steps) for steps in (0, 20))
        assert harmonic.conformal
        assert refined.distortion.mean <= harmonic.distortion.mean * (1 + 1e-4)
        low, high = harmonic.modulus_bounds
        assert low * (1 - 1e-12) < harmonic.modulus < high * (1 + 1e-12)
        by_radius = [-np.log(result.radius) / (2 * np.pi) for result in (harmonic, refined)]
        errors.append(abs(np.array([harmonic.modulus, *by_radius]) - modulus))
        z = refined.uv[:, 0] + 1j * refined.uv[:, 1]
        turned = z * np.exp(1j * np.where(harmonic.mesh.loops[0][0] < len(V) / 2, -t, t))
        ratios.append(np.ptp(np.angle(turned / turned[0])))
    first, _, last = errors
    assert ((first > 3.2**2 * last) | (first < 1e-9)).all()
    assert ratios[2] < 0.01


def test_a_refined_ring_in_the_plane_is_exact():
    V, F, _ = ring(8, 20, lambda s: (0.3**s, 0 * s))
    result = cdcp_igl.annulus_map(V, F, refine=10)
    assert abs(result.uv - V[:, :2]).max() < 1e-9
    assert result.refinement.steps > 0


def test_a_small_hole_distorts_little():
    V, F, _ = cdcp_igl.datasets.spherical_cap(20)
    ring_mean = cdcp_igl.annulus_map(V[1:], F[F.min(axis=1) > 0] - 1, refine=0).distortion.mean
    assert ring_mean < 1.05 * cdcp_igl.disk_map(V, F, refine=0).distortion.mean


def test_long_tubes_have_no_radius_to_speak_of_and_are_still_one_to_one():
    V, F, _ = ring(200, 12, lambda s: (1 + 0 * s, 100 * s))
    result = cdcp_igl.annulus_map(V, F)
    assert result.valid
    assert result.radius < 1e-40


def test_longer_ones_are_refused():
    with pytest.raises(cdcp_igl.MapError, match="too small for double precision") as raised:
        cdcp_igl.annulus_map(*ring(200, 3, lambda s: (1 + 0 * s, 400 * s))[:2])
    with pytest.raises(ValueError, match="no bijection"):
        raised.value.result.invert([0.5, 0])


def test_ears_at_the_inner_loop_are_refused():
    """A triangle inscribed in the inner circle lies inside of it."""
    V, F, ear = meshes.ear_at_a_hole()
    with pytest.raises(cdcp_igl.MeshError, match="all three corners on the loop") as raised:
        cdcp_igl.annulus_map(V, F)
    np.testing.assert_array_equal(raised.value.indices, [ear])
    assert cdcp_igl.disk_map(*cdcp_igl.clean(V, F)[:2]).valid
    used, F = np.unique(np.delete(F, raised.value.indices, axis=0), return_inverse=True)
    assert cdcp_igl.annulus_map(V[used], F.reshape(-1, 3)).valid


def test_an_edge_across_the_inner_circle_is_refused():
    V, F, edge = meshes.edge_across_a_hole()
    with pytest.raises(cdcp_igl.MeshError, match="1 edge inside joins two vertices") as raised:
        cdcp_igl.annulus_map(V, F)
    np.testing.assert_array_equal(raised.value.indices, np.sort(edge))
    assert cdcp_igl.disk_map(*cdcp_igl.clean(V, F)[:2]).valid
    assert cdcp_igl.surface_map(V, F).valid


def test_where_an_edge_would_turn_by_more_than_pi_the_boundary_is_by_length():
    V = [[0, 0], [10, 0], [5, 8], [4.9, 0.1], [5.1, 0.1], [5, 0.3]]
    F = [[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4], [2, 0, 3], [2, 3, 5]]
    result = cdcp_igl.annulus_map(V, F)
    assert result.conformal
    assert result.distortion.mean < 4.2
    assert result.report()["boundary"]["method"].startswith("arc length")


def test_a_ring_with_an_arm_whose_end_is_too_small_to_be_seen():
    """Faces between three vertices of the circle would have no area."""
    x, y, F = meshes.cells(10, 30)
    column, row = np.floor([x[F].mean(axis=1), y[F].mean(axis=1)])
    hole = (column == 4) & (row == 4)
    arm = (column >= 9) & (row > 2) & (row < 6)
    used, G = np.unique(F[(column < 9) & ~hole | arm], return_inverse=True)
    V = np.column_stack([x, y])[used]
    assert cdcp_igl.annulus_map(V, G.reshape(-1, 3)).valid


def pierced_star(seed, n):
    """A star of n vertices less two faces far from each other."""
    V, F = star(seed, n)
    middle = V[F].mean(axis=1)
    far = int(np.linalg.norm(middle - middle[0], axis=1).argmax())
    return V, np.delete(F, [0, far], axis=0)


@pytest.mark.parametrize(("seed", "n"), [(8, 12), (11, 12), (3, 20), (8, 60), (11, 150), (23, 150)])
def test_where_angles_by_flux_flip_faces_a_disk_is_embedded(seed, n):
    """Outside are three vertices: on the chords between them, much lies inside of the circle."""
    result = cdcp_igl.annulus_map(*pierced_star(seed, n))
    assert result.valid
    assert result.boundary.startswith("arc length, hole ")


def test_where_flux_crowds_the_loops_a_disk_is_embedded(real_mesh):
    """A ragged sheet less the face that is farthest from its edge: 55 degrees by flux, refined."""
    V, F = real_mesh("lost/disk_heleshaw_3505")
    edge = V[DiskMesh(V, F).loop]
    face = KDTree(edge).query(V[F].mean(axis=1))[0].argmax()
    result = cdcp_igl.annulus_map(V, np.delete(F, face, axis=0))
    assert result.boundary.startswith("arc length")
    assert result.distortion.mean < 22


def test_no_vertex_runs_to_the_middle():
    mesh = AnnulusMesh(*pierced_star(0, 40))
    f = embedded_ring(mesh)
    strip, step = np.log(f), np.zeros(len(f), dtype=complex)
    step[mesh.interior[0]] = -1e4
    moved = Ring().moved(mesh, strip, step)
    assert moved.real.min() == moved.real[mesh.loops[1]].mean() - 1


@pytest.mark.parametrize("seed", range(5))
def test_rings_are_embedded_by_disks_whose_hole_is_filled(seed):
    mesh = AnnulusMesh(*pierced_star(seed, 40))
    assert certify_ring(mesh, embedded_ring(mesh)).valid


@pytest.mark.parametrize(("seed", "n"), [(91, 10), (4, 12), (0, 15), (16, 20)])
def test_a_hole_is_pulled_to_a_circle_where_no_face_leaves_it_room(seed, n):
    """Its corners reach around others: neither as large as it is nor as a point is it a circle."""
    assert cdcp_igl.annulus_map(*pierced_star(seed, n), refine=0).valid


def test_a_slit_is_pulled_to_a_circle():
    V, F, _ = cdcp_igl.datasets.square(10)
    middle = np.flatnonzero((abs(V[:, 1]) < 1e-9) & (abs(V[:, 0]) < 0.5))
    above = V[F].mean(axis=1)[:, 1] > 0
    row = np.arange(len(V))
    row[middle] = len(V) + np.arange(len(middle))
    mesh = AnnulusMesh(np.vstack([V, V[middle]]), np.where(above[:, None], row[F], F))
    assert len(mesh.loops[1]) == 2 * len(middle) + 2
    assert certify_ring(mesh, embedded_ring(mesh)).valid


def test_a_vertex_that_one_corner_draws_most_is_in_the_middle_all_the_same():
    """By mean values alone it would have to lie at more than half of the way to that corner."""
    outside = np.exp([0, 2j * np.pi / 3, 4j * np.pi / 3])
    z = np.append(outside, [0.85, 0.9])
    F = [[0, 1, 4], [0, 4, 2], [1, 2, 3], [1, 3, 4], [2, 4, 3]]
    disk = DiskMesh(coordinates(z), F)
    f = np.zeros(5, dtype=complex)
    f[disk.loop] = arc_length_map(disk)
    assert abs(tutte_embedding(disk, f)[0][-1]) > 0.5
    f, _ = centered(disk, f[disk.loop], 4)
    assert f[-1] == 0
    assert certify(disk, coordinates(f)).valid


def test_the_lowest_of_refined_rings_is_taken_though_the_scale_does_not_explain_it(monkeypatch):
    surface = spiky_ring(36)
    result = cdcp_igl.annulus_map(*surface)
    assert not result.conformal

    monkeypatch.setattr("cdcp_igl.maps.rules.MARGIN", 2)
    conformal = cdcp_igl.annulus_map(*surface)
    assert conformal.conformal
    assert conformal.boundary != result.boundary
    assert result.distortion.mean < 0.8 * conformal.distortion.mean


def test_other_loops_are_filled():
    V, F = pierced_sphere()
    result = cdcp_igl.annulus_map(V, F)
    assert result.valid
    assert result.filled == 2
    assert result.uv.shape == (len(V), 2)
    assert len(result._surface()[1]) == len(F)


@pytest.mark.parametrize("name", ["loops_beetle_19887", "loops_legohead_4179", "loops_plane_8519"])
def test_real_surfaces(real_mesh, name):
    V, F = real_mesh(f"any/{name}")
    harmonic, due, refined = (cdcp_igl.annulus_map(V, F, refine=steps) for steps in (0, None, 5))
    assert due.conformal
    assert refined.distortion.mean < harmonic.distortion.mean


def test_a_certificate_sees_what_is_wrong():
    V, F, _ = ring(4, 12, lambda s: (0.5**s, 0 * s))
    mesh, f = AnnulusMesh(V, F), V[:, 0] + 1j * V[:, 1]
    swapped, off_circle = f.copy(), f.copy()
    swapped[[0, 1]] = f[[1, 0]]
    off_circle[-1] *= 0.9
    assert certify_ring(mesh, f).valid
    for wrong in (f.conj(), 1 / f, f * np.nan, f * 1e-150, swapped, off_circle):
        assert not certify_ring(mesh, wrong).valid


def test_on_the_command_line_and_what_is_refused(tmp_path):
    V, F, _ = ring(4, 12, lambda s: (0.5**s, 0 * s))
    source = tmp_path / "ring.obj"
    cdcp_igl.io.write_map(source, V, F, V[:, :2])
    assert "cdcp-igl map --annulus" in invoke("check", source).stdout
    views = "--picture", tmp_path / "ring.png", "--view", tmp_path / "ring.html"
    done = invoke("map", "--annulus", "--refine", 3, source, tmp_path / "ring.glb", *views)
    assert "annulus map of 60 vertices: valid" in done.stdout
    assert "angle errors in the 1.5-norm" in done.stdout
    for wrong in ("--free", "--sphere"):
        assert invoke("map", "--annulus", wrong, source, tmp_path / "x.obj").exit_code == 2
    result = cdcp_igl.annulus_map(V, F)
    assert result.report()["modulus"] == result.modulus
