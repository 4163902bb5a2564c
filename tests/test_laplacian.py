"""What comes out of libigl, what must be more exact, and the Laplacian with its factor."""

import subprocess
import sys
from collections import Counter, defaultdict
from pathlib import Path

import igl
import meshes
import mpmath
import numpy as np
import pytest
from scipy.spatial import Delaunay

import cdcp_igl
from cdcp_igl import libigl
from cdcp_igl.datasets import square
from cdcp_igl.solve.factored import FactoredSurface
from cdcp_igl.solve.laplacian import cotangent_laplacian, intrinsic_delaunay_laplacian
from cdcp_igl.solve.ordering import LARGE, dissected
from cdcp_igl.solve.solvers import solver, using
from cdcp_igl.surface.delaunay import intrinsic_delaunay
from cdcp_igl.surface.mesh import DiskMesh, Mesh
from cdcp_igl.surface.triangles import corner_cotangents, degenerate_faces, face_areas
from cdcp_igl.verdict.distortion import angle_distortion


def test_the_main_path_computes_with_libigl(monkeypatch):
    """Cotangents, areas and boundary loop."""
    V, F, _ = cdcp_igl.datasets.spherical_cap(10)
    called = []

    def spied(name, function):
        return lambda *arguments: called.append(name) or function(*arguments)

    names = ("squared_edge_lengths", "doublearea", "edges_to_path")
    for name in names:
        monkeypatch.setattr(igl, name, spied(name, getattr(igl, name)))
    cdcp_igl.disk_map(V, F)
    assert set(called) == set(names)


def test_the_reported_angles_are_libigls():
    V, F, _ = cdcp_igl.datasets.spherical_cap(10)
    result = cdcp_igl.disk_map(V, F)
    degrees = np.degrees(abs(igl.internal_angles(result.uv, F) - igl.internal_angles(V, F)))
    np.testing.assert_array_equal(angle_distortion(V, F, result.uv), degrees)
    assert result.distortion.mean == pytest.approx(degrees.mean(), rel=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_a_path_follows_its_edges_wherever_they_are_listed(seed):
    rng = np.random.default_rng(seed)
    loop = rng.permutation(100)[:12]
    edges = np.column_stack([loop, np.roll(loop, -1)])[rng.permutation(12)]
    path = libigl.path(edges)
    np.testing.assert_array_equal(np.roll(path, -path.argmin()), np.roll(loop, -loop.argmin()))


def test_a_vertex_without_area_has_no_normal():
    V = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 5, 5]])
    normals = libigl.vertex_normals(V, np.array([[0, 1, 2]]))
    np.testing.assert_array_equal(normals[:3], [[0, 0, 1]] * 3)
    assert np.isnan(normals[3]).all()


# -- slivers, against arithmetic with 50 digits ----------------------------------------


EPS = np.finfo(float).eps
COUNT = 40  # placements of each shape
SHAPES = {  # by their small angle
    "cap": lambda angle: [[0, 0, 0], [1, 0, 0], [0.5, 0.5 * np.tan(angle), 0]],
    "needle": lambda angle: [[0, 0, 0], [1, 0, 0], [np.cos(angle), np.sin(angle), 0]],
}


def placed(shape, angle):
    """One sliver in many places, turned and scaled, its corners in another order."""
    rng = np.random.default_rng(0)
    corners = []
    for _ in range(COUNT):
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        moved = SHAPES[shape](angle) @ turn * rng.uniform(0.3, 0.6) + rng.uniform(-0.4, 0.4, 3)
        corners.append(np.roll(moved, rng.integers(3), axis=0))
    return np.vstack(corners), np.arange(3 * COUNT).reshape(-1, 3)


def exact(triangles):
    """Cotangents (m, 3), areas (m,) and angles (m, 3) of triangles (m, 3, 3) as they are."""
    cotangents, areas, angles = [], [], []
    with mpmath.workdps(50):
        for triangle in triangles.tolist():
            corner = [mpmath.matrix(point) for point in triangle]
            ahead = [corner[k - 2] - corner[k] for k in range(3)]
            back = [corner[k - 1] - corner[k] for k in range(3)]
            a, b = ahead[0], back[0]
            normal = [a[k - 2] * b[k - 1] - a[k - 1] * b[k - 2] for k in range(3)]
            double_area = mpmath.norm(normal)
            products = [mpmath.fdot(x, y) for x, y in zip(ahead, back, strict=True)]
            cotangents.append([product / double_area for product in products])
            areas.append(double_area / 2)
            angles.append([mpmath.atan2(double_area, product) for product in products])
        return tuple(np.array(values, dtype=object) for values in (cotangents, areas, angles))


