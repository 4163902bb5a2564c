"""The harmonic interior, eq. (10)."""

from __future__ import annotations

import numpy as np

from ..arrays import Complex
from ..solve.factor import Factor
from ..solve.laplacian import Laplacian
from ..surface.mesh import DiskMesh

__all__ = ["harmonic_extension"]


def harmonic_extension(mesh: DiskMesh, L: Laplacian, factor: Factor, f_B: Complex) -> Complex:
    """Extend boundary values harmonically: L_II f_I = -L_IB f_B, eq. (10).

    Parameters
    ----------
    mesh : DiskMesh
    L : Laplacian
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
    between = np.flatnonzero(mesh.on_boundary[L.low] != mesh.on_boundary[L.high])
    low, high, weights = L.low[between], L.high[between], L.weights[between]
    pull = np.zeros_like(f)  # -L_IB f_B, as f is still zero inside
    np.add.at(pull, low, weights * f[high])
    np.add.at(pull, high, weights * f[low])
    f[mesh.interior] = factor.solve_interior(pull[mesh.interior])
    return f
