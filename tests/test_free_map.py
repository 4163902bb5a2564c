"""Maps with a free outline: what is flat, caps, cones, given boundaries, and overlaps."""

import itertools
import pickle
from fractions import Fraction

import numpy as np
import pytest
import surfaces
from batches import batch
from hypothesis import given, settings
from hypothesis import strategies as st
from meshes import TRIANGLE, TWO_TRIANGLES, cells, fan, grid, rugged, strip

import cdcp_igl
from cdcp_igl.datasets import ellipse, paraboloid, spherical_cap
from cdcp_igl.descent.descent import Descent
from cdcp_igl.descent.energies import Angles
from cdcp_igl.descent.schedules import Directions
from cdcp_igl.descent.targets import PLANE
from cdcp_igl.libigl import grid_faces
from cdcp_igl.surface.mesh import DiskMesh
from cdcp_igl.verdict.distortion import plane_angles
from cdcp_igl.verdict.outline import certify_outline, meeting_edges

# Mean and SD of the angular distortion in degrees, at most: with no step, which is at or below
# LSCM, and with five, below Blender's angle-based unwrapping, whose means are the third column.
SCANS = {
    "chinese_lion_17334": ((1.256, 1.102), (1.157, 1.078), 1.211),
    "human_face_17157": ((1.112, 1.831), (1.081, 1.773), 1.099),
    "human_brain_48463": ((1.444, 1.513), (1.278, 1.472), 1.368),
    "left_hand_53054": ((1.160, 0.941), (1.135, 0.944), 1.221),
    "camelhead_11381": ((1.400, 1.408), (1.340, 1.366), 1.369),
    "femur_2411": ((4.810, 3.730), (4.159, 3.467), 32),
    "gcanyon_216196": ((0.365, 0.653), (0.335, 0.639), np.inf),
}


def aligned(z, w):
    """A map z, moved and turned to lie over w."""
    z, middle = z - z.mean(), w.mean()
    turn = (z.conj() * (w - middle)).sum()
    return z * turn / abs(turn) + middle


def error(result, exact):
    z, w = result.uv @ [1, 1j], exact @ [1, 1j]
    return np.sqrt((abs(aligned(z, w) - w) ** 2).mean())


def sector(n, turns, radii=(1, 3), height=0.0):
    """A flat ring, opened and wound around so many turns, each lying higher than the last."""
    x, y, F = cells(n + 1, round(12 * n * turns) + 1)
    t, r = 2 * np.pi * turns * (1 - x / x.max()), radii[0] + (radii[1] - radii[0]) * y / n
    return np.column_stack([r * np.cos(t), r * np.sin(t), height * t]), F


# -- what is known ---------------------------------------------------------------------


@settings(max_examples=20)
@given(st.integers(0, 50), st.floats(0, 6), st.integers(-90, 90))
def test_what_is_flat_is_mapped_to_itself_in_any_place_and_unit(seed, angle, exponent):
    V, F = grid(6, 8, seed=seed)
    V[:, 2] = 0
    c, s = np.cos(angle), np.sin(angle)
    turned = 10.0**exponent * (V @ [[c, 0, s], [0, 1, 0], [-s, 0, c]] + [1, 2, 3])
    result = cdcp_igl.free_map(turned, F)
    size = 10.0**exponent
    assert error(result, size * V[:, :2]) < 1e-12 * size
    assert result.area_ratio == pytest.approx(1)
    assert result.distortion.max < 1e-5


def test_a_cap_converges_to_its_stereographic_projection():
    """With the length of its rim; at the pole the scale is cos^2 of half the polar angle."""
    errors, scales = [], []
    for n in (10, 20, 40):
        V, F, exact = spherical_cap(n, angle=100)
        result = cdcp_igl.free_map(V, F)
        errors.append(error(result, exact * np.sin(np.radians(100))))
        u = cdcp_igl.conformal_factor(V, F, result.uv)
        scales.append(abs(np.exp(u[V[:, 2].argmax()]) - np.cos(np.radians(50)) ** 2))
    assert np.log2(errors[0] / errors[-1]) / 2 > 1.9
    assert np.log2(scales[0] / scales[-1]) / 2 > 1.7
    assert scales[-1] < 2e-4


