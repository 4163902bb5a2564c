import meshes
import numpy as np
import pytest

from cdcp_igl.solve import factor as factor_module
from cdcp_igl.solve.factor import Factor
from cdcp_igl.solve.laplacian import cotangent_laplacian
from cdcp_igl.solve.solvers import solver
from cdcp_igl.surface.mesh import DiskMesh

RNG = np.random.default_rng(0)


@pytest.fixture(params=["one factorization", "two factorizations"])
def count(request, monkeypatch):
    if request.param == "one factorization" and not solver().TRIANGULAR:
        pytest.skip("this solver always makes two")
    if request.param == "two factorizations":
        monkeypatch.setattr(factor_module, "LONG_BOUNDARY", 0)
        monkeypatch.setattr(factor_module, "SHORT_BOUNDARY", 0)
    return request.param


@pytest.mark.parametrize("make", [meshes.grid, meshes.fan], ids=["grid", "fan"])
def test_both_solves(make, count):
    mesh = DiskMesh(*make())
    L = cotangent_laplacian(mesh)
    factor = Factor(mesh, L)
    assert count in factor.solver

    r = RNG.normal(size=(len(mesh.V), 2)) @ [1, 1j]
    r -= r.mean()
    h = factor.solve_pinned(r)
    assert h[mesh.loop[0]] == 0
    np.testing.assert_allclose(L.matrix() @ h, r, atol=1e-12)

    I = mesh.interior  # noqa: E741
    b = RNG.normal(size=(len(I), 2)) @ [1, 1j]
    x = factor.solve_interior(b)
    np.testing.assert_allclose(L.matrix()[I][:, I] @ x, b, atol=1e-12)


def test_no_interior():
    mesh = DiskMesh(*meshes.strip())
    factor = Factor(mesh, cotangent_laplacian(mesh))
    assert factor.solve_interior(np.empty(0, complex)).shape == (0,)


def test_shared_factor_is_as_accurate_as_a_separate_one(real_mesh, monkeypatch):
    mesh = DiskMesh(*real_mesh("human_face_17157"))
    L = cotangent_laplacian(mesh)
    b = np.ones(len(mesh.interior), complex)
    shared = Factor(mesh, L).solve_interior(b)
    monkeypatch.setattr(factor_module, "LONG_BOUNDARY", 0)
    monkeypatch.setattr(factor_module, "SHORT_BOUNDARY", 0)
    separate = Factor(mesh, L).solve_interior(b)
    assert abs(shared - separate).max() < 1e-11 * abs(separate).max()
