"""Beltrami coefficients, generalised Laplacian, linear Beltrami solver, Dirichlet problem."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from cdcp_igl.datasets import square
from cdcp_igl.reference import beltrami_coefficient
from cdcp_igl.reference.beltrami import generalized_laplacian, linear_beltrami_solver
from cdcp_igl.reference.dirichlet import Dirichlet
from cdcp_igl.solve.laplacian import cotangent_laplacian
from cdcp_igl.surface.mesh import DiskMesh

PLANE, F, _ = square(2)
PLANE *= 2  # vertices at integers
X, Y, _ = PLANE.T
N = len(PLANE)
SADDLE = np.column_stack([X, Y, X * Y / 2])
GRID = X + 1j * Y

# Less than a fifth of the spacing: no triangle of the jittered grid collapses.
jitters = hnp.arrays(np.float64, (N, 2), elements=st.floats(-0.2, 0.2))
heights = hnp.arrays(np.float64, N, elements=st.floats(-2, 2))


@settings(deadline=None)
@given(
    jitter=jitters,
    height=heights,
    stretch=st.floats(0.02, 50),
    shear=st.floats(-3, 3),
    mirrored=st.booleans(),
)
def test_on_any_chart_the_coefficient_to_the_surface_gives_its_cotangent_laplacian(
    jitter, height, stretch, shear, mirrored
):
    mesh = DiskMesh(np.column_stack([X, Y, height]), F)
    x, y = X + jitter[:, 0], Y + jitter[:, 1]
    p = stretch * x + shear * y + 1j * y
    if mirrored:
        p = p.conj()
    G = generalized_laplacian(p, mesh.F, beltrami_coefficient(p, mesh.F, mesh.V))
    L = cotangent_laplacian(mesh).matrix()
    assert abs(G - L).max() <= 1e-9 * abs(L).max()


def test_coefficient_of_a_conformal_chart_is_zero():
    assert beltrami_coefficient((2 - 3j) * GRID, F, PLANE) == pytest.approx(0, abs=1e-15)


@pytest.mark.parametrize(
    ("M", "mu"),
    [
        (PLANE * [3, 1, 1], 1 / 2),  # (K - 1) / (K + 1)
        (PLANE * [1, 3, 1], -1 / 2),
        # x + sy + iy has w_z = (2 - is)/2, w_zbar = is/2; here s = 2
        (PLANE + np.outer(Y, [2, 0, 0]), 2j / (2 - 2j)),
    ],
)
def test_coefficient_of_an_affine_map(M, mu):
    assert beltrami_coefficient(GRID, F, M) == pytest.approx(mu, abs=1e-14)


def test_coefficient_is_one_in_modulus_where_the_chart_has_collapsed():
    mu = beltrami_coefficient(X + 0j, F, PLANE)
    assert abs(mu) == pytest.approx(1)


def test_generalized_laplacian_is_a_laplacian():
    rng = np.random.default_rng(0)
    mu = 0.9 * rng.uniform(size=len(F)) * np.exp(2j * np.pi * rng.uniform(size=len(F)))
    G = generalized_laplacian(GRID, F, mu).toarray()
    assert pytest.approx(G.T) == G
    assert G.sum(axis=1) == pytest.approx(0, abs=1e-12)
    assert np.linalg.eigvalsh(G)[0] > -1e-12


def test_generalized_laplacian_has_the_matrix_of_the_beltrami_equation():
    mu = 0.3 - 0.4j
    G = generalized_laplacian(GRID, F, np.full(len(F), mu))
    A = np.array([[abs(1 - mu) ** 2, -2 * mu.imag], [-2 * mu.imag, abs(1 + mu) ** 2]]) / (
        1 - abs(mu) ** 2
    )
    gradient = np.array([2.0, -5.0])
    u = gradient @ [X, Y]
    area = 16
    assert u @ G @ u == pytest.approx(area * gradient @ A @ gradient)


def test_linear_beltrami_solver_finds_the_affine_map():
    mu = 0.3 - 0.4j
    w = GRID + mu * GRID.conj()
    S = DiskMesh(PLANE, F).loop
    found = linear_beltrami_solver(GRID, F, np.full(len(F), mu), S, w[S])
    assert found == pytest.approx(w, abs=1e-13)


def test_dirichlet_solution_satisfies_the_equations():
    L = cotangent_laplacian(DiskMesh(SADDLE, F)).matrix()
    S = np.array([7, 0, 24])
    c = np.array([1j, 2 - 1j, 0.5])
    r = np.exp(1j * np.arange(N))
    u = Dirichlet(L, S).solve(c, r)
    assert (u[S] == c).all()
    off = np.setdiff1d(np.arange(N), S)
    assert (L @ u)[off] == pytest.approx(r[off], abs=1e-13)


def test_dirichlet_with_every_vertex_given():
    L = cotangent_laplacian(DiskMesh(SADDLE, F)).matrix()
    assert (Dirichlet(L, np.arange(N)).solve(GRID) == GRID).all()