def test_a_sector_of_a_cone_unrolls():
    """Its triangles are flat around every vertex: all lengths are kept."""
    errors = []
    for n in (4, 8, 16):
        V, F = sector(n, 0.6)
        exact = V[:, :2]
        r, t = np.hypot(*exact.T), np.arctan2(exact[:, 1], exact[:, 0]) % (2 * np.pi)
        k = 0.7  # of its radius, that of the circle on the cone
        height = r * np.sqrt(1 - k**2)
        cone = np.column_stack([k * r * np.cos(t / k), k * r * np.sin(t / k), height])
        result = cdcp_igl.free_map(cone, F)
        assert abs(cdcp_igl.conformal_factor(cone, F, result.uv)).max() < 1e-12
        errors.append(error(result, exact))
    assert np.log2(errors[0] / errors[-1]) / 2 > 1.9


@pytest.mark.parametrize("surface", [ellipse, paraboloid])
def test_the_scale_of_the_map_onto_the_disk_gives_the_disk(surface):
    errors = []
    for n in (10, 20, 40):
        V, F, exact = surface(n)
        scale = np.exp(cdcp_igl.conformal_factor(V, F, exact))
        result = cdcp_igl.free_map(V, F, boundary_scale=scale)
        assert result.boundary == "given scale"
        errors.append(error(result, exact))
    assert np.log2(errors[0] / errors[-1]) / 2 > 1.5
    assert errors[-1] < 0.003


def test_four_right_angles_give_the_rectangle():
    errors = []
    for n in (6, 12, 24):
        x, y, F = cells(n + 1, 2 * n + 1)
        x, y = x / n, y / n
        V = np.column_stack([x + y * y / 5, y, 0.4 * np.sin(2 * x) * np.cos(y)])
        corners = [0, 2 * n, len(V) - 1, len(V) - 1 - 2 * n]
        result = cdcp_igl.free_map(V, F, corners=dict.fromkeys(corners, np.pi / 2))
        assert result.boundary == "given angles"
        sides = abs(np.diff(result.uv[[*corners, 0]] @ [1, 1j]))
        assert sides[:2] == pytest.approx(sides[2:])
        modulus = np.mean(cdcp_igl.rectangle_map(V, F, corners).modulus_bounds)
        errors.append(abs(sides[0] / sides[1] - modulus))
    assert np.log2(errors[0] / errors[-1]) / 2 > 0.8
    assert errors[-1] < 0.003


# -- scans -----------------------------------------------------------------------------


@pytest.mark.parametrize("name", SCANS)
def test_scans(real_mesh, name):
    mapper, (plain, refined, blender) = cdcp_igl.DiskMapper(*real_mesh(name)), SCANS[name]
    for steps, (mean, sd) in ((0, plain), (5, refined)):
        result = mapper.free(refine=steps)
        assert result.valid
        assert result.boundary == "own lengths"
        assert result.distortion.mean <= mean
        assert result.distortion.sd <= sd
    assert result.distortion.mean < blender


# -- refinement ------------------------------------------------------------------------


def test_a_step_with_a_free_outline_is_that_of_the_normal_equations():
    mesh = DiskMesh(*grid(6, 7))
    z = cdcp_igl.free_map(mesh.scaled, mesh.F, refine=0).uv @ [1, 1j]
    h, r = 1e-6, plane_angles(z, mesh.F) - mesh.angles

    def angles(x):
        return (plane_angles(z + x.view(complex), mesh.F)).ravel()

    J = np.array([(angles(x) - angles(-x)) / (2 * h) for x in h * np.eye(2 * len(z))]).T
    direct = np.linalg.lstsq(J, -r.ravel(), rcond=1e-8)[0]
    energy = Angles(mesh, PLANE, 2)
    model = energy.quadratic(energy.measured(z, ([], 0)), 2, 0)
    step, *_ = Descent(mesh, z).direction(model, Directions(60, 0, None, 0))
    np.testing.assert_allclose(J @ step.view(float), J @ direct, atol=1e-7)


def test_refinement_frees_the_outline_and_keeps_its_length():
    V, F = grid(9, 11)
    plain, refined = (cdcp_igl.free_map(V, F, refine=steps) for steps in (0, 4))
    assert plain.refinement is None
    assert refined.refinement.steps == 4
    assert refined.refinement.after < refined.refinement.before
    assert refined.distortion.mean < min(
        plain.distortion.mean, cdcp_igl.disk_map(V, F).distortion.mean
    )
    ends = np.append(plain.mesh.loop, plain.mesh.loop[0])
    for P in (plain.uv, refined.uv):
        length = np.linalg.norm(np.diff(P[ends], axis=0), axis=1).sum()
        assert length == pytest.approx(np.linalg.norm(np.diff(V[ends], axis=0), axis=1).sum())


