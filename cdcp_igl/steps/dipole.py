"""Eq. (18) on a closed surface: a harmonic function with a dipole at a vertex."""

from __future__ import annotations

import numpy as np

from ..arrays import Complex, Floats, Ints
from ..solve.factored import FactoredSurface
from ..surface.mesh import Mesh
from ..surface.triangles import vertex_areas
from .stereographic import from_plane, moved_to_center, spherical_barycenter

WELL_SHAPED = np.radians(20)  # the smallest angle around the vertex of the dipole, if there is one
NEAR = 2.0  # |h| in a cap around the dipole, 20 % of the sphere, which is solved again


def dipole_map(surface: FactoredSurface) -> tuple[Floats, int]:
    """Map a closed surface onto the sphere (n, 3) by a dipole; and the vertex that carried it.

    The first dipole is at the vertex with the best angles around it. The second, which is taken, is
    where the surface is widest: of the vertices with good angles, at the one whose area has grown
    most. On a limb nothing else would have digits.
    """
    mesh = surface.mesh
    mass, angles = mesh.vertex_areas, np.minimum.reduce(mesh.angles.T)
    smallest = np.full(len(mesh.scaled), np.pi)
    for corner in mesh.F.T:
        np.minimum.at(smallest, corner, angles)
    few = np.bincount(mesh.F.ravel()) < 5  # neighbours: the dipole would not be free of moments
    smallest[few] /= np.pi
    P = from_plane(_dipole_solution(surface, int(smallest.argmax())), -1)
    P = moved_to_center(P, spherical_barycenter(P, mass))
    growth = vertex_areas(P, mesh.F) / mass
    growth[smallest < min(WELL_SHAPED, smallest.max())] = 0
    pole = int(growth.argmax())
    h = _dipole_solution(surface, pole)
    # Next to the pole h is large and rough; seen from the other side, 1 / h is small and smooth.
    near = (abs(h) > NEAR) | (np.arange(len(h)) == pole)
    w = np.divide(1, h, out=np.zeros_like(h), where=~near & (h != 0))
    order = np.append(surface.order, 0)
    cap = FactoredSurface(mesh, surface.laplacian, order=order[near[order]])
    w -= cap.solve(surface.laplacian.times(w))
    P = from_plane(h, -1)
    P[near] = from_plane(w[near], 1)
    return P, pole


def _dipole_solution(surface: FactoredSurface, pole: int) -> Complex:
    """Solve eq. (18), (n,); half of the area lies on either side of 0, and in the unit disk."""
    mesh = surface.mesh
    mass = mesh.vertex_areas.copy()
    mass[pole] = 0
    h = surface.solve(vertex_dipole(mesh, pole))
    # So little is left to do for the conformal barycentre.
    h -= median(h.real, mass) + 1j * median(h.imag, mass)
    h /= median(np.abs(h), mass) or 1
    return h


def median(x: Floats, mass: Floats) -> float:
    """Value with half of the mass (n,) on either side."""
    order = np.argsort(x)
    total = np.cumsum(mass[order])
    return float(x[order[np.searchsorted(total, total[-1] / 2)]])


def vertex_dipole(mesh: Mesh, vertex: int) -> Complex:
    """Right-hand side (n,) of eq. (18): the derivative of a point mass at a vertex.

    With coordinates w of its neighbours, in which the angles around the vertex add up to 2 pi, it
    takes 1 and conj(w) to 0, w to 1, and w^2 and conj(w)^2 to 0 as far as there are enough
    neighbours; of all such, the one of least norm. The dipole of one face takes w^2 to what shears
    the whole map by the length of an edge.
    """
    ring, w = star(mesh, vertex)
    w = np.append(0, w)
    moments = np.array([np.ones_like(w), w, w.conj(), w**2, w.conj() ** 2])
    r = np.zeros(len(mesh.scaled), dtype=complex)
    r[np.append(vertex, ring)] = np.linalg.lstsq(moments, np.eye(5)[1], rcond=None)[0]
    return r


def star(mesh: Mesh, vertex: int) -> tuple[Ints, Complex]:
    """Neighbours (k,) of a vertex in order, and coordinates whose angles add up to 2 pi."""
    faces, corner = np.nonzero(np.equal(mesh.F, vertex))
    following = dict(zip(mesh.F[faces, corner - 2].tolist(), range(len(faces)), strict=True))
    ring, angle = [int(mesh.F[faces[0], corner[0] - 2])], [0.0]
    while True:
        row = following[ring[-1]]
        angle.append(angle[-1] + float(mesh.angles[faces[row], corner[row]]))
        if len(angle) > len(faces):
            break
        ring.append(int(mesh.F[faces[row], corner[row] - 1]))
    power = 2 * np.pi / angle[-1]
    length = np.linalg.norm(mesh.scaled[ring] - mesh.scaled[vertex], axis=1)
    direction = np.exp(1j * power * np.array(angle[:-1]))
    return np.array(ring), (length / length.mean()) ** power * direction
