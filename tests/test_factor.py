import meshes
import numpy as np
import pytest

from cdcp_igl.solve.factor import Factor
from cdcp_igl.solve.factored import FactoredSurface
from cdcp_igl.solve.laplacian import cotangent_laplacian
from cdcp_igl.surface.mesh import DiskMesh

RNG = np.random.default_rng(0)


@pytest.mark.parametrize("make", [meshes.grid, meshes.fan], ids=["grid", "fan"])
def test_it_solves_with_the_interior_block(make):
    mesh = DiskMesh(*make())
    L = cotangent_laplacian(mesh)
    b = RNG.normal(size=(len(mesh.V), 2)) @ [1, 1j]
    x = Factor(mesh, L).solve(b)
    assert (x[mesh.loop] == 0).all()
    np.testing.assert_allclose((L.matrix() @ x)[mesh.interior], b[mesh.interior], atol=1e-12)


def test_no_interior():
    mesh = DiskMesh(*meshes.strip())
    factor = Factor(mesh, cotangent_laplacian(mesh))
    assert (factor.solve(np.ones(len(mesh.V))) == 0).all()


def test_the_order_is_of_the_interior_vertices():
    mesh = DiskMesh(*meshes.grid())
    order = Factor(mesh, cotangent_laplacian(mesh)).order
    np.testing.assert_array_equal(np.sort(order), mesh.interior)


def test_coupling_is_the_block_between_interior_and_boundary():
    surface = FactoredSurface.of(DiskMesh(*meshes.grid()))
    mesh, L = surface.mesh, surface.laplacian.matrix().toarray()
    coupling = surface.coupling.toarray()
    np.testing.assert_array_equal(coupling[mesh.interior], L[np.ix_(mesh.interior, mesh.loop)])
    assert (coupling[mesh.loop] == 0).all()
