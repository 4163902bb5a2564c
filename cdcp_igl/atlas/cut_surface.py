"""One component of a surface, and the edges along which it is cut."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import connected_components, minimum_spanning_tree

from ..arrays import Bools, Floats, Ints
from ..surface.topology import group_by_edge, heads, tails
from ..surface.triangles import corner_cotangents

__all__ = ["CutSurface", "Opened"]


@dataclass(eq=False)
class CutSurface:
    """A connected, oriented manifold, with or without a boundary, and its cut.

    Half-edge k m + f leaves corner k of face f for the next corner; the face is on its left.

    Attributes
    ----------
    V : (n, 3) float64
    F : (m, 3) int64
    polygon : (m,) int64
        Number of the polygon that each face is a part of.
    twin : (3m,) int64
        The half-edge on the other side of each edge, -1 on the boundary.
    is_cut : (3m,) bool
        Half-edges on either side of the edges that are cut; those of the boundary as well.
    settled : set
        Arcs of the cut that were found to be where they should be.
    """

    V: Floats
    F: Ints
    polygon: Ints
    twin: Ints = field(init=False)
    is_cut: Bools = field(init=False)
    settled: set[tuple[int, ...]] = field(init=False, default_factory=set)

    def __post_init__(self) -> None:
        n = len(self.V)
        edges = group_by_edge(tails(self.F, n), n)
        self.tail = self.F.T.ravel()
        self.head = heads(self.tail)
        two = edges.start[edges.valence == 2]
        one, other = edges.sides[two], edges.sides[two + 1]
        self.twin = np.full(self.F.size, -1)
        self.twin[one], self.twin[other] = other, one
        self.is_cut = self.twin < 0

    @cached_property
    def is_diagonal(self) -> Bools:
        """(3m,) half-edges between faces of the same polygon, which are not to be cut.

        Those that join the faces of a polygon without going around a vertex or a hole, so
        that the polygons are disks with all vertices on their boundaries. Faces in successive
        rows are joined first: a fan of triangles stays one where the polygon touches itself.
        """
        m = len(self.F)
        one = np.flatnonzero(np.arange(len(self.twin)) < self.twin)
        one = one[self.polygon[one % m] == self.polygon[self.twin[one] % m]]
        faces = np.sort([one % m, self.twin[one] % m], axis=0)
        graph = coo_matrix((np.diff(faces, axis=0)[0], tuple(faces)), (m, m))
        joined = minimum_spanning_tree(graph).tocoo()
        one = one[np.isin(faces[0] * m + faces[1], joined.row.astype(np.int64) * m + joined.col)]
        is_diagonal = np.zeros(self.F.size, dtype=bool)
        is_diagonal[one] = is_diagonal[self.twin[one]] = True
        return is_diagonal

    @cached_property
    def length(self) -> Floats:
        """(3m,) length of each half-edge, the mean is 1."""
        length = np.linalg.norm(self.V[self.head] - self.V[self.tail], axis=1)
        return length / length.mean()

    @cached_property
    def angle(self) -> Floats:
        """(3m,) angle between each half-edge and the edge before it in its face, in radians."""
        return np.arctan2(1, corner_cotangents(self.V, self.F)).T.ravel()

    def after(self, half: Ints) -> Ints:
        """Return the next half-edges of the same faces."""
        return (half + len(self.F)) % self.F.size

    def before(self, half: Ints) -> Ints:
        """Return the half-edges before these in the same faces."""
        return (half - len(self.F)) % self.F.size

    def set_cut(self, half: Ints, cut: bool) -> None:
        """Cut the edges of some half-edges that have twins, or join them again."""
        self.is_cut[half] = self.is_cut[self.twin[half]] = cut

    @property
    def cut_edges(self) -> Ints:
        """One half-edge of each edge that is cut, without the boundary."""
        return np.flatnonzero(self.is_cut & (np.arange(len(self.twin)) < self.twin))

    def opened(self) -> Opened:
        """Open the surface along the edges that are cut."""
        # Only there the half-edges out of a vertex can fall into several fans.
        touched = np.zeros(len(self.V), dtype=bool)
        touched[self.tail[self.is_cut]] = touched[self.head[self.is_cut]] = True
        spokes = np.flatnonzero(touched[self.tail])
        place = np.empty(len(self.tail), np.int64)
        place[spokes] = np.arange(len(spokes))
        joined = spokes[~self.is_cut[spokes]]
        neighbour = self.after(self.twin[joined])
        graph = coo_matrix(
            (np.ones(len(joined)), (place[joined], place[neighbour])), (len(spokes), len(spokes))
        )
        _, fan = connected_components(graph, directed=False)
        # The first fan of a vertex keeps its number; copies for the others come last.
        _, first = np.unique(fan, return_index=True)
        hub = self.tail[spokes[first]]
        order = np.argsort(hub, kind="stable")
        surplus = order[np.diff(hub[order], prepend=-1) == 0]
        hub[surplus] = len(self.V) + np.arange(len(surplus))
        vertex = self.tail.copy()
        vertex[spokes] = hub[fan]
        return Opened(self, self.is_cut.copy(), len(self.V) + len(surplus), vertex)


@dataclass(eq=False)
class Opened:
    """The surface opened along its cut: each side of the cut has vertices of its own.

    Attributes
    ----------
    surface : CutSurface
    border : (3m,) bool
        Half-edges on the boundary, which are those that are cut.
    n : int
        Number of vertices.
    tail : (3m,) int64
        The vertex that each half-edge leaves.
    """

    surface: CutSurface
    border: Bools
    n: int
    tail: Ints

    @cached_property
    def head(self) -> Ints:
        """(3m,) the vertex to which each half-edge goes."""
        return self.tail[self.surface.after(np.arange(len(self.tail)))]

    @cached_property
    def on_boundary(self) -> Bools:
        """(n,) the vertices of the boundary."""
        on_boundary = np.zeros(self.n, dtype=bool)
        on_boundary[self.tail[self.border]] = True
        return on_boundary

    @cached_property
    def loop(self) -> Ints:
        """(n,) number of the boundary loop of each vertex from 0, -1 in the interior."""
        tail, head = self.tail[self.border], self.head[self.border]
        graph = coo_matrix((np.ones(len(tail)), (tail, head)), shape=(self.n, self.n))
        _, part = connected_components(graph, directed=False)
        loop = np.full(self.n, -1)
        loop[self.on_boundary] = np.unique(part[self.on_boundary], return_inverse=True)[1]
        return loop

    @cached_property
    def euler_characteristic(self) -> int:
        """Vertices - edges + faces."""
        borders = int(self.border.sum())
        edges = borders + (len(self.border) - borders) // 2
        return self.n - edges + len(self.surface.F)

    @cached_property
    def angle_sum(self) -> Floats:
        """(n,) sums of the angles of the faces at each vertex."""
        return np.bincount(self.tail, self.surface.angle, self.n).astype(np.float64)

    @property
    def bend(self) -> float:
        """Sum of the angles that a map onto a half-plane has to change, in radians.

        Interior vertices have 2 pi in the plane, those of a straight boundary pi.
        """
        flat = np.where(self.on_boundary, np.pi, 2 * np.pi)
        return float(abs(self.angle_sum - flat).sum())

    @cached_property
    def positions(self) -> Floats:
        """(n, 3) coordinates of the vertices."""
        positions = np.empty((self.n, 3))
        positions[self.tail] = self.surface.V[self.surface.tail]
        return positions

    @cached_property
    def F(self) -> Ints:
        """(m, 3) the faces by these vertices."""
        return np.ascontiguousarray(self.tail.reshape(3, -1).T)

    @cached_property
    def cuttable(self) -> Ints:
        """Half-edges that can be cut: neither on the boundary nor inside a polygon."""
        return np.flatnonzero(~self.border & ~self.surface.is_diagonal)

    @cached_property
    def inner(self) -> Ints:
        """Half-edges that are not on the boundary."""
        return np.flatnonzero(~self.border)

    def graph(self, weight: Floats) -> csr_matrix:
        """(n, n) symmetric matrix of the weights (3m,) of the inner half-edges."""
        return csr_matrix(
            (weight[self.inner], (self.tail[self.inner], self.head[self.inner])), (self.n, self.n)
        )
