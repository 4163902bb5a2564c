"""The boundary: its trace, the centre, the way onto the circle."""

import re
from functools import cache

import meshes
import numpy as np
import pytest
from igl import internal_angles
from scipy.optimize import least_squares, nnls
from surfaces import capped_tube

import cdcp_igl
from cdcp_igl import datasets, disk_map
from cdcp_igl.datasets import spherical_cap
from cdcp_igl.descent.collapsed_faces import open_collapsed_faces
from cdcp_igl.solve.factored import FactoredSurface
from cdcp_igl.solve.laplacian import Laplacian, cotangent_laplacian
from cdcp_igl.starts.boundary import FALLBACKS, around, by_inscribed_angles, harmonic_shares
from cdcp_igl.steps import zipper
from cdcp_igl.steps.center import central_face
from cdcp_igl.steps.circle import Rejected, onto_circle, whiten_trace, whitened_geodesic_map
from cdcp_igl.steps.mobius import mobius_transformation
from cdcp_igl.steps.trace import boundary_trace, conjugate_trace, face_dipole
from cdcp_igl.steps.zipper import geodesic_map, open_arcs, open_blocks
from cdcp_igl.surface.mesh import DiskMesh
from cdcp_igl.surface.triangles import flipped_faces
from cdcp_igl.verdict.certificate import increments, is_around

TRACES = [conjugate_trace, boundary_trace]
EXACT = [datasets.spherical_cap, datasets.ellipse, datasets.square, datasets.paraboloid]
RESOLUTIONS = (10, 20, 40, 80)
POLES = 0.2 * np.exp(1j * np.arange(1, 7))  # off the centre, where no symmetry helps


def apart(f, g):
    """Largest distance of two maps of the boundary, up to a Möbius transformation."""

    def difference(parameters):
        x, y, angle = parameters
        return mobius_transformation(f, x + 1j * y) * np.exp(1j * angle) - g

    start = [0, 0, np.angle(np.vdot(f, g))]
    fitted = least_squares(lambda p: difference(p).view(float), start, xtol=1e-14, ftol=1e-14)
    return abs(difference(fitted.x)).max()


@cache
def factored(exact, resolution):
    V, F, uv = exact(resolution)
    return uv @ [1, 1j], FactoredSurface.of(DiskMesh(V, F))


def on_the_circle(exact, resolution, pole, traces):
    """The boundary by the exact map with the pole at 0, and by each of the traces."""
    z, surface = factored(exact, resolution)
    at_faces = z[surface.mesh.F].mean(axis=1)
    face = int(abs(at_faces - pole).argmin())
    known = mobius_transformation(z, at_faces[face])[surface.mesh.loop]
    return [known, *(whitened_geodesic_map(trace(surface, face)) for trace in traces)]


def rate(errors):
    """Order of convergence, from edges of one length to those of half of it and so on."""
    return np.log2(errors[0] / errors[-1]) / (len(errors) - 1)


@pytest.mark.parametrize("trace", TRACES)
def test_trace_is_clockwise(trace):
    z = trace(FactoredSurface.of(DiskMesh(*meshes.grid())), 33)
    assert (z.conj() * np.roll(z, -1)).imag.sum() < 0


@pytest.mark.parametrize("trace", TRACES)
@pytest.mark.parametrize("exact", EXACT)
def test_second_order_against_exact_maps(exact, trace):
    errors = [apart(*on_the_circle(exact, n, POLES[0], [trace])) for n in RESOLUTIONS]
    assert errors[-1] < 1e-3
    assert rate(errors) > 1.8


@pytest.mark.parametrize("exact", EXACT[:3])
def test_order_of_the_conjugate_against_the_double_cover(exact, monkeypatch):
    """Of the traces alone, as so many points leave the zipper no part in it."""
    monkeypatch.setattr("cdcp_igl.steps.circle.ENOUGH_POINTS", 1_000)
    errors = []
    for n in RESOLUTIONS:
        maps = [on_the_circle(exact, n, pole, TRACES) for pole in POLES]
        errors.append(np.mean([apart(conjugate, cover) for _, conjugate, cover in maps]))
    assert errors[-1] < 5e-4
    assert rate(errors) > 1.9


