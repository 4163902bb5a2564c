"""How faces hang together: edges, components, fans of faces at a vertex, boundary loops, genus."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix, get_index_dtype
from scipy.sparse.csgraph import breadth_first_order, connected_components

from .. import libigl
from ..arrays import Bools, Floats, Indices, Ints, distinct_rows, marked, shifted, unit_size
from ..cached import cached_property

ROUNDING = 2.0**-36  # of the size: as far apart may vertices lie that were to be at one place


@dataclass(frozen=True, eq=False)
class Edges:
    """Undirected edges, by their smaller vertex and then by the larger."""

    low: Indices  # (e,) the end of smaller index
    high: Indices  # (e,) the other
    sides: Indices  # (3m,) the half-edges, those of an edge in succession
    start: Indices  # (e,) where each edge begins in `sides`

    @property
    def valence(self) -> Indices:
        """(e,) number of half-edges, which is that of faces, of each edge."""
        valence = shifted(self.start) - self.start
        valence[-1:] += len(self.sides)
        return valence

    @property
    def twins(self) -> tuple[Indices, Indices]:
        """The half-edges on either side of each edge that has two faces."""
        two = self.start[self.valence == 2]
        return self.sides[two], self.sides[two + 1]

    @property
    def border(self) -> Indices:
        """The half-edges of the edges that have one face."""
        return self.sides[self.start[self.valence == 1]]

    def chords(self, marked: Bools) -> Bools:
        """(e,) which edges with two faces have both ends marked."""
        return (self.valence == 2) & marked[self.low] & marked[self.high]

    def ends(self, chosen: Bools) -> Ints:
        """(k, 2) vertices of some of the edges."""
        return np.column_stack([self.low[chosen], self.high[chosen]]).astype(np.int64)


@dataclass(frozen=True, eq=False)
class Topology:
    """The topology of a triangle mesh, whatever it is; computed as far as it is asked for.

    One sort of undirected edges is behind it all. Half-edge k m + f leaves corner k of
    face f.
    """

    F: Ints  # (m, 3) indices in range, no vertex at two corners of one
    n: int  # vertices

    @cached_property
    def edges(self) -> Edges:
        """The undirected edges."""
        return group_by_edge(self._tail, self.n)

    @cached_property
    def singular(self) -> Bools:
        """(e,) edges with three faces or more."""
        return self.edges.valence > 2

    @cached_property
    def twins(self) -> tuple[Indices, Indices]:
        """The half-edges on either side of each edge that has two faces."""
        return self.edges.twins

    @cached_property
    def border(self) -> Indices:
        """The half-edges of the edges that have one face."""
        return self.edges.border

    @cached_property
    def used(self) -> Bools:
        """(n,) vertices with faces."""
        return np.bincount(self.F.ravel(), minlength=self.n) > 0

    @cached_property
    def ears(self) -> Ints:
        """Faces with two boundary edges or three."""
        m = len(self.F)
        return np.flatnonzero(np.bincount(self.border % m, minlength=m) > 1)

    @cached_property
    def chords(self) -> Ints:
        """(k, 2) ends of the edges with two faces that join two boundary vertices."""
        return self.edges.ends(self.edges.chords(marked(self.n, self._border_ends)))

    # -- components and orientation ----------------------------------------------------

    @cached_property
    def components(self) -> tuple[int, NDArray[np.int32]]:
        """Number of components of faces that share edges, and that of each face."""
        # Every face has three neighbours, itself where one is missing, so the adjacency can
        # be written down in CSR form without sorting. Nobody reads its entries.
        (one, other), m = self.twins, len(self.F)
        face = np.tile(np.arange(m, dtype=np.int32), 3)  # of each half-edge
        neighbour = face.copy()
        neighbour[one], neighbour[other] = face[other], face[one]
        starts = np.arange(0, 3 * m + 1, 3, dtype=np.int32)
        graph = csr_matrix((np.zeros(3 * m), neighbour.reshape(3, m).T.ravel(), starts), (m, m))
        if len(breadth_first_order(graph, 0, return_predecessors=False)) == m:
            return 1, np.zeros(m, np.int32)
        return connected_components(graph, directed=False)

    @cached_property
    def misoriented(self) -> Ints | None:
        """Faces that are oriented unlike most of their component; None if it has one side."""
        one, other = self.twins
        if not (self._tail[one] == self._tail[other]).any():
            return np.empty(0, np.int64)
        flipped, one_sided = self.flipped_across(one, other)
        return None if one_sided.any() else np.flatnonzero(flipped)

    def flipped_across(self, one: Indices, other: Indices) -> tuple[Bools, Bools]:
        """(m,) faces that are oriented unlike most that hang together across some of the twins.

        And (m,) those that so hang together on one side, none of which counts as flipped.
        """
        aligned = self._tail[one] == self._tail[other]  # as they are where one face is flipped
        # Node f stands for face f as it is, node f + m for its reversal.
        m = len(self.F)
        left, right = one % m, other % m
        shift = np.where(aligned, m, 0)
        rows = np.concatenate([left, left + m])
        columns = np.concatenate([right + shift, right + m - shift])
        _, side = components_of_pairs(rows, columns, 2 * m)
        size = np.bincount(side[:m], minlength=side.max() + 1)
        mine, theirs = size[side[:m]], size[side[m:]]
        flipped = (mine < theirs) | ((mine == theirs) & (side[:m] > side[m:]))
        return flipped, side[:m] == side[m:]

    # -- vertices ----------------------------------------------------------------------

    @cached_property
    def fans(self) -> tuple[int, NDArray[np.int32]]:
        """Corners, (3m,) in the order of ``F.T``, grouped around each vertex across twins."""
        return self.fans_across(*self.twins)

    def fans_across(self, one: Indices, other: Indices) -> tuple[int, NDArray[np.int32]]:
        """Group the corners around each vertex across some of the twins."""
        m = len(self.F)
        # The next half-edge of the same face leaves the other end of the edge.
        after_one, after_other = (one + m) % self.F.size, (other + m) % self.F.size
        aligned = self._tail[one] == self._tail[other]
        rows = np.concatenate([one, after_one])
        columns = np.concatenate(
            [np.where(aligned, other, after_other), np.where(aligned, after_other, other)]
        )
        return components_of_pairs(rows, columns, self.F.size)

    def vertices_across(self, one: Indices, other: Indices) -> Ints:
        """(m, 3) numbers of the corners: those that hang together across these twins are one."""
        _, fan = self.fans_across(one, other)
        return np.ascontiguousarray(fan.reshape(3, -1).T, dtype=np.int64)

    @cached_property
    def pinched(self) -> Ints:
        """Vertices whose corners form more than one fan across twins."""
        if self._is_plain:
            return np.empty(0, np.int64)
        n_fans, fan = self.fans
        vertex_of_fan = np.empty(n_fans, np.int64)
        vertex_of_fan[fan] = self.F.T.ravel()
        return np.flatnonzero(np.bincount(vertex_of_fan, minlength=self.n) > 1)

    @cached_property
    def is_manifold(self) -> bool:
        """Whether each edge has one face or two, and each vertex one fan of them."""
        return not self.singular.any() and len(self.pinched) == 0

    @cached_property
    def _is_plain(self) -> bool:
        """Whether counting alone shows that the faces, once oriented, form a disk or a sphere.

        Let them hang together across edges, none with more than two faces. With p pinched vertices
        undone, a closed surface of Euler characteristic 2 has 2 + p, but at most 2. One of
        characteristic 1, with a boundary that does not touch itself, has 1 + p, but at most 1, and
        then it is a disk. So p = 0.
        """
        if self.singular.any() or self.components[0] > 1:
            return False
        if len(self.border) == 0:
            return self.euler_characteristic == 2
        ends = self._border_ends.ravel()
        return self.euler_characteristic == 1 and bool(np.bincount(ends).max() == 2)

    # -- boundary and genus ------------------------------------------------------------

    @cached_property
    def euler_characteristic(self) -> int:
        """Vertices with faces, less edges, plus faces."""
        return int(self.used.sum()) - len(self.edges.low) + len(self.F)

    @cached_property
    def loops(self) -> list[Ints]:
        """The boundary loops of a manifold with two sides, each from its smallest vertex.

        The surface is on their left, after the faces of `misoriented` are reversed.
        """
        if not self.is_manifold or self.misoriented is None:
            return []
        tail, head = self._border_ends
        if len(self.misoriented):
            flipped = np.isin(self.border % len(self.F), self.misoriented)
            tail, head = np.where(flipped, head, tail), np.where(flipped, tail, head)
        if self._is_plain and len(tail):
            loop = libigl.path(np.column_stack([tail, head]).astype(np.int64))
            return [shifted(loop, int(loop.argmin()))]
        return _cycles(tail, head)

    @cached_property
    def genus(self) -> int | None:
        """Handles of all components of a manifold with two sides; None of another mesh."""
        if not self.is_manifold or self.misoriented is None:
            return None
        return (2 * self.components[0] - len(self.loops) - self.euler_characteristic) // 2

    @cached_property
    def _tail(self) -> Indices:
        return tails(self.F, self.n)

    @cached_property
    def _border_ends(self) -> Indices:
        """(2, k) where the half-edges of the border begin, and where they end."""
        return self._tail[np.array([self.border, (self.border + len(self.F)) % self.F.size])]


def tails(F: Ints, n: int) -> Indices:
    """(3m,) where half-edges begin: k m + f leaves corner k of face f for the next corner."""
    # Sorting them is most of the work of all checks, and takes half the time on 32 bits.
    return F.T.astype(get_index_dtype(maxval=max(2 * F.size, n)), order="C").ravel()


def heads(tail: Indices) -> Indices:
    """(3m,) where half-edges end, by where they begin."""
    return shifted(tail, len(tail) // 3)


def group_by_edge(tail: Indices, n: int) -> Edges:
    """Sort the half-edges of a mesh of n vertices, by their tails (3m,), by edge; stable."""
    head = heads(tail)
    low = np.minimum(tail, head)
    high = np.maximum(tail, head, out=head)
    # A counting sort by the larger vertex, then one by the smaller: as of a matrix by its rows, and
    # of those by its columns.
    matrix = coo_matrix((np.arange(len(tail), dtype=tail.dtype), (high, low)), (n, n))
    matrix.has_canonical_format = True  # entries in one place are not to be added up
    matrix = matrix.tocsr().tocsc()
    low = np.repeat(np.arange(n, dtype=tail.dtype), np.diff(matrix.indptr))
    high, sides = matrix.indices, matrix.data
    first = np.ones(len(sides), dtype=bool)
    first[1:] = (low[1:] != low[:-1]) | (high[1:] != high[:-1])
    start = np.flatnonzero(first).astype(sides.dtype)
    return Edges(low[start], high[start], sides, start)


def duplicate_faces(F: Ints) -> Ints:
    """Faces that have the corners of an earlier one, in whatever order."""
    first, _ = distinct_rows(np.sort(F, axis=1))
    return np.setdiff1d(np.arange(len(F)), first)


def rim_pairs(V: Floats, edges: Edges, within: float, part: float = 0.5) -> tuple[Ints, Floats]:
    """(k, 2) boundary vertices that lie at most so far apart, but not in one place; (k,) how far.

    And less than a part of the shortest edge at either of them, so that no face collapses.
    """
    from scipy.spatial import cKDTree  # slow to import, and used here alone

    rims = edges.valence == 1
    at_rim = marked(len(V), edges.low[rims], edges.high[rims])
    ends = edges.ends(at_rim[edges.low] | at_rim[edges.high])
    lengths = np.linalg.norm(V[ends[:, 0]] - V[ends[:, 1]], axis=1)
    shortest = np.full(len(V), np.inf)
    for end in ends[lengths > ROUNDING].T:
        np.minimum.at(shortest, end, lengths[lengths > ROUNDING])
    rim = np.flatnonzero(at_rim & np.isfinite(shortest))
    rim = rim[distinct_rows(V[rim])[0]]
    farthest = min(within, part * shortest[rim].max(initial=0))
    pairs = rim[cKDTree(V[rim]).query_pairs(farthest, output_type="ndarray")].reshape(-1, 2)
    apart = np.linalg.norm(V[pairs[:, 0]] - V[pairs[:, 1]], axis=1)
    near = apart < part * shortest[pairs].min(axis=1)
    return pairs[near], apart[near]


def sewn(V: Floats, F: Ints, within: float = ROUNDING) -> tuple[Ints, int]:
    """Merge vertices at one place along seams: the faces (m, 3), and how many vertices went.

    At one place are those whose coordinates are equal, and on the boundary those `within` which
    they lie; V is of unit size. At a seam two edges lie in the same place, each with a face of its
    own. Sheets that only touch have none, and stay apart. A loose triangle that repeats another
    gets its vertices.
    """
    n = len(V)
    first, place = distinct_rows(V)
    if len(pairs := rim_pairs(V, Topology(F, n).edges, within)[0]):
        count, together = components_of_pairs(place[pairs[:, 0]], place[pairs[:, 1]], len(first))
        place, first = together.astype(np.int64)[place], first[:count]
    if len(first) == n:
        return F, 0
    at = place[F]
    inner = np.sort(at, axis=1)
    lead, which = distinct_rows(inner)
    proper = lead[(np.diff(inner[lead]) > 0).all(axis=1)]
    one, other = Topology(at[proper], n).twins
    tail = tails(F[proper], n)
    tail_at, head = place[tail], heads(tail)
    aligned = tail_at[one] == tail_at[other]
    loose = np.flatnonzero((np.bincount(F.ravel())[F] == 1).all(axis=1))
    corners = np.take_along_axis(F, np.argsort(at, axis=1), axis=1)
    rows = [tail[one], head[one], corners[loose].ravel()]
    columns = [
        np.where(aligned, tail[other], head[other]),
        np.where(aligned, head[other], tail[other]),
        corners[lead[which[loose]]].ravel(),
    ]
    n_left, group = components_of_pairs(np.concatenate(rows), np.concatenate(columns), n)
    _, kept = np.unique(group, return_index=True)
    return kept[group[F]], n - n_left


def by_reach(V: Floats, loops: list[Ints]) -> list[Ints]:
    """Sort loops, that which reaches farthest first, by the diagonal of its box.

    In the plane it encloses all others, however long and finely resolved those are.
    """
    if len(loops) < 2:
        return loops
    positions = unit_size(V)
    return sorted(loops, key=lambda loop: -float(np.linalg.norm(np.ptp(positions[loop], axis=0))))


def components_of_pairs(rows: Indices, columns: Indices, n: int) -> tuple[int, NDArray[np.int32]]:
    """Count the components of a graph of n nodes, joined in pairs; (n,) that of each node."""
    graph = coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(n, n))
    return connected_components(graph, directed=False)


def _cycles(tail: Indices, head: Indices) -> list[Ints]:
    """Cycles of the permutation tail -> head, each from its smallest vertex."""
    by_tail = np.argsort(tail)
    following = dict(zip(tail[by_tail].tolist(), head[by_tail].tolist(), strict=True))
    loops = []
    while following:
        loop = [next(iter(following))]
        while (vertex := following.pop(loop[-1])) != loop[0]:
            loop.append(vertex)
        loops.append(np.array(loop, dtype=np.int64))
    return loops
