"""What flows out through the boundary of a surface: of its vertices, and of its edges."""

from __future__ import annotations

import numpy as np

from ..arrays import Floats
from ..solve.cholesky import Numbers
from ..solve.factored import FactoredSurface
from ..surface.mesh import DiskMesh

__all__ = ["boundary_flux", "edge_lengths", "shared_by_edges"]


def boundary_flux(surface: FactoredSurface, r: Numbers) -> Numbers:
    """Flux through the boundary from given sources, L_BI g_I - r_B with L_II g_I = r_I.

    It is the normal derivative of the solution g of the Dirichlet problem, integrated with the
    hat functions of the boundary vertices: of second order, while gradients are of first.

    Parameters
    ----------
    surface : FactoredSurface
    r : (n,) float64 or complex128
        The sources.

    Returns
    -------
    (nB,) of the same type
        By the vertices of ``mesh.loop``, negative where positive sources flow out. Its sum is
        minus that of r.
    """
    g = surface.solve(r)
    return surface.coupling.T @ g - r[surface.mesh.loop]


def shared_by_edges(mesh: DiskMesh, flux: Numbers) -> Numbers:
    """Flux through each boundary edge, by that of the vertices.

    What leaves at a vertex belongs to both its edges. Next to a corner of angle a, where the
    conformal map is like z^(pi/a), they get their parts in proportion to their lengths to the
    power pi/a: to the lengths themselves where the boundary is straight.

    Parameters
    ----------
    mesh : DiskMesh
    flux : (nB,) float64 or complex128
        By the vertices of ``mesh.loop``.

    Returns
    -------
    (nB,) of the same type
        From each vertex of ``mesh.loop`` to the next.
    """
    corners = np.flatnonzero(mesh.on_boundary.take(mesh.F.T))
    around = np.bincount(mesh.F.T.flat[corners], mesh.angles.T.flat[corners])
    exponent = np.pi / around[mesh.loop]
    length = edge_lengths(mesh)
    # The part of the edge that follows, at most 1 / (1 + 0): a power of a ratio may overflow.
    with np.errstate(over="ignore"):
        following = 1 / (1 + (np.roll(length, 1) / length) ** exponent)
    shares: Numbers = flux * following + np.roll(flux * (1 - following), -1)
    return shares


def edge_lengths(mesh: DiskMesh) -> Floats:
    """(nB,) lengths of the boundary edges, from each vertex of ``mesh.loop`` to the next."""
    points = mesh.V[mesh.loop]
    lengths: Floats = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
    return lengths