def test_the_conjugate_trace_closes():
    surface = FactoredSurface.of(DiskMesh(*datasets.paraboloid(12)[:2]))
    z = conjugate_trace(surface, 100)
    steps = np.roll(z, -1) - z
    # Its last step is not computed, but what is left: it must be as long as those beside it.
    assert abs(steps[-1]) == pytest.approx(abs(steps[-2]), rel=0.2)


@pytest.mark.parametrize("corners", [1, 2])
def test_a_face_at_the_boundary_may_carry_the_dipole(corners):
    V, F, _ = datasets.spherical_cap(30)
    surface = FactoredSurface.of(DiskMesh(V, F))
    face = int((surface.mesh.on_boundary[F].sum(axis=1) == corners).argmax())
    assert is_around(whitened_geodesic_map(conjugate_trace(surface, face)))
    assert disk_map(V, F, center=face).valid


def test_a_dipole_far_from_the_boundary_leaves_the_trace_no_digits():
    """The map would change with the last digits of the vertices."""
    V, F = capped_tube()
    result = disk_map(V, F, refine=0)
    assert result.boundary.name == "harmonic measure"
    assert result.boundary.rejected == (
        "geodesic: the trace is too small for the digits of the dipole",
    )
    noise = 1e-15 * np.random.default_rng(0).normal(size=V.shape)
    assert abs(disk_map(V * (1 + noise), F, refine=0).uv - result.uv).max() < 1e-8


@pytest.mark.parametrize(
    ("name", "most"), [("femur_2411", 1e-4), ("left_hand_53054", 1e-4), ("face_1180_ears", 1e-6)]
)
def test_maps_do_not_change_with_the_last_digits(name, most, real_mesh, map_of):
    """Not even on a mesh with collapsed faces, whose angles on the disk are noise."""
    V, F = real_mesh(name)
    noise = 1e-15 * np.random.default_rng(0).normal(size=V.shape)
    moved, still = disk_map(V * (1 + noise), F), map_of(name)
    assert abs(moved.uv - still.uv).max() < most
    assert moved.distortion.mean == pytest.approx(still.distortion.mean, abs=1e-6)


@pytest.mark.parametrize("face", [0, 33, 69])
def test_dipole_is_the_gradient_on_its_face(face):
    mesh = DiskMesh(*meshes.grid())
    r = face_dipole(mesh, face)
    assert np.count_nonzero(r) == 3
    assert abs(r.sum()) < 1e-14
    # Applied to a linear function u, it gives |e| (u_x - i u_y) in the frame of the face.
    i, j, k = mesh.F[face]
    e = mesh.scaled[j] - mesh.scaled[i]
    length = np.linalg.norm(e)
    height = mesh.scaled[k] - mesh.scaled[i] - (mesh.scaled[k] - mesh.scaled[i]) @ e / length**2 * e
    x = (mesh.scaled - mesh.scaled[i]) @ e / length
    y = (mesh.scaled - mesh.scaled[i]) @ height / np.linalg.norm(height)
    assert r @ x == pytest.approx(length)
    assert r @ y == pytest.approx(-1j * length)


# -- the centre ------------------------------------------------------------------------


def center_of(V, F, method, well_shaped=True):
    return central_face(FactoredSurface.of(DiskMesh(V, F)), method, well_shaped=well_shaped)


@pytest.mark.parametrize("method", ["heat", "torsion", "centroid"])
def test_center_of_a_symmetric_cap_touches_the_pole(method):
    V, F, _ = spherical_cap(8)
    center = center_of(V, F, method)
    assert center.method == method
    assert 0 in F[center.face]


