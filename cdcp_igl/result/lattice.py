"""The regular mesh of the disk."""

from __future__ import annotations

import numpy as np

from ..arrays import Complex, Floats, Ints, coordinates

# Between the circle and the lattice, in sides. Among 0.4, 0.45, ..., 0.9 this has the largest
# smallest angle, 31 degrees, over sides from 1 to 0.01.
MARGIN = 0.8
CORNER = 0.2  # least height of a corner that gets a point, by the chord that would cut it off


def even_ring(side: float) -> Complex:
    """(k,) points of the unit circle, counterclockwise from 1, about `side` apart."""
    return np.exp(2j * np.pi * np.linspace(0, 1, round(2 * np.pi / side), endpoint=False))


def with_corners(ring: Complex, loop: Complex, V_ring: Floats, V_loop: Floats) -> Complex:
    """Move points of an even ring to the corners of a boundary.

    A vertex is a corner if it lies far from the chord between the two points of the ring next
    to it. The farthest come first, and no two points come nearer than half of their distance.

    `loop` (nB,) are the boundary vertices on the unit circle; `V_ring` and `V_loop` are where the
    points of the ring (k,) and of the loop lie on the surface.
    """
    step = 2 * np.pi / len(ring)
    angle = np.angle(loop) % (2 * np.pi) / step  # in distances of the ring, as all angles here
    before = angle.astype(np.int64) % len(ring)
    start, end = V_ring[before], V_ring[(before + 1) % len(ring)]
    along, away = end - start, V_loop - start
    length = np.maximum((along**2).sum(axis=1), np.finfo(float).tiny)
    share = np.clip((along * away).sum(axis=1) / length, 0, 1)
    height = np.linalg.norm(away - share[:, None] * along, axis=1) / np.sqrt(length)
    corners = np.flatnonzero(height > CORNER)
    shift = np.zeros(len(ring))
    moved = ring.copy()
    for corner in corners[np.argsort(-height[corners], kind="stable")]:
        nearest = round(angle[corner])
        by, here = angle[corner] - nearest, nearest % len(ring)
        behind, ahead = shift[here - 1], shift[(here + 1) % len(ring)]
        if shift[here] == 0 and 1 + by - behind >= 0.5 and 1 + ahead - by >= 0.5:
            shift[here], moved[here] = by, loop[corner]
    return moved


def disk_lattice(side: float, ring: Complex) -> tuple[Complex, Ints]:
    """Mesh the unit disk by a lattice of equilateral triangles and a ring on the circle.

    The points of the ring are about as far apart as the triangles are wide, `side`. Returns the
    vertices, those of the ring first, and their Delaunay triangulation, counterclockwise.
    """
    from scipy.spatial import Delaunay  # slow to import, and only a lattice uses it

    reach = int(2 / side) + 1
    row, column = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    inner = side * (column + row * np.exp(1j * np.pi / 3)).ravel()
    inner = inner[abs(inner) < 1 - MARGIN * side]
    z = np.concatenate([ring, inner])
    F = Delaunay(coordinates(z)).simplices.astype(np.int64)
    a, b, c = z[F.T]
    clockwise = ((b - a).conj() * (c - a)).imag < 0
    F[clockwise] = F[clockwise, ::-1]
    return z, F
