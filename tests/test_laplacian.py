"""The Laplacian, and the factor of its interior block."""

import igl
import meshes
import numpy as np
import pytest

from cdcp_igl.datasets import square
from cdcp_igl.solve.factored import FactoredSurface
from cdcp_igl.solve.laplacian import cotangent_laplacian, intrinsic_delaunay_laplacian
from cdcp_igl.solve.ordering import LARGE, dissected
from cdcp_igl.solve.solvers import solver, using
from cdcp_igl.surface.mesh import DiskMesh

SLIVER = 25.0  # cotangent beyond which a face is one


@pytest.fixture(params=[meshes.grid(), meshes.fan(5), meshes.strip(), meshes.TRIANGLE])
def mesh(request):
    return DiskMesh(*request.param)


def test_is_the_negative_of_libigls(mesh):
    difference = cotangent_laplacian(mesh).matrix() + igl.cotmatrix(mesh.V, mesh.F)
    assert abs(difference).max() < 1e-13


@pytest.mark.parametrize("name", ["chinese_lion_17334", "cthead_115491", "femur_2411"])
def test_is_the_negative_of_libigls_on_real_meshes(name, real_mesh):
    """But for slivers, whose areas libigl takes from lengths alone; see test_libigl.py."""
    mesh = DiskMesh(*real_mesh(name))
    theirs = igl.cotmatrix(mesh.V, mesh.F)
    difference = abs(cotangent_laplacian(mesh).matrix() + theirs).tocoo()
    slivers = abs(mesh.cotangents).max(axis=1) > SLIVER
    assert slivers.mean() < 0.02
    at_sliver = np.zeros(len(mesh.V), dtype=bool)
    at_sliver[mesh.F[slivers]] = True
    seen = ~(at_sliver[difference.row] & at_sliver[difference.col])
    assert difference.data[seen].max() < 1e-13 * abs(theirs).max()


def test_symmetric_to_the_last_bit_with_zero_row_sums(mesh):
    L = cotangent_laplacian(mesh).matrix()
    assert (L != L.T).nnz == 0
    assert abs(L.sum(axis=1)).max() < 1e-13


def test_a_block_is_the_lower_triangle_of_some_rows_and_columns(mesh):
    L = cotangent_laplacian(mesh)
    chosen = np.random.default_rng(0).permutation(len(mesh.V))[:-1]
    expected = np.tril(L.matrix().toarray()[np.ix_(chosen, chosen)])
    np.testing.assert_array_equal(L.block(chosen).toarray(), expected)


def test_cotangents_that_cancel_stay_in_the_pattern():
    _, F = meshes.grid(9, 11)
    right_angles = np.column_stack(np.divmod(np.arange(99), 11))[:, ::-1]
    mesh = DiskMesh(right_angles, F)
    L = cotangent_laplacian(mesh).matrix()
    assert (L.data == 0).any()
    assert L.nnz == len(mesh.V) + mesh.F.size + len(mesh.loop)  # every edge twice


def test_intrinsic_delaunay_laplacian_has_no_negative_weight_inside():
    V, F = meshes.grid()
    mesh = DiskMesh(V * [9, 1, 1], F)
    laplacians = cotangent_laplacian(mesh), intrinsic_delaunay_laplacian(mesh)
    plain, delaunay = (L.matrix() for L in laplacians)
    inside = np.ix_(mesh.interior, mesh.interior)
    off_diagonal = ~np.eye(len(mesh.interior), dtype=bool)
    assert plain.toarray()[inside][off_diagonal].max() > 0.1
    assert delaunay.toarray()[inside][off_diagonal].max() < 1e-12
    x = mesh.V[:, 0]
    assert x @ delaunay @ x <= x @ plain @ x  # Rippa: Delaunay has the least energy


def test_faces_whose_lengths_do_not_know_their_angles_are_kept():
    """Its edges would be flipped to and fro for ever."""
    mesh = DiskMesh([[0, 0], [1, 0], [0.5, 1e-8], [0, 1]], [[0, 1, 2], [0, 2, 3]])
    L = intrinsic_delaunay_laplacian(mesh)
    assert list(zip(L.low, L.high, strict=True)) == [(0, 1), (0, 2), (0, 3), (1, 2), (2, 3)]
    assert (L.weights > 0).all()
    assert (L.weights[[1, 3]] > 1e7).all()


# -- its factor and the order of elimination -------------------------------------------


RNG = np.random.default_rng(0)


@pytest.mark.parametrize("make", [meshes.grid, meshes.fan], ids=["grid", "fan"])
def test_it_solves_with_the_interior_block(make):
    surface = FactoredSurface.of(DiskMesh(*make()))
    mesh, L = surface.mesh, surface.laplacian.matrix()
    b = RNG.normal(size=(len(mesh.V), 2)) @ [1, 1j]
    x = surface.solve(b)
    assert (x[mesh.loop] == 0).all()
    np.testing.assert_allclose((L @ x)[mesh.interior], b[mesh.interior], atol=1e-12)
    np.testing.assert_array_equal(np.sort(surface.order), mesh.interior)


def test_values_may_be_given_elsewhere():
    mesh = DiskMesh(*meshes.grid())
    free = np.arange(len(mesh.V)) > 3
    surface = FactoredSurface(mesh, cotangent_laplacian(mesh), free)
    x = surface.solve(np.ones(len(mesh.V)))
    assert (x[~free] == 0).all()
    np.testing.assert_allclose((surface.laplacian.matrix() @ x)[free], 1, atol=1e-12)


def test_separators_separate():
    mesh = DiskMesh(*meshes.grid(40, 60))
    low, high, levels = mesh.edges.low, mesh.edges.high, 3
    part = dissected(low, high, mesh.V, levels)
    for level in range(levels):
        before, digit = np.divmod(part // 3 ** (levels - 1 - level), 3)
        neighbours = before[low] == before[high]
        across = neighbours & (digit[low] != digit[high])
        assert across.any()
        assert (np.maximum(digit[low], digit[high])[across] == 2).all()
    top = part // 3 ** (levels - 1)
    left, right, separator = np.bincount(top)
    assert separator < 3 * np.sqrt(len(mesh.V))
    assert min(left, right) > len(mesh.V) / 3


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
