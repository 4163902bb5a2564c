"""The factor of L_II and the order of elimination."""

import meshes
import numpy as np
import pytest

from cdcp_igl.datasets import square
from cdcp_igl.solve.factored import FactoredSurface
from cdcp_igl.solve.laplacian import cotangent_laplacian
from cdcp_igl.solve.ordering import LARGE, dissected
from cdcp_igl.solve.solvers import solver, using
from cdcp_igl.surface.mesh import DiskMesh

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


def test_what_is_released_refactors():
    surface = FactoredSurface.of(DiskMesh(*meshes.grid()))
    b = RNG.normal(size=len(surface.mesh.V))
    x = surface.solve(b)
    surface.release()
    again = surface.analysis
    again.refactor(2 * surface.laplacian.block(surface.rows))
    np.testing.assert_allclose(2 * again.solve(b[surface.rows]), x[surface.rows], rtol=1e-12)


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