def test_slivers_at_the_center_are_avoided():
    # Pull the pole of a flat disk onto a neighbour: the most central faces get thin.
    V, F, _ = spherical_cap(8, angle=1.0)
    V[0] = 0.95 * V[1]
    chosen, literal = (center_of(V, F, "torsion", well_shaped) for well_shaped in (True, False))
    smallest = np.degrees(internal_angles(V, F).min(axis=1))
    assert smallest[literal.face] < 20 < smallest[chosen.face]
    paper = cdcp_igl.disk_map(V, F, preset="paper")
    assert paper.center.face == center_of(V, F, "heat", well_shaped=False).face
    assert smallest[paper.center.face] < 20


def test_given_face():
    center = center_of(*meshes.grid(), np.int32(3))
    assert (center.method, center.face) == ("given", 3)


def test_center_hardly_matters_after_the_moebius_step(map_of):
    others = ({"center": "heat"}, {"center": "centroid"})
    means = [map_of("chinese_lion_17334", **o).distortion.mean for o in ({}, *others)]
    assert np.ptp(means) < 5e-4


# -- whitening, the geodesic algorithm, harmonic measure, the order of the methods -----


def circle(n):
    return np.exp(2j * np.pi * np.arange(n) / n)


# Exterior maps zeta -> z of the unit circle with pole at infinity; zeta = 1 / w clockwise.
CURVES = {
    "circle": lambda zeta: 2 * zeta + 0.3,
    "ellipse": lambda zeta: 1.3 * zeta + 0.3 / zeta,
    "hypotrochoid": lambda zeta: zeta + 0.25 / zeta**2,
    "lopsided": lambda zeta: zeta + 0.1j / zeta + 0.12 / zeta**3,
}


def error_up_to_rotation(f, w):
    turn = f @ w.conj() / len(w)
    return abs(f - turn / abs(turn) * w).max()


@pytest.mark.parametrize("curve", CURVES.values(), ids=CURVES.keys())
def test_geodesic_algorithm_converges_on_known_curves(curve):
    errors = [
        error_up_to_rotation(geodesic_map(curve(circle(n).conj())), circle(n))
        for n in (100, 200, 400)
    ]
    assert errors[0] < 2e-3
    assert errors[0] / errors[2] > 4**1.8 or errors[2] < 1e-12  # second order


def snowflake(rounds):
    """Von Koch's curve, clockwise."""
    z = circle(3).conj()
    for _ in range(rounds):
        third = (np.roll(z, -1) - z) / 3
        tip = z + third + third * np.exp(1j * np.pi / 3)
        z = np.stack([z, z + third, tip, z + 2 * third], axis=1).ravel()
    return z


# Curves on which the next points go in and out: fjords, spikes, corners of all sizes, flat ones.
LONG_CURVES = {
    "hypotrochoid": CURVES["hypotrochoid"](circle(3000).conj()),
    "gear": ((1 + 0.3 * np.tanh(8 * (circle(3000) ** 12).imag)) * circle(3000)).conj(),
    "thin": circle(3000).conj().real + 0.05j * circle(3000).conj().imag,
    "snowflake": snowflake(5),
}


@pytest.mark.parametrize("z", LONG_CURVES.values(), ids=LONG_CURVES.keys())
def test_blocks_do_what_the_arcs_do_one_by_one(z):
    def opened(way):
        """The points on the circle, before the last edge of the curve closes."""
        x = np.append(1j * np.sqrt((z[2:] - z[0]) / (z[2:] - z[1])), 1j)
        y = np.zeros(len(x))
        way(x, y, len(z) - 2)
        return (y - x[-1]) / (y - x[-1].conj())

    by_blocks, one_by_one = opened(open_blocks), opened(open_arcs)
    assert error_up_to_rotation(by_blocks, one_by_one) < 2e-10
    assert np.any(by_blocks != one_by_one)


def test_the_work_grows_nearly_linearly(monkeypatch):
    """Points that are moved by single steps: twenty times more for ten times longer curves."""
    moved = []

    def open_and_count(x, y, k):
        moved.append((len(x) + len(y)) * k)
        open_arcs(x, y, k)

    monkeypatch.setattr(zipper, "open_arcs", open_and_count)
    work = []
    for n in (1000, 10_000):
        moved.clear()
        geodesic_map(CURVES["lopsided"](circle(n).conj()))
        work.append(sum(moved))
    assert work[1] < 20 * work[0]