def test_what_is_not_conformal_is_refined_as_needed():
    V, F = rugged(0)
    assert cdcp_igl.free_map(V, F).refinement.steps > 0


def walk(n, *corners):
    """Vertices of a grid of n by n along straight lines between corners (i, j)."""
    runs = [
        np.linspace(a, b, max(map(abs, np.subtract(b, a))) + 1)[:-1]
        for a, b in itertools.pairwise(corners)
    ]
    return (np.vstack([*runs, corners[-1:]]).round().astype(int)) @ [n, 1]


@pytest.mark.parametrize(
    "corners",
    [
        [(0, 8), (8, 8)],
        [(0, 4), (12, 4), (12, 12), (4, 12)],
        [(0, 2), (14, 2), (14, 14), (3, 14), (3, 5), (11, 5), (11, 11), (7, 7)],
    ],
    ids=["slit", "hook", "spiral"],
)
@pytest.mark.parametrize("size", [1, 1e-6])
def test_what_is_flat_keeps_its_shape_along_any_slit(corners, size):
    """Both sides of it lie in the same place, which is no overlap."""
    x, y, F = cells(17, 17)
    V = np.column_stack([x, y]) * size
    opened = cdcp_igl.cut(V, F, walk(17, *corners))
    result = cdcp_igl.free_map(opened.V, opened.F)
    assert result.boundary == "own lengths"
    assert error(result, opened.V) < 1e-9 * size


# -- overlaps --------------------------------------------------------------------------


@pytest.mark.parametrize(("turns", "boundary"), [(1.3, "eased by 8%"), (6, "eased from the disk")])
def test_an_outline_that_overlaps_itself_is_eased(turns, boundary):
    V, F = sector(3, turns, height=0.1)
    result = cdcp_igl.free_map(V, F)
    assert result.valid
    assert result.boundary == boundary
    assert result.boundary in str(result)
    assert result.distortion.mean <= cdcp_igl.free_map(V, F, refine=0).distortion.mean
    assert result.conformal
    assert result.distortion.mean < 2


@pytest.mark.parametrize("options", [{}, {"refine": 0}, {"refine": 3}, {"keep": "lengths"}])
@pytest.mark.parametrize("turns", [0.5, 1.3, 6])
def test_the_centroid_of_the_surface_is_the_origin(turns, options):
    V, F = sector(3, turns, height=0.1)
    made = [cdcp_igl.free_map(V + 100, F, **options)]
    made += [made[0].continued(keep="areas")] if turns < 1 else []
    area = np.linalg.norm(np.cross(*np.moveaxis(np.diff(V[F], axis=1), 1, 0)), axis=1)
    for result in made:
        centroid = np.average(result.uv[F].mean(axis=1), weights=area, axis=0)
        assert abs(centroid).max() < 1e-9 * np.ptp(result.uv)


def test_pins_hold_a_map_wherever_its_centroid_is():
    V, F = sector(3, 0.5)
    pins = {0: (50, 60), 5: (52, 60)}
    result = cdcp_igl.free_map(V, F, pins=pins)
    for made in (result, result.continued(keep="lengths")):
        np.testing.assert_array_equal(made.uv[[*pins]], [*pins.values()])


def test_an_eased_outline_is_refined():
    """Though its sides lie close together: 4 % is gained if all vertices wait for those there."""
    V, F = sector(3, 1.3, height=0.1)
    plain = cdcp_igl.free_map(V, F, refine=0)
    assert cdcp_igl.free_map(V, F).distortion.mean < 0.93 * plain.distortion.mean


def test_the_outline_of_a_disk_is_freed_without_shear():
    """Refinement alone stops at 21 degrees, where faces are stretched 44 times."""
    result = cdcp_igl.free_map(*sector(3, 6, height=0.1), refine=0)
    assert result.boundary == "eased from the disk"
    assert result.distortion.mean < 1.6
    assert result.conformality.stretch < 1.1


