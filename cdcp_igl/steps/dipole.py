"""The dipole on the central face, the right-hand side of eq. (18)."""

from __future__ import annotations

import numpy as np

from ..arrays import Complex
from ..surface.mesh import DiskMesh

__all__ = ["face_dipole"]


def face_dipole(mesh: DiskMesh, face: int) -> Complex:
    """Right-hand side of eq. (18): the derivative of a point mass on one face.

    Parameters
    ----------
    mesh : DiskMesh
    face : int
        The face [v_i, v_j, v_k] that is sent to infinity.

    Returns
    -------
    (n,) complex128
        Zero off the face; sums to zero. Scaled by |v_j - v_i|, which the shape of the
        trace does not depend on.
    """
    i, j, k = mesh.F[face]
    e = mesh.V[j] - mesh.V[i]
    length = np.linalg.norm(e)
    alpha = (mesh.V[k] - mesh.V[i]) @ e / length**2
    height = np.linalg.norm(mesh.V[k] - mesh.V[i] - alpha * e)
    r = np.zeros(len(mesh.V), dtype=complex)
    r[i] = -1 + 1j * (1 - alpha) * length / height
    r[j] = 1 + 1j * alpha * length / height
    r[k] = -1j * length / height
    return r
