"""Fill a hole with triangles that have an area."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..arrays import Bools, Floats, Ints, marked, places
from .topology import Topology
from .triangles import corner_cotangents, degenerate_faces, face_areas

# The search for a triangulation takes the cube of this many steps, about two seconds.
MOST_CORNERS = 300

Cost = Callable[[Floats, Floats, Floats], Floats]  # of triangles with these corners (..., 3)


def fill_hole(V: Floats, topology: Topology, loop: Ints, *, middle: bool = True) -> Ints | None:
    """Triangulate a hole by a fan around its middle or, if that is flat, without a new vertex.

    The surface is on the left of the `loop` (k,) around the hole. The faces (m, 3) are oriented
    like those of the surface; the vertex n, if they use it, is `with_middle` of the loop. Without
    `middle`, none does.
    None if each triangulation has faces without area, or edges that the surface has.
    """
    polygon, k = loop[::-1], len(loop)  # the hole lies on the right of its loop
    points = with_middle(V[polygon], V[polygon])
    fan = np.column_stack([np.arange(k), np.roll(np.arange(k), -1), np.full(k, k)])
    if middle and not _is_flat(points, fan).any():
        return np.append(polygon, len(V))[fan]
    if k <= MOST_CORNERS:
        corners = places(polygon, topology.n)[topology.chords]
        i, j = corners[(corners >= 0).all(axis=1)].T
        barred = np.zeros((k, k), dtype=bool)
        barred[i, j] = barred[j, i] = True
        triangles = least_triangulation(points[:-1], barred=barred)
        is_edge = barred[triangles, np.roll(triangles, -1, axis=1)]
        if not (_is_flat(points, triangles).any() or is_edge.any()):
            return polygon[triangles]
    return None


def with_middle(V: Floats, corners: Floats) -> Floats:
    """(n + 1, 3) vertices, and the middle of some corners."""
    return np.vstack([V, corners.mean(axis=0)])


def least_triangulation(
    points: Floats, cost: Cost | None = None, barred: Bools | None = None
) -> Ints:
    """(..., k - 2, 3) triangles of closed polygons (..., k, 3), those whose costs add up to least.

    By default, the fewest flat ones, then the least area. Diagonals that are `barred` (k, k) are
    taken only if there is no other way.

    G. Barequet, M. Sharir. Filling gaps in the boundary of a polyhedron. Computer Aided
    Geometric Design 12(2), 1995.
    """
    cost, k = cost or _area_or_flat(points), points.shape[-2]
    polygons = points.reshape(-1, k, 3)
    least = np.zeros((len(polygons), k, k))  # of the part of the polygon from corner i to corner j
    apex = np.zeros(least.shape, dtype=np.int64)  # of the triangle on its side from i to j
    for width in range(2, k):
        start = np.arange(k - width)
        middle = start[:, None] + np.arange(1, width)
        i, j = np.broadcast_to(start[:, None], middle.shape), middle * 0 + start[:, None] + width
        total = least[:, i, middle] + least[:, middle, j]
        total += cost(polygons[:, i], polygons[:, middle], polygons[:, j])
        best = total.argmin(axis=2)
        apex[:, start, start + width] = start + 1 + best
        least[:, start, start + width] = np.take_along_axis(total, best[..., None], 2)[..., 0]
        if barred is not None:
            least[:, start, start + width] += np.where(barred[start, start + width], np.inf, 0)
    chosen, n_parts = np.zeros((len(polygons), k - 2, 3), np.int64), np.ones(len(polygons), int)
    chosen[:, 0, 2] = k - 1  # each row is a part of the polygon, until its triangle is known
    polygon = np.arange(len(polygons))
    for t in range(k - 2):
        first, last = chosen[:, t, 0], chosen[:, t, 2]
        chosen[:, t, 1] = middle = apex[polygon, first, last]
        for low, high in ((first, middle), (middle, last)):
            some = np.flatnonzero(high > low + 1)
            chosen[some, n_parts[some], ::2] = np.column_stack([low, high])[some]
            n_parts[some] += 1
    return chosen.reshape(*points.shape[:-2], k - 2, 3)


def _area_or_flat(points: Floats) -> Cost:
    """Cost a triangle its area; a flat one more than all areas together."""
    flat = points.shape[-2] * np.square(np.ptp(points, axis=-2)).sum()

    def cost(*corners: Floats) -> Floats:
        V = np.stack(corners, axis=-2)
        F = np.arange(V.size // 3).reshape(-1, 3)
        costs = face_areas(V.reshape(-1, 3), F) + flat * _is_flat(V.reshape(-1, 3), F)
        return costs.reshape(V.shape[:-2])

    return cost


def _is_flat(points: Floats, triangles: Ints) -> Bools:
    return marked(len(triangles), degenerate_faces(corner_cotangents(points, triangles)))


def split_edges(V: Floats, F: Ints, ends: Ints) -> tuple[Floats, Ints]:
    """Split edges with two faces, given by their ends (k, 2), at their middles.

    New vertices, and the halves of faces that begin at the latter end, come last.
    """
    faces, n = F.tolist(), len(V)
    near = np.flatnonzero(marked(n, ends)[F].sum(axis=1) > 1).tolist()
    face_at = {side: row for row in near for side in _sides(faces[row])}
    for middle, (one, other) in enumerate(ends.tolist(), n):
        for tail, head in ((one, other), (other, one)):
            row = face_at[tail, head]
            [tip] = {*faces[row]} - {tail, head}
            faces.append([middle, head, tip])
            faces[row] = [tail, middle, tip]
            for changed in (row, len(faces) - 1):
                face_at |= dict.fromkeys(_sides(faces[changed]), changed)
    middles = V[ends[:, 0]] + (V[ends[:, 1]] - V[ends[:, 0]]) / 2
    return np.vstack([V, middles]), np.array(faces)


def _sides(face: list[int]) -> list[tuple[int, int]]:
    return [(face[k - 1], face[k]) for k in range(3)]
