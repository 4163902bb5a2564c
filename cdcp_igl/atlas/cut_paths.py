"""Straight paths across an opened surface, and cuts made of them."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from ..arrays import Bools, Floats, Ints
from .cut_surface import Opened

__all__ = ["STRETCH", "straight_path"]

# What an edge of mean length on the cut costs, in radians of bend.
STRETCH = 0.5
# Rings of vertices around a shortest path within which a straight one is looked for.
CORRIDOR = 5
# No straight path is looked for through vertices of more edges, all pairs of which are compared.
MOST_SPOKES = 200


def straight_path(opened: Opened, start: Bools, end: Bools, longest: float = np.inf) -> Ints:
    """Find a short and straight path from one set of vertices to another.

    The cost of a path is what it adds to `Opened.bend` when the surface is cut along it,
    and `STRETCH` by its length. The bend of an inner vertex of the path is
    abs(left - pi) + abs(right - pi) - abs(2 pi - left - right), the angles on either side,
    which is never negative, and 0 where the path is straight. It goes around polygons.

    Parameters
    ----------
    opened : Opened
    start, end : (n,) bool
        Vertices of the boundary or of the interior; a path touches the boundary only there.
    longest : float
        A shortest path is not longer than this.

    Returns
    -------
    (k,) int64
        Half-edges from start to end.
    """
    blocked = opened.on_boundary & ~start & ~end
    shortest = _shortest(opened, start, end, blocked, longest)
    if len(shortest) == 0:
        return shortest
    corridor = np.zeros(opened.n, dtype=bool)
    corridor[opened.tail[shortest]] = corridor[opened.head[shortest]] = True
    inside = corridor.copy()
    for _ in range(CORRIDOR):
        reached = opened.inner[inside[opened.tail[opened.inner]]]
        inside[opened.head[reached]] = True
    path = _straightest(opened, start, end, inside & ~blocked)
    visited = opened.tail[path]
    if len(path) == 0 or len(np.unique(visited)) < len(visited):
        return shortest
    return path


def _shortest(opened: Opened, start: Bools, end: Bools, blocked: Bools, longest: float) -> Ints:
    """Half-edges of a shortest path between two sets of vertices; none if there is no path."""
    half = opened.cuttable
    tail, head = opened.tail[half], opened.head[half]
    # Into a start and out of an end no path goes, and along the boundary neither.
    use = ~(blocked[tail] | blocked[head] | end[tail] | start[head])
    half = half[use]
    tail, head = tail[use], head[use]
    graph = csr_matrix((opened.surface.length[half], (tail, head)), (opened.n, opened.n))
    sources = np.flatnonzero(start)
    distance, parent, _ = dijkstra(
        graph, indices=sources, return_predecessors=True, min_only=True, limit=longest
    )
    targets = np.flatnonzero(end)
    v = int(targets[distance[targets].argmin()])
    if not np.isfinite(distance[v]):
        return np.empty(0, np.int64)
    path = []
    while parent[v] >= 0:
        path.append((parent[v], v))
        v = parent[v]
    by_ends = {}
    wanted = set(path)
    near = np.isin(tail, [a for a, _ in path])
    for h, a, b in zip(half[near].tolist(), tail[near].tolist(), head[near].tolist(), strict=True):
        if (a, b) in wanted:
            by_ends[a, b] = h
    return np.array([by_ends[pair] for pair in reversed(path)], dtype=np.int64)


def _straightest(opened: Opened, start: Bools, end: Bools, inside: Bools) -> Ints:
    """Half-edges of the path of least cost among the vertices inside the corridor."""
    surface, at_boundary = opened.surface, opened.on_boundary
    out, vertex, position = _turns(opened, inside)
    head = opened.head[out]
    free = ~opened.border[out] & ~surface.is_diagonal[out]
    taken = out[free & inside[head] & ~end[vertex] & ~start[head]]
    # A node for each half-edge that the path may take, one before the first, one after the last.
    node = np.full(len(opened.tail), -1)
    node[taken] = np.arange(len(taken))
    before, beyond = len(taken), len(taken) + 1
    left = np.zeros(len(opened.tail))
    left[out] = position
    stretch = STRETCH * surface.length

    first, last = taken[start[opened.tail[taken]]], taken[end[opened.head[taken]]]
    into_first = _bend_of_an_end(opened, first, left) + stretch[first]
    out_of_last = _bend_of_an_end(opened, surface.twin[last], left)

    passed = ~at_boundary[vertex] & ~start[vertex] & ~end[vertex]
    back, on, at = _pairs(out[passed], vertex[passed])
    come = node[surface.twin[back]]
    use = (come >= 0) & (node[on] >= 0)
    come, back, on, at = come[use], back[use], on[use], at[use]
    one_side, around = (left[on] - left[back]) % opened.angle_sum[at], opened.angle_sum[at]
    bend = abs(one_side - np.pi) + abs(around - one_side - np.pi) - abs(around - 2 * np.pi)

    rows = np.concatenate([np.full(len(first), before), node[last], come])
    columns = np.concatenate([node[first], np.full(len(last), beyond), node[on]])
    costs = np.concatenate([into_first, out_of_last, np.maximum(bend, 0) + stretch[on]])
    graph = csr_matrix((costs, (rows, columns)), (len(taken) + 2, len(taken) + 2))
    distance, parent = dijkstra(graph, indices=before, return_predecessors=True)
    path, at_node = [], parent[beyond]
    while np.isfinite(distance[beyond]) and at_node != before:
        path.append(taken[at_node])
        at_node = parent[at_node]
    return np.array(path[::-1], dtype=np.int64)


def _bend_of_an_end(opened: Opened, half: Ints, left: Floats) -> Floats:
    """Bend added at the ends of a path that half-edges leave, and 4, to be positive.

    `left` are the angles from the boundary to each half-edge.
    """
    at = opened.tail[half]
    around, at_boundary = opened.angle_sum[at], opened.on_boundary[at]
    before = abs(around - np.where(at_boundary, np.pi, 2 * np.pi))
    split = abs(left[half] - np.pi) + abs(around - left[half] - np.pi)
    return np.where(at_boundary, split, abs(around - np.pi)) - before + 4


def _pairs(out: Ints, vertex: Ints) -> tuple[Ints, Ints, Ints]:
    """All pairs of different half-edges out of the same vertex, and that vertex."""
    order = np.argsort(vertex, kind="stable")
    _, first, count = np.unique(vertex[order], return_index=True, return_counts=True)
    few = count <= MOST_SPOKES
    out = out[order]
    degree = np.repeat(count[few], count[few])
    starts = np.repeat(first[few], count[few])
    within = np.arange(len(degree)) - np.repeat(np.cumsum(count[few]) - count[few], count[few])
    one = np.repeat(starts + within, degree)
    other = np.arange(len(one)) - np.repeat(np.cumsum(degree) - degree, degree)
    other += np.repeat(starts, degree)
    different = one != other
    one, other = one[different], other[different]
    return out[one], out[other], vertex[order][one]


def _turns(opened: Opened, inside: Bools) -> tuple[Ints, Ints, Floats]:
    """Half-edges out of some vertices, clockwise around each, and the angles turned.

    Returns
    -------
    out : (k,) int64
    vertex : (k,) int64
        Which they leave.
    position : (k,) float64
        Angle of the faces from the first edge of the vertex to each half-edge.
    """
    surface = opened.surface
    leaving = np.flatnonzero(inside[opened.tail])
    # On the boundary begin at the face whose edge into the vertex is on the boundary.
    begins = leaving[opened.border[surface.before(leaving)]]
    first = np.full(opened.n, -1)
    interior = leaving[~opened.on_boundary[opened.tail[leaving]]]
    first[opened.tail[interior]] = interior
    first[opened.tail[begins]] = begins
    current = first[first >= 0]
    started = current.copy()
    turned = np.zeros(len(current))
    out, position = [], []
    while len(current):
        turned = turned + surface.angle[current]
        out.append(current)
        position.append(turned)
        on = ~opened.border[current]
        current, started, turned = current[on], started[on], turned[on]
        current = surface.after(surface.twin[current])
        on = current != started
        current, started, turned = current[on], started[on], turned[on]
    halves = np.concatenate(out)
    return halves, opened.tail[halves], np.concatenate(position)