def test_coincident_points_are_spread_by_chord_length():
    w = circle(200)
    z = CURVES["ellipse"](w.conj())
    crowded = np.insert(z, 50, z[50] + 1e-11 * np.array([3, 2, 1]) * (z[49] - z[50]))
    f = geodesic_map(crowded)
    assert (increments(f) > 0).all()
    assert increments(f).sum() == pytest.approx(2 * np.pi)
    assert error_up_to_rotation(np.delete(f, [50, 51, 52]), w) < 3e-3


def test_fewest_points():
    f = geodesic_map(circle(3).conj())
    assert (increments(f) > 0).all()
    assert increments(f).sum() == pytest.approx(2 * np.pi)


@pytest.mark.parametrize("curve", CURVES.values(), ids=CURVES.keys())
def test_whitening_makes_the_moments_of_inertia_equal(curve):
    z = curve(circle(400).conj())
    white = whiten_trace(5 * np.exp(1j) * (1.5 * z.real + 1j * z.imag) + 7)
    after = np.roll(white, -1)
    cross = (white.conj() * after).imag
    assert cross.sum() / 2 == pytest.approx(-np.pi)  # still clockwise
    assert abs((cross * (white + after)).sum()) < 1e-12
    assert abs((cross * (white**2 + white * after + after**2)).sum()) < 1e-3


def test_whitening_takes_an_ellipse_to_a_circle():
    z = CURVES["ellipse"](circle(400).conj())
    np.testing.assert_allclose(abs(whiten_trace(z)), 1, atol=1e-3)


MESH = DiskMesh(*meshes.grid(12, 16))
N = len(MESH.loop)
GOOD = CURVES["ellipse"](circle(N).conj())
CROSSING = circle(N).real + 1j * (circle(N) ** 2).imag  # figure of eight
EAR = int(MESH.inscribed[0])


@pytest.mark.parametrize("height", [0, 0.3])
def test_without_interior_vertices_no_map_changes_angles_less(height):
    """A polygon inscribed in a circle is its own map; lifted, other arcs are no better."""
    rng = np.random.default_rng(0)
    n = 12
    turn = 2 * np.pi * (np.arange(n) + np.append(0, rng.uniform(0, 0.9, n - 1))) / n
    V = np.column_stack([np.cos(turn), np.sin(turn), height * rng.normal(size=n)])
    F = np.array([[0, k, k + 1] for k in range(1, n - 1)])

    def squares(uv):
        return (cdcp_igl.angle_distortion(V, F, uv) ** 2).sum()

    result = cdcp_igl.disk_map(V, F, mobius=None)
    assert result.boundary.name == "inscribed angles"
    if height == 0:
        np.testing.assert_allclose(result.uv, V[:, :2], atol=1e-9)
    for _ in range(20):
        other = np.arctan2(*result.uv.T[::-1]) + 1e-3 * rng.normal(size=n)
        assert squares(np.column_stack([np.cos(other), np.sin(other)])) > squares(result.uv)


@pytest.mark.parametrize("height", [0, 0.3, 2])
def test_arcs_without_interior_vertices_are_the_least_squares_of_all_that_are_positive(height):
    """The oracle is dense: a column for each arc, whose halves add up to pi."""
    rng = np.random.default_rng(int(10 * height))
    for n in (3, 7, 20, 60):
        F, sides = [], [(0, n - 1)]
        for i, j in sides:
            if j - i > 1:
                k = int(rng.integers(i + 1, j))
                F.append((i, k, j))
                sides += [(i, k), (k, j)]
        turn = 2 * np.pi * np.arange(n) / n
        V = np.column_stack([np.cos(turn), np.sin(turn), height * rng.normal(size=n)])
        mesh = DiskMesh(V, F)
        first, last = (mesh.loop_index[np.roll(mesh.F, -k, axis=1)].ravel() for k in (1, 2))
        behind = (np.arange(n) - first[:, None]) % n < ((last - first) % n)[:, None]
        least = min(1e-3 * np.pi / n, mesh.angles.min())
        system = np.vstack([behind, np.full(n, 1e4)])
        wanted = np.append(mesh.angles.ravel(), 1e4 * np.pi)
        arcs = nnls(system, wanted - least * system.sum(axis=1))[0] + least
        np.testing.assert_allclose(by_inscribed_angles(mesh)[mesh.loop], around(arcs), atol=1e-6)