def error(computed, expected):
    """Absolute errors, rounded once."""
    with mpmath.workdps(50):
        return np.vectorize(lambda a, b: float(abs(mpmath.mpf(a) - b)))(computed, expected)


@pytest.mark.parametrize("exponent", [1, 3, 5, 8])
@pytest.mark.parametrize("shape", SHAPES)
def test_slivers_lose_no_more_digits_than_their_shape_takes(shape, exponent):
    """Rounded differences of coordinates alone move a corner by EPS, an angle by EPS / angle."""
    angle = 10.0**-exponent
    V, F = placed(shape, angle)
    cotangents, areas, angles = exact(V[F])
    lost = EPS / angle
    computed = corner_cotangents(V, F)
    size = abs(cotangents).astype(float)
    largest = size.max(axis=1, keepdims=True)
    large = size > largest / 3
    errors = error(computed, cotangents)
    assert (errors[large] / size[large]).max() < lost
    # Those of a needle's right angles are differences of squares of lengths near 1.
    assert errors[~large].max(initial=0) < 4 * lost
    assert (error(face_areas(V, F), areas) / areas.astype(float)).max() < lost
    collapsed = np.zeros((len(V), 2))  # all of its angles count as 0
    degrees = angle_distortion(V, F, collapsed)
    assert error(np.radians(degrees), angles).max() < 8 * EPS


def test_lengths_alone_lose_the_area_of_a_cap():
    """Why cotangents are not those of `igl.cotmatrix`, which takes areas by Heron's formula."""
    V, F = placed("cap", 1e-6)
    cotangents, _, _ = exact(V[F])
    size = abs(cotangents).astype(float)
    ours = error(corner_cotangents(V, F), cotangents) / size
    herons = error(2 * igl.cotmatrix_entries(V, F), cotangents) / size
    assert ours.max() < 1e-9
    assert herons.max() > 1e-6


def test_faces_without_area_have_no_cotangents_and_are_found():
    V = np.array([[0.0, 0, 0], [1, 1, 1], [3, 3, 3], [0, 0, 0], [0, 1, 0]])
    F = np.array([[0, 1, 2], [0, 3, 1], [0, 1, 4], [0, 3, 0]])
    assert degenerate_faces(corner_cotangents(V, F)).tolist() == [0, 1, 3]


# -- the Laplacian ---------------------------------------------------------------------


SLIVER = 25.0  # cotangent beyond which a face is one


@pytest.fixture(params=[meshes.grid(), meshes.fan(5), meshes.strip(), meshes.TRIANGLE])
def mesh(request):
    return DiskMesh(*request.param)


def test_is_the_negative_of_libigls(mesh):
    difference = cotangent_laplacian(mesh).matrix() + igl.cotmatrix(mesh.scaled, mesh.F)
    assert abs(difference).max() < 1e-13


@pytest.mark.parametrize("name", ["chinese_lion_17334", "cthead_115491", "femur_2411"])
def test_is_the_negative_of_libigls_on_real_meshes(name, real_mesh):
    """But for slivers, whose areas libigl takes from lengths alone; see test_laplacian.py."""
    mesh = DiskMesh(*real_mesh(name))
    theirs = igl.cotmatrix(mesh.scaled, mesh.F)
    difference = abs(cotangent_laplacian(mesh).matrix() + theirs).tocoo()
    slivers = abs(mesh.cotangents).max(axis=1) > SLIVER
    assert slivers.mean() < 0.02
    at_sliver = np.zeros(len(mesh.scaled), dtype=bool)
    at_sliver[mesh.F[slivers]] = True
    seen = ~(at_sliver[difference.row] & at_sliver[difference.col])
    assert difference.data[seen].max() < 1e-13 * abs(theirs).max()


def test_symmetric_to_the_last_bit_with_zero_row_sums(mesh):
    L = cotangent_laplacian(mesh).matrix()
    assert (L != L.T).nnz == 0
    assert abs(L.sum(axis=1)).max() < 1e-13


