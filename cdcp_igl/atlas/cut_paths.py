"""Cuts along straight paths: a slit, branches, and all arcs of a cut laid anew."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra

from ..arrays import Bools, Floats, Ints, marked
from ..errors import Defect, MeshError
from .cut_graph import Component, OpenedComponent, cut_to_disk

# What an edge of mean length on the cut costs, in radians of bend.
STRETCH = 0.5
# Rings of vertices around a shortest path within which a straight one is looked for.
CORRIDOR = 5
# Straight paths avoid vertices with more edges than this, as all pairs of edges are compared.
MOST_SPOKES = 200
# All arcs are laid anew so many times at most.
ROUNDS = 3


def open_to_disk(component: Component) -> OpenedComponent:
    """Cut a component until it is a disk, unless it is one.

    MeshError if only cuts along forbidden edges would do.
    """
    characteristic = component.topology.euler_characteristic
    if characteristic == 1:
        return component.uncut
    opened = _slit(component.uncut) if characteristic == 2 else cut_to_disk(component)
    if opened is component.uncut or component.forbidden.T.ravel()[opened.cut_edges].any():
        raise MeshError(Defect.of("no way for a cut"))
    return opened if characteristic == 2 else straighten(opened)


def _slit(sphere: OpenedComponent) -> OpenedComponent:
    """Cut a sphere along a straight path between two far vertices, if there is a path."""
    component, graph = sphere.component, sphere.graph(sphere.component.length)
    _, place = connected_components(graph, directed=False)  # forbidden edges may part them
    one = int((place == np.bincount(place).argmax()).argmax())
    for _ in range(2):
        distance = dijkstra(graph, indices=one)
        one, other = int(np.where(np.isfinite(distance), distance, -1).argmax()), one
    path = straight_path(sphere, marked(sphere.n, other), marked(sphere.n, one))
    if len(path) == 0:
        return sphere
    if len(path) == 1:  # which does not open the sphere: go on along the shortest edge
        half, at_end = sphere.cuttable, marked(sphere.n, component.tail[path], component.head[path])
        on = half[at_end[component.tail[half]] & ~at_end[component.head[half]]]
        if len(on) == 0:
            return sphere
        path = np.append(path, on[component.length[on].argmin()])
    return sphere.cut(path)


def branch_to(opened: OpenedComponent, vertex: int) -> OpenedComponent:
    """Cut on from the boundary to a vertex of the component, unless it is there already."""
    if opened.on_boundary[vertex]:
        return opened
    path = straight_path(opened, marked(opened.n, vertex), opened.on_boundary)
    return opened.cut(path) if len(path) else opened


def straighten(opened: OpenedComponent) -> OpenedComponent:
    """Lay each arc of the cut anew, as long as the cut becomes shorter or straighter.

    Without one of its arcs the disk is an annulus, and any path between the two loops of
    it makes a disk again: the ends of an arc slide along the others.
    """
    component = opened.component
    for _ in range(ROUNDS):
        before = opened
        for middle in [int(arc[len(arc) // 2]) for arc in opened.arcs]:
            # The arcs laid anew before may have changed this one.
            if not opened.is_cut[middle]:
                continue
            arc = opened.arc_through(middle)
            # Whichever way one goes along an arc, its name is the same.
            name = tuple(sorted(np.minimum(arc, component.twin[arc]).tolist()))
            if name in component.best_arcs:
                continue
            path = _path_in_place_of(arc, opened)
            if len(path):
                opened = opened.joined(arc).cut(path)
            else:
                component.best_arcs.add(name)
        if opened is before:
            break
    return opened


def _path_in_place_of(arc: Ints, opened: OpenedComponent) -> Ints:
    """Half-edges of a better path in place of an arc of the cut, or none.

    Its ends slide no farther than the arc is long: what takes time are the faces near it, as a cut
    may have hundreds of arcs.
    """
    component, joined = opened.component, opened.joined(arc)
    twin, longest = component.twin, component.length[arc].sum() * (1 + 1e-9)
    on_arc = np.append(component.tail[arc], component.tail[twin[arc[-1]]])
    reach = max(longest, CORRIDOR)
    distance = dijkstra(component.graph, indices=on_arc, min_only=True, limit=reach)
    near, half = joined.part(np.flatnonzero(np.isfinite(distance)[component.F].any(axis=1)))
    loop = joined.loop[half]

    def vertices(of: Bools) -> Bools:
        return marked(near.n, near.tail[of], near.head[of])

    rim = vertices(near.is_cut & (loop < 0))
    ends = near.tail[[np.flatnonzero(half == end)[0] for end in (arc[0], twin[arc[-1]])]]
    loose = [marked(near.n, int(end)) for end in ends if not near.on_boundary[end]]
    if loose:
        start, end = loose[0], loose[1] if len(loose) == 2 else vertices(loop >= 0) & ~rim
    elif joined.loop.max() == 1:
        start, end = (vertices(loop == k) & ~rim for k in (0, 1))
    else:
        return arc[:0]
    path = straight_path(near, start, end, longest)
    # One edge with two loose ends does not open a sphere.
    is_path = len(path) > 0 and len(path) >= len(loose)
    if not is_path or _cost(near.cut(path)) >= _cost(near.cut(np.flatnonzero(np.isin(half, arc)))):
        return arc[:0]
    return half[path]


def _cost(opened: OpenedComponent) -> float:
    return opened.bend + STRETCH * float(opened.component.length[opened.cut_edges].sum())


# -- paths -----------------------------------------------------------------------------


def straight_path(
    opened: OpenedComponent, start: Bools, end: Bools, longest: float = np.inf
) -> Ints:
    """Find a short and straight path from one set of vertices to another.

    Half-edges from start to end, none if no path is as short as `longest`. Only at its ends a path
    touches the boundary, and it goes around polygons.

    Its cost is what it adds to `OpenedComponent.bend` when the surface is cut along it, and
    `STRETCH` by its length. The bend of an inner vertex of the path, with the angles on either
    side, is abs(left - pi) + abs(right - pi) - abs(2 pi - left - right). It is never negative, and
    0 where the path is straight.
    """
    blocked = opened.on_boundary & ~start & ~end
    shortest = _shortest(opened, start, end, blocked, longest)
    if len(shortest) == 0:
        return shortest
    inside = marked(opened.n, opened.tail[shortest], opened.head[shortest])
    for _ in range(CORRIDOR):
        reached = opened.inner[inside[opened.tail[opened.inner]]]
        inside[opened.head[reached]] = True
    path = _straightest(opened, start, end, inside & ~blocked)
    visited = opened.tail[path]
    if len(path) == 0 or len(np.unique(visited)) < len(visited):
        return shortest
    return path


def _shortest(
    opened: OpenedComponent, start: Bools, end: Bools, blocked: Bools, longest: float
) -> Ints:
    """Half-edges of a shortest path between two sets of vertices; none if there is no path."""
    half = opened.cuttable
    tail, head = opened.tail[half], opened.head[half]
    # No path enters a start, leaves an end or goes along the boundary.
    use = ~(blocked[tail] | blocked[head] | end[tail] | start[head])
    half, tail, head = half[use], tail[use], head[use]
    graph = csr_matrix((opened.component.length[half], (tail, head)), (opened.n, opened.n))
    sources, targets = np.flatnonzero(start), np.flatnonzero(end)
    distance, parent, _ = dijkstra(
        graph, indices=sources, return_predecessors=True, min_only=True, limit=longest
    )
    in_tree = parent[head] == tail
    into = np.empty(opened.n, np.int64)
    into[head[in_tree]] = half[in_tree]
    return into[way_to(targets[distance[targets].argmin()], parent)[1:]]


def _straightest(opened: OpenedComponent, start: Bools, end: Bools, inside: Bools) -> Ints:
    """Half-edges of the path of least cost among the vertices inside the corridor."""
    component = opened.component
    half = opened.cuttable
    tail, head = opened.tail[half], opened.head[half]
    half = half[inside[tail] & inside[head] & ~end[tail] & ~start[head]]
    # A node for each of these half-edges, one before the first, one after the last.
    tail, head, twin, k = opened.tail[half], opened.head[half], component.twin[half], len(half)
    before, beyond = k, k + 1
    left = _angles_to_the_left(opened, inside)
    stretch = STRETCH * component.length[half]

    first, last = np.flatnonzero(start[tail]), np.flatnonzero(end[head])
    into_first = _bend_of_an_end(opened, half[first], left) + stretch[first]
    out_of_last = _bend_of_an_end(opened, twin[last], left)

    few = np.bincount(opened.tail, minlength=opened.n) <= MOST_SPOKES
    passed = few & ~opened.on_boundary & ~start & ~end
    arrive = csr_matrix((np.ones(k), (np.arange(k), head)), (k, opened.n))[:, passed]
    leave = csr_matrix((np.ones(k), (tail, np.arange(k))), (opened.n, k))[passed]
    come, on = (arrive @ leave).nonzero()
    forward = half[on] != twin[come]
    come, on = come[forward], on[forward]
    around = opened.angle_sum[tail[on]]
    one_side = (left[half[on]] - left[twin[come]]) % around
    bend = abs(one_side - np.pi) + abs(around - one_side - np.pi) - abs(around - 2 * np.pi)

    rows = np.concatenate([np.full(len(first), before), last, come])
    columns = np.concatenate([first, np.full(len(last), beyond), on])
    costs = np.concatenate([into_first, out_of_last, np.maximum(bend, 0) + stretch[on]])
    graph = csr_matrix((costs, (rows, columns)), (k + 2, k + 2))
    _, parent = dijkstra(graph, indices=before, return_predecessors=True)
    return half[way_to(beyond, parent)[1:-1]]


def way_to(node: int, parent: Ints) -> Ints:
    """(k,) nodes of a tree from the root to one; only this one if the tree does not reach it."""
    way = [node]
    while parent[way[-1]] >= 0:
        way.append(int(parent[way[-1]]))
    return np.array(way[::-1])


def _bend_of_an_end(opened: OpenedComponent, half: Ints, left: Floats) -> Floats:
    """Bend added at the ends of a path that half-edges leave, and 4, to be positive.

    `left` are the angles from the boundary to each half-edge.
    """
    at = opened.tail[half]
    around, at_boundary = opened.angle_sum[at], opened.on_boundary[at]
    before = abs(around - np.where(at_boundary, np.pi, 2 * np.pi))
    split = abs(left[half] - np.pi) + abs(around - left[half] - np.pi)
    return np.where(at_boundary, split, abs(around - np.pi)) - before + 4


def _angles_to_the_left(opened: OpenedComponent, inside: Bools) -> Floats:
    """(3m,) angle of the faces from the first edge of a vertex to each half-edge out of it.

    Clockwise, from the boundary where there is one; only at the vertices inside, 0 elsewhere.
    """
    component = opened.component
    leaving = np.flatnonzero(inside[opened.tail])
    # On the boundary begin at the face whose edge into the vertex is on the boundary.
    begins = leaving[opened.is_cut[component.before(leaving)]]
    interior = leaving[~opened.on_boundary[opened.tail[leaving]]]
    first = np.full(opened.n, -1)
    first[opened.tail[interior]] = interior
    first[opened.tail[begins]] = begins
    current = began = first[first >= 0]
    turned, left = np.zeros(len(current)), np.zeros(len(opened.tail))
    while len(current):
        turned = turned + component.angle[current]
        left[current] = turned
        following = component.after(component.twin[current])
        on = ~opened.is_cut[current] & (following != began)
        current, began, turned = following[on], began[on], turned[on]
    return left
