import meshes
import numpy as np
import pytest
from cdcp_igl.steps.dipole import face_dipole

from cdcp_igl.surface.mesh import DiskMesh


@pytest.mark.parametrize("face", [0, 33, 69])
def test_dipole_is_the_gradient_on_its_face(face):
    mesh = DiskMesh(*meshes.grid())
    r = face_dipole(mesh, face)
    assert np.count_nonzero(r) == 3
    assert abs(r.sum()) < 1e-14
    # Applied to a linear function u, it gives |e| (u_x - i u_y) in the frame of the face.
    i, j, k = mesh.F[face]
    e = mesh.V[j] - mesh.V[i]
    length = np.linalg.norm(e)
    height = mesh.V[k] - mesh.V[i] - (mesh.V[k] - mesh.V[i]) @ e / length**2 * e
    x = (mesh.V - mesh.V[i]) @ e / length
    y = (mesh.V - mesh.V[i]) @ height / np.linalg.norm(height)
    assert r @ x == pytest.approx(length)
    assert r @ y == pytest.approx(-1j * length)
