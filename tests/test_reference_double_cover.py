"""The doubly covered surface, and Theorem 1 on it."""

import igl
import numpy as np
import pytest

import cdcp_igl
from cdcp_igl.algorithm import Steps, algorithm_1
from cdcp_igl.reference import double_cover
from cdcp_igl.reference.doubled import double_cover_trace, doubled_faces, doubled_laplacian
from cdcp_igl.solve.factored import FactoredSurface
from cdcp_igl.solve.laplacian import cotangent_laplacian
from cdcp_igl.steps.center import central_face
from cdcp_igl.steps.trace import boundary_trace
from cdcp_igl.surface.mesh import DiskMesh

PYRAMID = (
    [[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [1, 1, 1]],
    [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]],
)


def test_doubled_faces_close_the_surface():
    F2 = doubled_faces(DiskMesh(*PYRAMID))
    assert F2.tolist()[4:] == [[5, 1, 0], [5, 2, 1], [5, 3, 2], [5, 0, 3]]
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
