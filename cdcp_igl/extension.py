"""The harmonic interior, eq. (10)."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix

from .arrays import Complex
from .factor import Factor
from .mesh import DiskMesh

__all__ = ["harmonic_extension"]


def harmonic_extension(mesh: DiskMesh, L: csr_matrix, factor: Factor, f_B: Complex) -> Complex:
    """Extend boundary values harmonically: L_II f_I = -L_IB f_B, eq. (10).

    Parameters
    ----------
    mesh : DiskMesh
    L : (n, n) csr_matrix
        Cotangent Laplacian.
    factor : Factor
        Its factorization.
    f_B : (nB,) complex128
        Boundary values in the order of ``mesh.loop``.

    Returns
    -------
    (n,) complex128
    """
    f = np.zeros(len(mesh.V), dtype=complex)
    f[mesh.loop] = f_B
    f[mesh.interior] = -factor.solve_interior((L @ f)[mesh.interior])
    return f