def test_an_outline_that_was_asked_for_and_overlaps_itself_is_refused():
    V, F = sector(3, 1.3, height=0.1)
    with pytest.raises(cdcp_igl.MapError, match="overlaps itself at") as caught:
        cdcp_igl.free_map(V, F, boundary_scale=np.ones(len(V)))
    result = pickle.loads(pickle.dumps(caught.value)).result
    assert not result.valid
    assert len(result.certificate.flipped) == 0
    assert "NOT VALID" in str(result)
    loop = result.mesh.loop
    after = dict(zip(loop, np.roll(loop, -1), strict=True))
    for a, c in result.report()["certificate"]["meeting_edges"]:
        assert cross(*(tuple(map(Fraction, result.uv[v])) for v in (a, after[a], c, after[c])))


def cross(a, b, c, d):
    """Whether segments have a point in common, in exact arithmetic."""

    def side(p, q, r):
        return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])

    if any(max(a[k], b[k]) < min(c[k], d[k]) or max(c[k], d[k]) < min(a[k], b[k]) for k in (0, 1)):
        return False
    return side(a, b, c) * side(a, b, d) <= 0 and side(c, d, a) * side(c, d, b) <= 0


@settings(max_examples=300)
@given(st.lists(st.tuples(st.integers(0, 6), st.integers(0, 6)), min_size=3, max_size=9))
def test_edges_that_meet_are_found(points):
    """Against all pairs in fractions; of two neighbours, whether they go back along one line."""
    n = len(points)
    if any(points[i] == points[i - 1] for i in range(n)):
        return  # no edge, and the faces there have no area
    meeting = set()
    for i in range(n):
        for j in range(i + 1, n):
            a, b, c, d = points[i], points[i + 1], points[j], points[(j + 1) % n]
            if j - i in (1, n - 1):
                p, q, r = (a, b, d) if j - i == 1 else (c, a, b)
                (u, v), (x, y) = np.subtract(p, q), np.subtract(r, q)
                back = u * y == v * x and u * x + v * y > 0
            else:
                back = cross(a, b, c, d)
            if back:
                meeting.add((i, j))
    found = meeting_edges(np.array(points, dtype=float) @ [1, 1j])
    assert set(map(tuple, found.tolist())) == meeting


def test_the_certificate_is_of_the_coordinates():
    V, F = grid()
    mesh, uv = DiskMesh(V, F), cdcp_igl.free_map(V, F).uv
    assert certify_outline(mesh, uv).valid
    mirrored = certify_outline(mesh, uv * [1, -1])
    assert mirrored.winding_number == -1
    assert len(mirrored.flipped) == len(F)
    assert not certify_outline(mesh, uv * np.nan).valid
    inside = np.where(mesh.on_boundary[:, None], uv, uv.mean(axis=0))
    assert len(certify_outline(mesh, inside).meeting) == 0
    assert not certify_outline(mesh, inside).valid


# -- the rest --------------------------------------------------------------------------


def test_small_disks():
    for V, F in (TRIANGLE, TWO_TRIANGLES, fan(), strip()):
        for refine in (None, 3):
            assert cdcp_igl.free_map(V, F, refine=refine).valid


@pytest.mark.parametrize(("seed", "most"), [(184, 5.0), (207, 2.1), (337, 3.6), (532, 4.3)])
def test_one_flipped_face_of_few_is_repaired(seed, most):
    """And is not so many that another Laplacian is better: that leaves a third more."""
    rng, (V, F) = np.random.default_rng(seed), grid(4, 5)
    V = V * [1, rng.uniform(0.2, 1), 1] + rng.normal(size=V.shape) * rng.choice([0.05, 0.1, 0.2])
    result = cdcp_igl.free_map(V, F)
    assert (result.repair.n_flipped, result.conformal) == (1, True)
    assert result.distortion.mean < most


