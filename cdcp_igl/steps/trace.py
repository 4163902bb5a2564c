"""The boundary trace of the harmonic map of the doubly covered surface, Theorem 1."""

from __future__ import annotations

import numpy as np

from ..arrays import Complex
from ..solve.factored import FactoredSurface
from .dipole import face_dipole
from .flux import boundary_flux, shared_by_edges

__all__ = ["boundary_trace", "conjugate_trace"]


def conjugate_trace(surface: FactoredSurface, face: int) -> Complex:
    """Boundary values by the conjugate of eq. (18), which needs no factor but that of L_II.

    The solution h of eq. (18) lets nothing through the boundary. Its harmonic conjugate g is
    constant there, and along the boundary h grows by i times what flows in of g. The dipole of
    the conjugate is the same one, as a turn by 90 degrees is a factor i. So L_II g_I = r_I with
    g_B = 0, and the steps of h are the flux of g, shared by the edges: equal to eq. (18) but for
    terms of second order in the length of edges. Not in the paper.

    Parameters
    ----------
    surface : FactoredSurface
    face : int
        Central face, with an interior corner; without one, the trace is a single point.

    Returns
    -------
    (nB,) complex128
        As `boundary_trace`, from 0 at the first vertex of ``mesh.loop``.
    """
    steps = 1j * shared_by_edges(
        surface.mesh, boundary_flux(surface, face_dipole(surface.mesh, face))
    )
    trace: Complex = np.cumsum(steps) - steps
    return trace


def boundary_trace(surface: FactoredSurface, face: int) -> Complex:
    """Boundary values of the harmonic map of the doubly covered surface, eq. (18), Theorem 1.

    The double cover would need a system of size 2 nI + nB; by symmetry, the pinned system
    of size n gives the same boundary values up to scale and shift. It is factored here.

    Parameters
    ----------
    surface : FactoredSurface
    face : int
        Central face.

    Returns
    -------
    (nB,) complex128
        In the order of ``mesh.loop``. It runs **clockwise**: with the pole at infinity,
        the image of the surface is the exterior of this curve. (Inside the surface, h is
        not conformal and of no use.)

    Raises
    ------
    SolverError
        If L pinned is numerically not positive definite, or its factor cannot fit into memory.
    """
    mesh = surface.mesh
    free = np.arange(len(mesh.V)) != mesh.loop[0]  # h = 0 at the pin, b_1
    pinned = FactoredSurface(mesh, surface.laplacian, free)
    return pinned.solve(face_dipole(mesh, face))[mesh.loop]