def test_a_block_is_the_lower_triangle_of_some_rows_and_columns(mesh):
    L = cotangent_laplacian(mesh)
    chosen = np.random.default_rng(0).permutation(len(mesh.scaled))[:-1]
    expected = np.tril(L.matrix().toarray()[np.ix_(chosen, chosen)])
    np.testing.assert_array_equal(L.block(chosen).toarray(), expected)


def test_cotangents_that_cancel_stay_in_the_pattern():
    _, F = meshes.grid(9, 11)
    right_angles = np.column_stack(np.divmod(np.arange(99), 11))[:, ::-1]
    mesh = DiskMesh(right_angles, F)
    L = cotangent_laplacian(mesh).matrix()
    assert (L.data == 0).any()
    assert L.nnz == len(mesh.scaled) + mesh.F.size + len(mesh.loop)  # every edge twice


def test_intrinsic_delaunay_laplacian_has_no_negative_weight_inside():
    V, F = meshes.grid()
    mesh = DiskMesh(V * [9, 1, 1], F)
    laplacians = cotangent_laplacian(mesh), intrinsic_delaunay_laplacian(mesh)
    plain, delaunay = (L.matrix() for L in laplacians)
    inside = np.ix_(mesh.interior, mesh.interior)
    off_diagonal = ~np.eye(len(mesh.interior), dtype=bool)
    assert plain.toarray()[inside][off_diagonal].max() > 0.1
    assert delaunay.toarray()[inside][off_diagonal].max() < 1e-12
    x = mesh.scaled[:, 0]
    assert x @ delaunay @ x <= x @ plain @ x  # Rippa: Delaunay has the least energy


def edge_set(F):
    return {tuple(edge) for edge in np.sort(F[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)).tolist()}


def sums_inside(F, cotangents):
    """Cotangents opposite the two sides of each edge, added up, where no edge is there twice."""
    sums, count = defaultdict(float), Counter()
    for k in range(3):
        ends = np.sort(F[:, [(k + 1) % 3, (k + 2) % 3]]).tolist()
        for edge, cotangent in zip(map(tuple, ends), cotangents[:, k], strict=True):
            sums[edge] += cotangent
            count[edge] += 1
    return np.array([sums[edge] for edge in sums if count[edge] == 2])


@pytest.mark.parametrize("squeezed", [1, 0.1, 1e-3, 1e-4])
def test_in_the_plane_it_is_the_triangulation_of_delaunay(squeezed):
    V, F, _ = cdcp_igl.datasets.square(12)
    mesh = DiskMesh(V, F)
    V[mesh.interior, :2] += np.random.default_rng(1).uniform(-0.02, 0.02, (len(mesh.interior), 2))
    V[:, 1] *= squeezed
    by_columns = np.asfortranarray(F)
    faces, cotangents = intrinsic_delaunay(Mesh(V, by_columns, mesh.loop))
    np.testing.assert_array_equal(by_columns, F)
    expected = Delaunay(V[:, :2]).simplices
    assert edge_set(faces) == edge_set(expected)
    np.testing.assert_allclose(cotangents, corner_cotangents(V, faces), rtol=1e-9, atol=1e-9)
    assert sums_inside(faces, cotangents).min() > -1e-9


def test_the_intrinsic_triangulation_is_that_of_libigl():
    V, F = meshes.grid(40, 30)
    mesh = DiskMesh(V * [3, 1, 1], F)
    lengths = np.sqrt(igl.squared_edge_lengths(mesh.scaled, mesh.F))
    expected_lengths, expected, *_ = igl.intrinsic_delaunay_triangulation(lengths, mesh.F)
    faces, cotangents = intrinsic_delaunay(mesh)
    assert not np.array_equal(faces, mesh.F)
    order, expected_order = (np.lexsort(np.sort(G).T) for G in (faces, expected))
    np.testing.assert_array_equal(np.sort(faces)[order], np.sort(expected)[expected_order])
    expected_cotangents = 2 * igl.cotmatrix_entries(expected_lengths)
    for C, G in ((cotangents, faces), (expected_cotangents, expected)):
        C[:] = np.take_along_axis(C, np.argsort(G), axis=1)
    np.testing.assert_allclose(
        cotangents[order], expected_cotangents[expected_order], rtol=1e-9, atol=1e-9
    )


def test_a_fan_takes_as_many_rounds_as_it_has_faces():
    angle = np.linspace(0, 2 * np.pi, 1500, endpoint=False)
    V = np.column_stack([3 * np.cos(angle), np.sin(angle)])
    rim = np.arange(1, 1499)
    mesh = DiskMesh(V, np.column_stack([0 * rim, rim, rim + 1]))
    assert sums_inside(*intrinsic_delaunay(mesh)).min() > -1e-9


