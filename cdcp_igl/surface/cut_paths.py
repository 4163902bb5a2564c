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


def straight_path(opened: Opened, start: Bools, end: Bools, longest: float = np.inf) -> Ints:
    """Find a short and straight path from one set of vertices to another.

    The cost of a path is what it adds to `Opened.bend` when the surface is cut along it,
    and `STRETCH` by its length. The bend of an inner vertex of the path is
    abs(left - pi) + abs(right - pi) - abs(2 pi - left - right), the angles on either side,
    which is never negative, and 0 where the path is straight.

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
    tail, head = opened.tail[opened.inner], opened.head[opened.inner]
    # Into a start and out of an end no path goes, and along the boundary neither.
    use = ~(blocked[tail] | blocked[head] | end[tail] | start[head])
    half = opened.inner[use]
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
    surface = opened.surface
    out, vertex, position = _turns(opened, inside)
    total = opened.angle_sum
    at_boundary = opened.on_boundary
    # A node for each half-edge that a path may take.
    head = opened.head[out]
    usable = inside[head] & ~opened.border[out] & ~end[vertex] & ~start[head]
    node_of = np.full(len(opened.tail), -1)
    taken = out[usable]
    node_of[taken] = np.arange(len(taken))
    position_of = np.zeros(len(opened.tail))
    position_of[out] = position

    rows, columns, costs = [], [], []
    source, target = len(taken), len(taken) + 1
    stretch = STRETCH * surface.length

    def end_cost(half_out: Ints, at: Ints) -> Floats:
        """Bend added where a path leaves a vertex at its end, and pi."""
        left = position_of[half_out]
        before = abs(total[at] - np.where(at_boundary[at], np.pi, 2 * np.pi))
        split = abs(left - np.pi) + abs(total[at] - left - np.pi)
        return np.where(at_boundary[at], split, abs(total[at] - np.pi)) - before + 4

    first = taken[start[opened.tail[taken]]]
    rows.append(np.full(len(first), source))
    columns.append(node_of[first])
    costs.append(end_cost(first, opened.tail[first]) + stretch[first])

    last = taken[end[opened.head[taken]]]
    rows.append(node_of[last])
    columns.append(np.full(len(last), target))
    costs.append(end_cost(surface.twin[last], opened.head[last]))

    # All pairs of half-edges out of a vertex: in along the twin of one, out along the other.
    passed = ~at_boundary[vertex] & ~start[vertex] & ~end[vertex]
    order = np.argsort(vertex[passed], kind="stable")
    spokes, hub = out[passed][order], vertex[passed][order]
    _, first_of, count = np.unique(hub, return_index=True, return_counts=True)
    degree = np.repeat(count, count)
    one = np.repeat(np.arange(len(spokes)), degree)
    other = np.arange(len(one)) - np.repeat(np.cumsum(degree) - degree, degree)
    other += np.repeat(np.repeat(first_of, count), degree)
    back, on = spokes[one], spokes[other]
    use = (back != on) & (node_of[surface.twin[back]] >= 0) & (node_of[on] >= 0)
    back, on, at = back[use], on[use], hub[one][use]
    left = (position_of[on] - position_of[back]) % total[at]
    bend = abs(left - np.pi) + abs(total[at] - left - np.pi) - abs(total[at] - 2 * np.pi)
    rows.append(node_of[surface.twin[back]])
    columns.append(node_of[on])
    costs.append(np.maximum(bend, 0) + stretch[on])

    graph = csr_matrix(
        (np.concatenate(costs), (np.concatenate(rows), np.concatenate(columns))),
        (len(taken) + 2, len(taken) + 2),
    )
    distance, parent = dijkstra(graph, indices=source, return_predecessors=True)
    if not np.isfinite(distance[target]):
        return np.empty(0, np.int64)
    path = []
    v = parent[target]
    while v != source:
        path.append(taken[v])
        v = parent[v]
    return np.array(path[::-1], dtype=np.int64)


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
