import igl
import meshes
import numpy as np
import pytest

from cdcp_igl.solve.laplacian import cotangent_laplacian, intrinsic_delaunay_laplacian
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
    """But for slivers, whose areas libigl takes from lengths alone; see test_triangles.py."""
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
