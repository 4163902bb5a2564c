"""The harmonic interior, eq. (10)."""

from __future__ import annotations

from ..arrays import Complex
from ..solve.factored import FactoredSurface

__all__ = ["harmonic_extension"]


def harmonic_extension(surface: FactoredSurface, f_B: Complex) -> Complex:
    """Extend boundary values harmonically: L_II f_I = -L_IB f_B, eq. (10).

    Parameters
    ----------
    surface : FactoredSurface
    f_B : (nB,) complex128
        Boundary values in the order of ``mesh.loop``.

    Returns
    -------
    (n,) complex128
    """
    f = surface.factor.solve(-(surface.coupling @ f_B))
    f[surface.mesh.loop] = f_B
    return f
