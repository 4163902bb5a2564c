"""What the reference methods are made of: Beltrami coefficients, and the double cover."""

import igl
import meshes
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import cdcp_igl
from cdcp_igl.algorithm import Steps, algorithm_1
from cdcp_igl.datasets import square
from cdcp_igl.reference import beltrami_coefficient, double_cover
from cdcp_igl.reference.beltrami import generalized_laplacian, linear_beltrami_solver
from cdcp_igl.reference.doubled import double_cover_trace, doubled_faces, doubled_laplacian
from cdcp_igl.solve.factored import FactoredSurface
from cdcp_igl.solve.laplacian import cotangent_laplacian
from cdcp_igl.steps.center import central_face
from cdcp_igl.steps.trace import boundary_trace
from cdcp_igl.surface.mesh import DiskMesh

PLANE, F, _ = square(2)
PLANE *= 2  # vertices at integers
X, Y, _ = PLANE.T
N = len(PLANE)
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


@pytest.mark.parametrize(
    ("chart", "M", "mu"),
    [
        ((2 - 3j) * GRID, PLANE, 0),  # conformal
        (GRID, PLANE * [3, 1, 1], 1 / 2),  # (K - 1) / (K + 1)
        (GRID, PLANE * [1, 3, 1], -1 / 2),
        # x + sy + iy has w_z = (2 - is)/2, w_zbar = is/2; here s = 2
        (GRID, PLANE + np.outer(Y, [2, 0, 0]), 2j / (2 - 2j)),
        (X + 0j, PLANE, -1),  # collapsed
    ],
)
def test_coefficient_of_an_affine_map(chart, M, mu):
    assert beltrami_coefficient(chart, F, M) == pytest.approx(mu, abs=1e-14)


def test_linear_beltrami_solver_finds_the_affine_map():
    mu = 0.3 - 0.4j
    w = GRID + mu * GRID.conj()
    S = DiskMesh(PLANE, F).loop
    found = linear_beltrami_solver(GRID, F, np.full(len(F), mu), S, w[S])
    assert found == pytest.approx(w, abs=1e-13)


def test_doubled_faces_close_the_surface():
    F2 = doubled_faces(DiskMesh(*meshes.fan(4)))
    assert F2.tolist()[4:] == [[1, 0, 5], [2, 1, 5], [3, 2, 5], [0, 3, 5]]
    assert cdcp_igl.check(np.zeros((6, 3)), F2).defects[0].name == "closed surface"


def test_doubled_laplacian_is_that_of_the_glued_surface(real_mesh):
    mesh = DiskMesh(*real_mesh("nefertiti_299"))
    V2 = np.vstack([mesh.V, mesh.V[mesh.interior]])
    explicit = -igl.cotmatrix(V2, doubled_faces(mesh))
    L2 = doubled_laplacian(mesh, cotangent_laplacian(mesh).matrix())
    assert abs(L2 - explicit).max() <= 1e-14 * abs(explicit).max()


@pytest.mark.parametrize("name", ["nefertiti_299", "human_face_17157", "chinese_lion_17334"])
def test_theorem_1_both_systems_give_the_same_trace_up_to_shift_and_scale(name, real_mesh):
    surface = FactoredSurface.of(DiskMesh(*real_mesh(name)))
    face = central_face(surface).face
    reduced = boundary_trace(surface, face)  # (18)
    explicit = double_cover_trace(surface, face)  # (17)

    reduced, explicit = reduced - reduced.mean(), explicit - explicit.mean()
    scale = np.vdot(explicit, reduced) / np.vdot(explicit, explicit)
    assert abs(scale * explicit - reduced).max() <= 1e-10 * abs(reduced).max()
    assert scale == pytest.approx(2, abs=1e-10)


@pytest.mark.parametrize("name", ["nefertiti_299", "chinese_lion_17334"])
def test_the_map_is_that_of_cdcp(name, real_mesh):
    V, F = real_mesh(name)
    _, f, _ = algorithm_1(FactoredSurface.of(DiskMesh(V, F)), Steps(trace=boundary_trace))
    assert abs(double_cover(V, F) @ [1, 1j] - f).max() < 1e-8
