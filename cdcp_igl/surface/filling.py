"""Fill a hole with triangles that have an area."""

from __future__ import annotations

import numpy as np

from ..arrays import Bools, Floats, Ints, marked
from .triangles import corner_cotangents, degenerate_faces, face_areas

# The search for a triangulation takes the cube of this many steps, about two seconds.
MOST_CORNERS = 300


def fill_hole(V: Floats, loop: Ints) -> Ints | None:
    """Triangulate a hole by a fan around its middle or, if that is flat, without a new vertex.

    The surface is on the left of the `loop` (k,) around the hole. The faces (m, 3) are oriented
    like those of the surface; the vertex n, if they use it, has to be put at the mean of the loop.
    None if each triangulation has faces without area.
    """
    polygon, k = loop[::-1], len(loop)  # the hole lies on the right of its loop
    points = np.vstack([V[polygon], V[polygon].mean(axis=0)])
    fan = np.column_stack([np.arange(k), np.roll(np.arange(k), -1), np.full(k, k)])
    if not _is_flat(points, fan).any():
        return np.append(polygon, len(V))[fan]
    if k <= MOST_CORNERS:
        triangles = least_triangulation(points[:-1])
        if not _is_flat(points, triangles).any():
            return polygon[triangles]
    return None


def least_triangulation(points: Floats) -> Ints:
    """(k - 2, 3) triangles of a closed polygon in space: the fewest flat ones, then the least area.

    G. Barequet, M. Sharir. Filling gaps in the boundary of a polyhedron. Computer Aided
    Geometric Design 12(2), 1995.
    """
    k = len(points)
    flat = k * np.square(np.ptp(points, axis=0)).sum()  # costs more than any areas
    cost = np.zeros((k, k))  # of the part of the polygon from corner i to corner j
    apex = np.zeros((k, k), dtype=np.int64)  # of the triangle on its side from i to j
    for width in range(2, k):
        start = np.arange(k - width)
        middle = start[:, None] + np.arange(1, width)
        i, j = np.broadcast_to(start[:, None], middle.shape), middle * 0 + start[:, None] + width
        triangles = np.stack([i, middle, j], axis=2).reshape(-1, 3)
        own = face_areas(points, triangles) + flat * _is_flat(points, triangles)
        total = cost[i, middle] + cost[middle, j] + own.reshape(middle.shape)
        best = total.argmin(axis=1)
        cost[start, start + width] = total[start, best]
        apex[start, start + width] = middle[start, best]
    chosen, parts = [], [(0, k - 1)]
    while parts:
        first, last = parts.pop()
        if last > first + 1:
            a = int(apex[first, last])
            chosen.append((first, a, last))
            parts += [(first, a), (a, last)]
    return np.array(chosen)


def _is_flat(points: Floats, triangles: Ints) -> Bools:
    return marked(len(triangles), degenerate_faces(corner_cotangents(points, triangles)))