@pytest.mark.parametrize("gap", [0, 3e-16])
def test_sides_that_touch_do_not_cross_wherever_the_map_is_moved(gap):
    """Two strips with a gap of no width between them, whose sides have other vertices."""

    def rows(n, low):
        x = np.linspace(0, 1, n)
        return np.concatenate([np.column_stack([x, np.full(n, y)]) for y in (low, low + 1)])

    left = np.array([[-0.3, 0], [-0.3, 1], [-0.3, 2]])
    points = np.concatenate([left, rows(8, 0), rows(12, 1 + gap)])
    F = np.concatenate([grid_faces(8, 2) + 3, grid_faces(12, 2) + 19])
    F = np.concatenate([F, [[0, 3, 11], [0, 11, 1], [1, 11, 31], [1, 31, 2]]])
    F[F == 19] = 11  # the end of the gap
    kept, rows_kept = np.unique(F, return_inverse=True)
    F = rows_kept.reshape(-1, 3)
    for angle in np.arange(30) + 0.1:
        turn = [[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]
        V = points[kept] @ turn
        result = cdcp_igl.surface_map(V, F, merge=False)
        assert len(result.charts) == 1
        assert result.distortion.mean < 1e-8
        assert cdcp_igl.certify(V, F, result.packed()).valid


def test_a_mapper_makes_the_same_map_and_keeps_its_factor():
    V, F = grid(9, 11)
    mapper, seen = cdcp_igl.DiskMapper(V, F), []
    options = {"align": [1, 0, 0], "refine": 2}
    expected = cdcp_igl.free_map(V, F, **options, progress=lambda *step: seen.append(step))
    for _ in range(2):
        np.testing.assert_array_equal(mapper.free(**options).uv, expected.uv)
    assert mapper.map().valid
    assert seen[-1] == ("done", 1.0)
    assert cdcp_igl.free_map(V, F, solver="scipy").solver.startswith("SuperLU")


def test_in_batches(tmp_path):
    V, F = grid(9, 11)
    np.savez(tmp_path / "surface.npz", V=V, F=F)
    (record,) = batch([tmp_path], tmp_path / "maps", free=True, refine=1).records
    assert (record.status, record.boundary) == ("done", "own lengths")
    with np.load(tmp_path / "maps" / "surface.npz") as saved:
        np.testing.assert_array_equal(saved["uv"], cdcp_igl.free_map(V, F, refine=1).uv)
    batch([tmp_path / "surface.npz"], tmp_path / "charts", free=True, cut=True)
    with np.load(tmp_path / "charts" / "surface.npz") as saved:
        expected = cdcp_igl.surface_map(V, F, outline="free")
        np.testing.assert_array_equal(saved["uv"], expected.uv)
    for options in ({"disk": True}, {"center": 3}):
        with pytest.raises(ValueError, match=r"leave out|center: no option"):
            batch([tmp_path], tmp_path / "others", free=True, **options)


def test_a_vertex_lies_to_the_right():
    V, F = grid(6, 4)
    for vertex in DiskMesh(V, F).loop[[0, 5, 9]].tolist():
        u, v = cdcp_igl.free_map(V, F, align=vertex).uv[vertex]
        assert u > 0
        assert abs(v) < 1e-12


def test_a_clockwise_plane_mesh_keeps_its_shape_in_all_that_is_done_with_its_map():
    V, F, _ = cdcp_igl.datasets.square(6)
    flat, F = V[:, :2] * [2, 1], F[:, ::-1]
    for result in (
        cdcp_igl.free_map(flat, F, align=[1, 0, 0]),
        cdcp_igl.DiskMapper(flat, F).free(align=[1, 0, 0]),
        cdcp_igl.free_map(flat, F, align=[1, 0, 0], keep="lengths").continued(keep=0.9),
    ):
        assert result.mirrored
        assert "as seen from above" in str(result)
        assert abs(result.uv - flat).max() < 1e-9
        assert abs(result.area_distortion()).max() < 1e-9
        assert abs(result.apply(*result.invert(flat)) - flat).max() < 1e-9
        assert result.pattern().area == pytest.approx(8)
    assert (
        abs(result.bake(flat, 64)[::63, ::63] - [[[-2, 1], [2, 1]], [[-2, -1], [2, -1]]]).max() < 2
    )
    pins = {0: result.uv[0], len(V) - 1: result.uv[-1] * [1.5, 1]}
    longer = cdcp_igl.free_map(flat, F, pins=pins)
    assert abs(longer.uv[-1] - [3, 1]).max() < 1e-9


def test_faces_at_the_outline_are_repaired_with_it():
    """Inside alone a face that has two vertices on the outline cannot be: 9.8 degrees."""
    V, F = surfaces.needles(4, 24)
    result = cdcp_igl.free_map(V, F)
    assert result.boundary == "own lengths"
    assert result.repair.n_flipped > 0
    assert result.distortion.mean < 5
    length = np.linalg.norm(V[result.mesh.loop] - V[np.roll(result.mesh.loop, -1)], axis=1).sum()
    outline = result.uv[result.mesh.loop]
    assert np.linalg.norm(outline - np.roll(outline, -1, axis=0), axis=1).sum() == pytest.approx(
        length
    )
