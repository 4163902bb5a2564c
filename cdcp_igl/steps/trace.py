"""The boundary trace of the harmonic map of the doubly covered surface, Theorem 1."""

from __future__ import annotations

import numpy as np

from ..arrays import Complex, Floats, Ints, Numbers, shifted
from ..solve.factored import FactoredSurface
from ..surface.mesh import Mesh
from ..surface.triangles import corner_angles


def conjugate_trace(surface: FactoredSurface, face: int) -> Complex:
    """Boundary values (nB,) by the conjugate of eq. (18), with no factor but that of L_II.

    The solution h of eq. (18) lets nothing through the boundary. Its harmonic conjugate g is
    constant there, and along the boundary h grows by i times what flows in of g. The dipole of
    the conjugate is the same one, as a turn by 90 degrees is a factor i. So L_II g_I = r_I with
    g_B = 0, and the increments of h are the flux of g, shared by the edges: equal to eq. (18) but
    for terms of second order in the length of edges. Not in the paper. Of a face without an
    interior corner the trace is a single point.
    """
    flux = boundary_flux(surface, face_dipole(surface.mesh, face))
    return trace_of_shares(shared_by_edges(surface.mesh, surface.mesh.loop, flux))


def trace_of_shares(shares: Complex) -> Complex:
    """(nB,) `conjugate_trace` by the flux through the edges."""
    increments = 1j * shares
    trace: Complex = np.cumsum(increments) - increments
    return trace


def boundary_trace(surface: FactoredSurface, face: int) -> Complex:
    """Boundary values of the harmonic map of the doubly covered surface, eq. (18), Theorem 1.

    The double cover would need a system of size 2 nI + nB; by symmetry, the pinned system
    of size n gives the same boundary values up to scale and shift. It is factored here.

    They are (nB,), in the order of ``mesh.loop``, and run **clockwise**: with the pole at infinity,
    the image of the surface is the exterior of this curve. (Inside the surface, h is not conformal
    and of no use.) SolverError if the pinned L is numerically not positive definite.
    """
    mesh = surface.mesh
    free = np.arange(len(mesh.scaled)) != mesh.loop[0]  # h = 0 at the pin, b_1
    pinned = FactoredSurface(mesh, surface.laplacian, free)
    return pinned.solve(face_dipole(mesh, face))[mesh.loop]


def face_dipole(mesh: Mesh, face: int) -> Complex:
    """Right-hand side (n,) of eq. (18): the derivative of a point mass on one face.

    Zero off the face, which is sent to infinity; sums to zero. Scaled by |v_j - v_i|, on which the
    shape of the trace does not depend.
    """
    i, j, k = mesh.F[face]
    e = mesh.scaled[j] - mesh.scaled[i]
    length = np.linalg.norm(e)
    alpha = (mesh.scaled[k] - mesh.scaled[i]) @ e / length**2
    height = np.linalg.norm(mesh.scaled[k] - mesh.scaled[i] - alpha * e)
    r = np.zeros(len(mesh.scaled), dtype=complex)
    r[i] = -1 + 1j * (1 - alpha) * length / height
    r[j] = 1 + 1j * alpha * length / height
    r[k] = -1j * length / height
    return r


def boundary_flux(surface: FactoredSurface, r: Numbers) -> Numbers:
    """Flux through the boundary (nB,) from sources r (n,), L_BI g_I - r_B with L_II g_I = r_I.

    It is the normal derivative of the solution g of the Dirichlet problem, integrated with the
    hat functions of the boundary vertices: of second order, while gradients are of first. Negative
    where positive sources flow out; its sum is minus that of r.
    """
    return (surface.coupling.times(surface.solve(r)) - r)[surface.mesh.loop]


def shared_by_edges(mesh: Mesh, loop: Ints, flux: Numbers) -> Numbers:
    """Flux through each edge (k,) of a boundary loop (k,), by that of the vertices.

    What leaves at a vertex belongs to both its edges. Next to a corner of angle a, where the
    conformal map is like z^(pi/a), they get their parts in proportion to their lengths to the
    power pi/a: to the lengths themselves where the boundary is straight.
    """
    corners = np.flatnonzero(mesh.on_boundary.take(mesh.F.T))
    angles = corner_angles(mesh.cotangents.T.flat[corners])
    around = np.bincount(mesh.F.T.flat[corners], angles)
    return shares_of_edges(flux, edge_lengths(mesh, loop), np.asarray(around[loop], np.float64))


def shares_of_edges(flux: Numbers, length: Floats, around: Floats) -> Numbers:
    """Do what `shared_by_edges` does, by lengths of edges and the angles around vertices (nB,)."""
    exponent = np.pi / around
    # The part of the edge that follows, at most 1 / (1 + 0): a power of a ratio may overflow.
    with np.errstate(over="ignore"):
        next_edge = 1 / (1 + (shifted(length, -1) / length) ** exponent)
    shares: Numbers = flux * next_edge + shifted(flux * (1 - next_edge))
    return shares


def edge_lengths(mesh: Mesh, loop: Ints | None = None) -> Floats:
    """(k,) lengths of the edges of a boundary loop (k,), if not of all, to the next vertex."""
    return lengths_along(mesh.scaled[mesh.loop if loop is None else loop])


def lengths_along(points: Floats) -> Floats:
    """(k,) distances from each of some points (k, 3) to the next, in a ring."""
    lengths: Floats = np.linalg.norm(shifted(points) - points, axis=1)
    return lengths