@pytest.mark.parametrize("thin", [1e-6, 1e-8, 1e-9])
def test_needles_are_flipped_and_not_for_ever(thin):
    """Among faces whose lengths do not know their angles libigl flips until the memory is full."""
    V, F = meshes.grid(30, 20)
    mesh = DiskMesh(V * [1, thin, thin], F)
    faces, cotangents = intrinsic_delaunay(mesh)
    assert np.isfinite(cotangents).all()
    sums = sums_inside(faces, cotangents)
    assert sums.min() >= -1e-9 * sums.max()
    assert (sums_inside(mesh.F, mesh.cotangents) < 0).sum() > 50


# -- its factor and the order of elimination -------------------------------------------


RNG = np.random.default_rng(0)


@pytest.mark.parametrize("make", [meshes.grid, meshes.fan], ids=["grid", "fan"])
def test_it_solves_with_the_interior_block(make):
    surface = FactoredSurface.of(DiskMesh(*make()))
    mesh, L = surface.mesh, surface.laplacian.matrix()
    b = RNG.normal(size=(len(mesh.scaled), 2)) @ [1, 1j]
    x = surface.solve(b)
    assert (x[mesh.loop] == 0).all()
    np.testing.assert_allclose((L @ x)[mesh.interior], b[mesh.interior], atol=1e-12)
    np.testing.assert_array_equal(np.sort(surface.order), mesh.interior)


def test_values_may_be_given_elsewhere():
    mesh = DiskMesh(*meshes.grid())
    free = np.arange(len(mesh.scaled)) > 3
    surface = FactoredSurface(mesh, cotangent_laplacian(mesh), free)
    x = surface.solve(np.ones(len(mesh.scaled)))
    assert (x[~free] == 0).all()
    np.testing.assert_allclose((surface.laplacian.matrix() @ x)[free], 1, atol=1e-12)


def test_what_is_released_refactors():
    surface = FactoredSurface.of(DiskMesh(*meshes.grid()))
    b = RNG.normal(size=len(surface.mesh.scaled))
    x = surface.solve(b)
    surface.release()
    again = surface.analysis
    again.refactor(2 * surface.laplacian.block(surface.rows))
    np.testing.assert_allclose(2 * again.solve(b[surface.rows]), x[surface.rows], rtol=1e-12)


def test_separators_separate():
    mesh = DiskMesh(*meshes.grid(40, 60))
    low, high, levels = mesh.edges.low, mesh.edges.high, 3
    part = dissected(low, high, mesh.scaled, levels)
    for level in range(levels):
        before, digit = np.divmod(part // 3 ** (levels - 1 - level), 3)
        neighbours = before[low] == before[high]
        across = neighbours & (digit[low] != digit[high])
        assert across.any()
        assert (np.maximum(digit[low], digit[high])[across] == 2).all()
    top = part // 3 ** (levels - 1)
    left, right, separator = np.bincount(top)
    assert separator < 3 * np.sqrt(len(mesh.scaled))
    assert min(left, right) > len(mesh.scaled) / 3


@pytest.mark.skipif(not solver().ORDERS, reason="this solver has its own order")
def test_large_meshes_are_dissected():
    """Parts come before their separator, and solutions differ by rounding only."""
    V, F, _ = square(160)
    assert len(V) > LARGE
    surface = FactoredSurface.of(DiskMesh(V, F))
    mesh = surface.mesh
    assert "nested dissection and AMD ordering" in surface.solver
    np.testing.assert_array_equal(np.sort(surface.order), mesh.interior)
    with using("scipy"):
        plain = FactoredSurface(mesh, surface.laplacian)
    assert "minimum degree ordering" in plain.solver
    b = RNG.normal(size=len(V))
    np.testing.assert_allclose(surface.solve(b), plain.solve(b), rtol=1e-9, atol=1e-9)


def test_the_diagonal_of_four_vertices_on_a_circle_is_not_flipped_for_ever():
    code = "import cdcp_igl, surfaces; print(cdcp_igl.free_map(*surfaces.cup()).valid)"
    how = {"capture_output": True, "text": True, "timeout": 60, "cwd": Path(__file__).parent}
    assert subprocess.run([sys.executable, "-c", code], **how).stdout.strip() == "True"
