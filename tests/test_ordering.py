import meshes
import numpy as np
import pytest

from cdcp_igl.solve import ordering
from cdcp_igl.solve.factor import Factor
from cdcp_igl.solve.laplacian import cotangent_laplacian
from cdcp_igl.solve.ordering import dissected, elimination_order
from cdcp_igl.solve.solvers import solver
from cdcp_igl.surface.mesh import DiskMesh

ordered = pytest.mark.skipif(not solver().ORDERS, reason="this solver has its own order")


@pytest.fixture
def mesh():
    return DiskMesh(*meshes.grid(40, 60))


def test_separators_separate(mesh):
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


@ordered
def test_parts_come_before_their_separator(mesh, monkeypatch):
    monkeypatch.setattr(ordering, "LARGE", 0)
    order, _, name = elimination_order(cotangent_laplacian(mesh), mesh.V, ~mesh.on_boundary)
    assert name == "nested dissection and AMD"
    np.testing.assert_array_equal(np.sort(order), mesh.interior)
    part = dissected(mesh.edges.low, mesh.edges.high, mesh.V)
    assert (np.diff(part[order]) >= 0).all()


@ordered
def test_the_order_changes_solutions_by_rounding_only(mesh, monkeypatch):
    L = cotangent_laplacian(mesh)
    b = np.random.default_rng(0).normal(size=len(mesh.V))
    plain = Factor(mesh, L)
    monkeypatch.setattr(ordering, "LARGE", 0)
    cut = Factor(mesh, L)
    assert "AMD ordering" in plain.solver
    assert "nested dissection" not in plain.solver
    assert "nested dissection and AMD ordering" in cut.solver
    np.testing.assert_allclose(cut.solve(b), plain.solve(b), rtol=1e-10)
