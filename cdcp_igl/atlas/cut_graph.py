"""A component of a surface, opened along a cut; and a first cut along shortest paths."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import dijkstra, minimum_spanning_tree

from ..arrays import Bools, Floats, Ints, distinct_rows, marked, places
from ..cached import cached_property
from ..surface.filling import fill_hole, with_middle
from ..surface.topology import Topology, by_reach, components_of_pairs
from ..surface.triangles import corner_angles, corner_cotangents

# A shortest path takes a forbidden edge only where there is no other way: it costs so many times
# its length.
AT_ANY_COST = 1e6


@dataclass(frozen=True, eq=False)
class Component:
    """A connected, oriented manifold, with or without a boundary.

    Half-edge k m + f leaves corner k of face f for the next corner; the face is on its left.
    """

    V: Floats
    F: Ints
    polygon: Ints  # (m,) number of the polygon that each face is a part of
    rows: Ints  # (k,) where the first k faces come from; the others fill holes
    forbidden: Bools  # (m, 3) edges, by the corners that they leave, that must not be cut
    n_filled: int = 0  # holes
    # Names of the arcs of a cut that cannot be laid shorter or straighter.
    best_arcs: set[tuple[int, ...]] = field(init=False, default_factory=set)

    @cached_property
    def topology(self) -> Topology:
        """The same faces, to be asked for edges and boundary loops."""
        return Topology(self.F, len(self.V))

    @cached_property
    def tail(self) -> Ints:
        """(3m,) the vertex that each half-edge leaves."""
        return self.F.T.ravel()

    @cached_property
    def head(self) -> Ints:
        """(3m,) the vertex to which each half-edge goes."""
        return self.tail[self.after(np.arange(self.F.size))]

    @cached_property
    def twin(self) -> Ints:
        """(3m,) the half-edge on the other side of each edge, -1 on the boundary."""
        one, other = self.topology.twins
        twin = np.full(self.F.size, -1)
        twin[one], twin[other] = other, one
        return twin

    @cached_property
    def edges(self) -> Ints:
        """One half-edge of each edge that is not on the boundary."""
        return np.flatnonzero(np.arange(self.F.size) < self.twin)

    @cached_property
    def is_barred(self) -> Bools:
        """(3m,) half-edges that are not to be cut: forbidden, or inside of a polygon.

        Of the latter those that join the faces of a polygon without going around a vertex or a
        hole, so that the polygons are disks with all vertices on their boundaries. Faces in
        successive rows are joined first: a fan of triangles stays one where the polygon touches
        itself.
        """
        one, other = self.sides(self.edges)
        inside = self.polygon[one] == self.polygon[other]
        joined = self.crossed_by_tree(self.edges[inside], -abs(one - other)[inside])
        return self.forbidden.T.ravel() | marked(self.F.size, joined, self.twin[joined])

    @cached_property
    def patch(self) -> Ints:
        """(m,) numbers of the faces: the same in a polygon, and across a forbidden edge."""
        one, other = self.sides(self.edges[self.forbidden.T.ravel()[self.edges]])
        _, number = np.unique(self.polygon, return_inverse=True)
        _, patch = components_of_pairs(number[one], number[other], int(number.max()) + 1)
        return patch[number].astype(np.int64)

    def crossed_by_tree(self, edges: Ints, weight: NDArray[Any]) -> Ints:
        """Those of some edges that a maximum spanning tree of the faces crosses."""
        m = len(self.F)
        low, high = np.sort(self.sides(edges), axis=0)
        order = np.lexsort((high, low, -weight))
        low, high = low[order], high[order]
        # Of several edges between two faces, only the best can be in the tree.
        _, rank = np.unique(low * m + high, return_index=True)
        tree = minimum_spanning_tree(coo_matrix((rank + 1, (low[rank], high[rank])), (m, m)))
        return edges[order[tree.data.astype(np.int64) - 1]]

    @cached_property
    def length(self) -> Floats:
        """(3m,) length of each half-edge, the mean is 1."""
        length = np.linalg.norm(self.V[self.head] - self.V[self.tail], axis=1)
        return length / length.mean()

    @cached_property
    def angle(self) -> Floats:
        """(3m,) angle between each half-edge and the edge before it in its face, in radians."""
        return corner_angles(corner_cotangents(self.V, self.F)).T.ravel()

    @cached_property
    def graph(self) -> csr_matrix:
        """(n, n) symmetric matrix of the lengths of the edges."""
        n = len(self.V)
        graph = csr_matrix((self.length, (self.tail, self.head)), (n, n))
        return graph.maximum(graph.T)  # at the boundary, half-edges go one way

    @cached_property
    def uncut(self) -> OpenedComponent:
        """The component with its own boundary and no cut."""
        return OpenedComponent(self, self.twin < 0)

    def sides(self, edges: Ints) -> tuple[Ints, Ints]:
        """Return the faces on either side of edges that are not on the boundary."""
        return edges % len(self.F), self.twin[edges] % len(self.F)

    def after(self, half: Ints) -> Ints:
        """Return the next half-edges of the same faces."""
        return (half + len(self.F)) % self.F.size

    def before(self, half: Ints) -> Ints:
        """Return the half-edges before these in the same faces."""
        return (half - len(self.F)) % self.F.size


@dataclass(frozen=True, eq=False)
class OpenedComponent:
    """A component opened along a cut: each side of the cut has vertices of its own.

    `is_cut` (3m,) are the half-edges of its boundary: those of the component and either side of
    the edges that are cut.
    """

    component: Component
    is_cut: Bools

    def moved(self, component: Component) -> OpenedComponent:
        """Take a component with the same faces, opened along the same cut."""
        other = OpenedComponent(component, self.is_cut)
        other.__dict__["tail"] = self.tail
        return other

    def cut(self, half: Ints) -> OpenedComponent:
        """Cut the edges of some more half-edges as well."""
        return self._with(half, is_cut=True)

    def joined(self, half: Ints) -> OpenedComponent:
        """Join the edges of some half-edges of the cut again."""
        return self._with(half, is_cut=False)

    def _with(self, half: Ints, is_cut: bool) -> OpenedComponent:
        changed = self.is_cut.copy()
        changed[half] = changed[self.component.twin[half]] = is_cut
        return OpenedComponent(self.component, changed)

    @cached_property
    def tail(self) -> Ints:
        """(3m,) the vertex that each half-edge leaves.

        A vertex of the component keeps its number; the copies on other sides of the cut come last.
        """
        component, n = self.component, len(self.component.V)
        if not self.is_cut[component.edges].any():
            return component.tail
        # Only along the cut the half-edges out of a vertex can fall into several fans.
        touched = marked(n, component.tail[self.is_cut], component.head[self.is_cut])
        spokes = np.flatnonzero(touched[component.tail])
        number = places(spokes, len(component.tail))
        joined = spokes[~self.is_cut[spokes]]
        neighbour = component.after(component.twin[joined])
        _, fan = components_of_pairs(number[joined], number[neighbour], len(spokes))
        _, first = np.unique(fan, return_index=True)
        hub = component.tail[spokes[first]]
        order = np.argsort(hub, kind="stable")
        copies = order[np.diff(hub[order], prepend=-1) == 0]
        hub[copies] = n + np.arange(len(copies))
        tail = component.tail.copy()
        tail[spokes] = hub[fan]
        return tail

    @cached_property
    def n(self) -> int:
        """Number of vertices."""
        return int(self.tail.max()) + 1

    @cached_property
    def head(self) -> Ints:
        """(3m,) the vertex to which each half-edge goes."""
        return self.tail[self.component.after(np.arange(len(self.tail)))]

    @cached_property
    def F(self) -> Ints:
        """(m, 3) the faces by these vertices."""
        return np.ascontiguousarray(self.tail.reshape(3, -1).T)

    @cached_property
    def positions(self) -> Floats:
        """(n, 3) coordinates of the vertices."""
        positions = np.empty((self.n, 3))
        positions[self.tail] = self.component.V[self.component.tail]
        return positions

    @cached_property
    def on_boundary(self) -> Bools:
        """(n,) the vertices of the boundary."""
        return marked(self.n, self.tail[self.is_cut])

    @cached_property
    def boundary(self) -> Ints:
        """(k,) half-edges of the boundary."""
        return np.flatnonzero(self.is_cut)

    @cached_property
    def following(self) -> Ints:
        """(k,) which comes after each half-edge of the boundary."""
        component = self.component
        following = component.after(self.boundary)
        while len(inner := np.flatnonzero(~self.is_cut[following])):
            following[inner] = component.after(component.twin[following[inner]])
        return following

    @cached_property
    def loop(self) -> Ints:
        """(3m,) number of the boundary loop of each half-edge from 0, -1 in the interior."""
        count, loop = len(self.boundary), np.full(len(self.is_cut), -1)
        after = places(self.boundary, len(loop))[self.following]
        loop[self.boundary] = components_of_pairs(np.arange(count), after, count)[1]
        return loop

    @cached_property
    def angle_sum(self) -> Floats:
        """(n,) sums of the angles of the faces at each vertex."""
        return np.bincount(self.tail, self.component.angle, self.n).astype(np.float64)

    @cached_property
    def bend(self) -> float:
        """Sum of the angles that a map onto a half-plane has to change, in radians.

        Interior vertices have 2 pi in the plane, those of a straight boundary pi.
        """
        flat = np.where(self.on_boundary, np.pi, 2 * np.pi)
        return float(abs(self.angle_sum - flat).sum())

    @cached_property
    def inner(self) -> Ints:
        """Half-edges that are not on the boundary."""
        return np.flatnonzero(~self.is_cut)

    @cached_property
    def cuttable(self) -> Ints:
        """Half-edges that can be cut: neither on the boundary nor barred."""
        return np.flatnonzero(~self.is_cut & ~self.component.is_barred)

    @cached_property
    def cut_edges(self) -> Ints:
        """One half-edge of each edge that is cut, without the boundary of the component."""
        return self.component.edges[self.is_cut[self.component.edges]]

    @cached_property
    def is_node(self) -> Bools:
        """(l,) the vertices of the component at which an arc of the cut ends."""
        component, ends = self.component, [self.component.tail, self.component.head]
        n_cut = sum(np.bincount(end[self.cut_edges], minlength=len(component.V)) for end in ends)
        return (n_cut != 2) | component.uncut.on_boundary

    @property
    def arcs(self) -> list[Ints]:
        """The arcs of the cut, none of which is longer than from one node to the next."""
        arcs, seen = list[Ints](), np.zeros(len(self.is_cut), dtype=bool)
        for half in self.cut_edges.tolist():
            if not seen[half]:
                arcs.append(self.arc_through(half))
                seen[arcs[-1]] = seen[self.component.twin[arcs[-1]]] = True
        return arcs

    def arc_through(self, half: int) -> Ints:
        """Half-edges of the arc of the cut on which one lies."""
        twin = self.component.twin
        back = self._way_to_node(int(twin[half]))
        return np.concatenate([twin[back[:0:-1]], self._way_to_node(half)])

    def _way_to_node(self, half: int) -> Ints:
        way, head = [half], self.component.head
        while not self.is_node[head[way[-1]]]:  # a ring without nodes opens no disk
            way.append(self._next[way[-1]])
        return np.array(way)

    @cached_property
    def _next(self) -> dict[int, int]:
        return dict(zip(self.boundary.tolist(), self.following.tolist(), strict=True))

    def part(self, rows: Ints) -> tuple[OpenedComponent, Ints]:
        """Take some of the faces (l,), their rim as a boundary; return their half-edges (3l,), too.

        Lengths, angles and what is barred are as in the whole.
        """
        whole, m = self.component, len(self.component.F)
        half = (rows + m * np.arange(3)[:, None]).ravel()
        vertices, F = np.unique(whole.F[rows], return_inverse=True)
        F = F.reshape(-1, 3)
        part = Component(whole.V[vertices], F, whole.polygon[rows], rows, whole.forbidden[rows])
        for name in "length", "angle", "is_barred":
            part.__dict__[name] = getattr(whole, name)[half]
        twin = whole.twin[half]
        part.__dict__["twin"] = np.where(twin < 0, -1, places(half, whole.F.size)[twin])
        return OpenedComponent(part, self.is_cut[half] | (part.twin < 0)), half

    def graph(self, weight: Floats) -> csr_matrix:
        """(n, n) symmetric matrix of the weights (3m,) of the half-edges that can be cut."""
        half = self.cuttable
        return csr_matrix((weight[half], (self.tail[half], self.head[half])), (self.n, self.n))


def split_components(
    V: Floats, F: Ints, sheets: Ints, polygon: Ints, forbidden: Bools
) -> Iterator[Component]:
    """Take an oriented manifold apart; `sheets` (m, 3) numbers its vertices, F those of V.

    For `polygon` (m,) and `forbidden` (m, 3) see `Component`.
    """
    count, component = Topology(sheets, int(sheets.max()) + 1).components
    order = np.argsort(component, kind="stable")
    for rows in np.split(order, np.cumsum(np.bincount(component, minlength=count))[:-1]):
        _, first, corner = np.unique(sheets[rows], return_index=True, return_inverse=True)
        vertex = F[rows].ravel()[first]
        order = np.argsort(vertex, kind="stable")  # as in V
        number = places(order, len(order))
        corners = number[corner].reshape(-1, 3)
        yield Component(V[vertex[order]], corners, polygon[rows], rows, forbidden[rows])


def cut_to_disk(component: Component) -> OpenedComponent:
    """Cut a component that is not closed of genus 0 along shortest paths, until it is a disk.

    A shortest-path tree along the edges of polygons, each boundary loop one node of it, from
    a vertex, or from the longest loop if there is one, and a spanning tree of the faces across
    the edges that are not in it, by preference those that close the longest loops. The edges
    in neither close the shortest loops that cut all handles (greedy homotopy generators, see
    `cut`); the paths of the tree from these and from each boundary loop to the root are the cut.
    It crosses a forbidden edge only where there is no other way.
    """
    V, twin = component.V, component.twin
    n, loops = len(V), component.topology.loops
    node = np.arange(n)
    for loop in loops:
        node[loop] = loop[0]
    root = max(loops, key=lambda loop: _length(V[loop]))[0] if loops else 0
    tail, head = node[component.tail], node[component.head]

    forbidden = component.forbidden.T.ravel()
    length = np.where(forbidden, AT_ANY_COST, 1) * component.length
    along = np.flatnonzero((twin >= 0) & (forbidden | ~component.is_barred) & (tail != head))
    # Of several edges between two nodes, only the shortest can be in the tree.
    along = along[np.lexsort((length[along], head[along], tail[along]))]
    along = along[np.diff(tail[along] * n + head[along], prepend=-1) != 0]
    graph = csr_matrix((length[along], (tail[along], head[along])), (n, n))
    distance, parent = dijkstra(graph, indices=root, return_predecessors=True)
    upward = along[parent[tail[along]] == head[along]]
    up = np.full(n, -1)
    up[tail[upward]] = upward

    in_tree = marked(len(twin), upward, twin[upward])
    others = component.edges[~in_tree[component.edges]]
    closed = distance[tail[others]] + distance[head[others]] + length[others]
    closed[component.is_barred[others]] = np.inf  # polygons are faces of the cotree
    left_over = np.setdiff1d(others, component.crossed_by_tree(others, closed))

    on_path = np.zeros(n, dtype=bool)
    for start in [*tail[left_over], *head[left_over], *(loop[0] for loop in loops)]:
        v = start
        while v != root and not on_path[v]:
            on_path[v] = True
            v = parent[v]
    return _without_loose_ends(component.uncut.cut(np.append(left_over, up[on_path])))


def fill_holes(component: Component) -> Component:
    """Fill all boundary loops but the outermost, for the time of a map.

    A hole that only faces without area would fill stays, and one that has a slit, a seam of which
    both sides are there.
    """
    if component.topology.euler_characteristic > 0:  # a sphere or a disk
        return component
    loops = component.topology.loops
    if len(loops) < 2:
        return component
    V, filling = component.V, []
    outer = by_reach(V, loops)[0]
    for loop in loops:
        faces = (
            None if loop is outer or _has_slit(V[loop]) else fill_hole(V, component.topology, loop)
        )
        if faces is not None:
            if faces.max() == len(V):
                V = with_middle(V, V[loop])
            filling.append(faces)
    F = np.vstack([component.F, *filling])
    alone = component.polygon.max() + np.arange(1, len(F) - len(component.F) + 1)
    polygon = np.append(component.polygon, alone)
    forbidden = np.vstack([component.forbidden, np.zeros((len(alone), 3), dtype=bool)])
    return Component(V, F, polygon, component.rows, forbidden, n_filled=len(filling))


def _has_slit(points: Floats) -> bool:
    """Whether two edges of a closed polygon lie in the same place."""
    _, place = distinct_rows(points)
    edges = np.sort(np.column_stack([place, np.roll(place, -1)]), axis=1)
    return len(distinct_rows(edges)[0]) < len(edges)


def _length(points: Floats) -> float:
    """Length of a closed polygon."""
    return float(np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1).sum())


def _without_loose_ends(opened: OpenedComponent) -> OpenedComponent:
    """Join again the edges of the cut that dangle, as they do near the root."""
    component = opened.component
    at_border = component.uncut.on_boundary
    while True:  # the cut has fewer edges each time
        edges = opened.cut_edges
        ends = np.column_stack([component.tail[edges], component.head[edges]])
        degree = np.bincount(ends.ravel(), minlength=len(component.V))
        loose = ((degree[ends] == 1) & ~at_border[ends]).any(axis=1)
        if not loose.any():
            return opened
        opened = opened.joined(edges[loose])