WAYS = ["geodesic", "harmonic measure", "arc length"]
NO_VERTEX = "harmonic measure: no interior vertex at the central face"


@pytest.mark.parametrize(
    ("trace", "face", "methods", "objections"),
    [
        (GOOD, 165, WAYS, []),
        (CROSSING, 165, WAYS[1:], ["geodesic: not "]),
        (0 * GOOD, 165, WAYS[1:], ["geodesic: not finite"]),
        (np.nan * GOOD, 165, WAYS[1:], ["geodesic: not finite"]),
        (CROSSING, EAR, WAYS[2:], ["geodesic: not ", NO_VERTEX]),
    ],
    ids=["good", "crossing", "a point", "not finite", "no interior vertex"],
)
def test_each_is_offered_when_the_one_before_is_rejected(trace, face, methods, objections):
    surface = FactoredSurface.of(MESH)
    offered, rejected = [], []
    for name, way in {"geodesic": lambda *_: onto_circle(trace), **FALLBACKS}.items():
        try:
            f = way(surface, face)
        except Rejected as objection:
            rejected.append(str(objection))
            continue
        np.testing.assert_allclose(abs(f), 1, atol=1e-14)
        assert f[0] == 1
        assert (increments(f) > 0).all()
        assert increments(f).sum() == pytest.approx(2 * np.pi)
        offered.append(name)
    assert offered == methods
    for found, expected in zip(rejected, objections, strict=True):
        assert found.startswith(expected)


@pytest.mark.parametrize("c", [0, 0.6 + 0.3j])
def test_harmonic_measure_converges_to_the_poisson_kernel(c):
    errors = []
    for n in (10, 20, 40):
        V, F, z = cdcp_igl.datasets.spherical_cap(n)
        mesh = DiskMesh(V, F)
        surface = FactoredSurface.of(mesh).delaunay
        z = z @ [1, 1j]
        face = abs(z[F].mean(axis=1) - c).argmin()
        steps = harmonic_shares(surface, face)
        exact = increments(mobius_transformation(z, z[F[face]].mean())[mesh.loop]) / (2 * np.pi)
        assert (steps > 0).all()
        assert steps.sum() == pytest.approx(1)
        errors.append(abs(steps - exact).sum())
    assert errors[0] < 0.1
    assert errors[0] / errors[2] > 3.5


def test_harmonic_measure_keeps_its_digits_where_it_is_tiny():
    lengths = [6, 12, 24, 48]
    smallest = []
    for length in lengths:
        V, F = meshes.corridor(length)
        mesh = DiskMesh(V, F)
        surface = FactoredSurface.of(mesh).delaunay
        face = np.linalg.norm(V[F].mean(axis=1) - V.mean(axis=0), axis=1).argmin()
        smallest.append(harmonic_shares(surface, face).min())
    rate = np.diff(np.log(smallest)) / np.diff(lengths)
    assert smallest[-1] < 1e-30
    np.testing.assert_allclose(rate, -np.pi / 2, rtol=0.05)


def test_a_crowded_surface_is_mapped_by_arc_length_and_told_so(map_of):
    result = map_of("maze_6120")
    assert result.certificate.valid
    assert result.boundary.name == "arc length"
    assert re.search(r"crowding, .* \(vertices \d+, \d+", str(result.boundary))


@pytest.mark.parametrize(("length", "width"), [(60, 4), (400, 2)])
def test_until_it_crowds(length, width):
    result = cdcp_igl.disk_map(*meshes.corridor(length, width))
    assert result.valid
    assert not result.conformal
    assert result.boundary.name == "arc length"
    assert "crowding" in result.boundary.rejected[1]


