"""The harmonic interior, eq. (10)."""

from __future__ import annotations

from ..arrays import Complex
from ..solve.factored import FactoredSurface


def harmonic_extension(surface: FactoredSurface, f_B: Complex) -> Complex:
    """Extend boundary values (nB,) harmonically: L_II f_I = -L_IB f_B, eq. (10)."""
    f = surface.solve(-(surface.coupling @ f_B))
    f[surface.mesh.loop] = f_B
    return f


def extended_again(surface: FactoredSurface, f: Complex) -> Complex:
    """Make the interior of a map (n,) harmonic again, by the differences of neighbours.

    Where these are much smaller than f itself, and f is small, they have digits that a solution for
    the boundary values has not. The boundary stays.
    """
    return f - surface.solve(surface.laplacian.times(f))