def test_only_collapsed_faces_are_opened_and_only_by_the_last_digits():
    """Corners in the wrong order are left to the certificate."""
    mesh = DiskMesh(*meshes.corridor(6))
    f = cdcp_igl.cdcp(mesh.V, mesh.F) @ [1, 1j]
    assert len(mesh.inscribed) == 2
    same, count = open_collapsed_faces(mesh, f)
    assert same is f
    assert count == 0
    one, other, _ = mesh.F[mesh.inscribed[0]]
    f[[one, other]] = f[[other, one]]
    g, count = open_collapsed_faces(mesh, f)
    assert count == 1
    np.testing.assert_allclose(g, f, atol=1e-12)


@pytest.mark.parametrize("seed", [1, 2, 5])
def test_faces_that_collapse_as_others_are_opened_are_opened_in_turn(seed):
    mesh, rng = DiskMesh(*meshes.strip(6)), np.random.default_rng(seed)
    arcs = 10 ** rng.uniform(-15, -7, len(mesh.loop))
    arcs[rng.integers(len(arcs), size=1 + seed % 2)] = 1
    f = np.zeros(len(mesh.scaled), complex)
    f[mesh.loop] = np.exp(1j * (2 * np.pi * np.cumsum(arcs) / arcs.sum() + seed))
    g, count = open_collapsed_faces(mesh, f)
    assert count > 0
    assert len(flipped_faces(g, mesh.F)[0]) == 0


@pytest.mark.parametrize("turn", [0, 2])
def test_a_collapsed_ear_is_held_open_by_the_last_digits(turn):
    mesh = DiskMesh(*meshes.corridor(6))
    ear = mesh.F[mesh.inscribed[0]]
    tip = np.flatnonzero(np.isin(mesh.loop, ear))[1]
    angles = np.linspace(0, 2 * np.pi, len(mesh.loop), endpoint=False) + turn
    angles[[tip - 1, tip + 1]] = angles[tip] + np.array([-1e-12, 1e-12])
    f = np.zeros(len(mesh.scaled), complex)
    f[mesh.loop] = np.exp(1j * angles)
    f[mesh.loop[tip]] *= 1 - 1e-15
    flipped, _ = flipped_faces(f, mesh.F[mesh.inscribed])
    assert 0 in flipped
    g, count = open_collapsed_faces(mesh, f)
    assert count == len(flipped)
    flipped, _ = flipped_faces(g, mesh.F[mesh.inscribed])
    assert len(flipped) == 0
    assert abs(g - f).max() < 3e-15
    assert np.flatnonzero(g != f).tolist() == [mesh.loop[tip]]


def test_an_ear_that_is_turned_over_is_none_that_has_collapsed():
    mesh = DiskMesh(*meshes.corridor(6))
    f = cdcp_igl.cdcp(mesh.V, mesh.F) @ [1, 1j]
    f[mesh.F[mesh.inscribed[0]]] = np.exp([0, 0.002j, 0.001j])
    assert 0 in flipped_faces(f, mesh.F[mesh.inscribed])[0]
    same, count = open_collapsed_faces(mesh, f)
    assert same is f
    assert count == 0


def test_given_boundary_values_do_not_see_the_boundary_edges():
    """Obtuse angles opposite the boundary make negative weights, which eq. (18) does see."""
    V, F, _ = cdcp_igl.datasets.paraboloid(8)
    mesh = DiskMesh(V, F)
    L = cotangent_laplacian(mesh)
    along = mesh.on_boundary[L.low] & mesh.on_boundary[L.high]
    other = Laplacian.of(L.low, L.high, np.where(along, 0.5, 1) * L.weights, len(V))
    one, two = (FactoredSurface(mesh, M) for M in (L, other))
    face = len(F) // 2
    for seen in (harmonic_shares, conjugate_trace):
        np.testing.assert_array_equal(seen(one, face), seen(two, face))
    assert abs(boundary_trace(one, face) - boundary_trace(two, face)).max() > 0.01
