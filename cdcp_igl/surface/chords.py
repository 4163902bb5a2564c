"""Chords: edges inside a disk that join two boundary vertices, and the pieces they cut off."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components, depth_first_order

from ..arrays import Bools, Ints
from .topology import Edges


@dataclass(frozen=True, eq=False)
class Chords:
    """The pieces that chords cut off from the largest part of a disk, outer ones first.

    Attributes
    ----------
    start, end : (k,) int64
        Places in ``loop`` of the ends of each chord; from the first to the second, around if
        need be, runs the boundary of the piece.
    hollow : (k,) bool
        Whether there are vertices inside the piece that are behind no further chord.
    """

    start: Ints
    end: Ints
    hollow: Bools
    _loop: Ints
    _rank: Ints  # of the part of each face, parts behind a chord in succession
    _behind: Ints  # the number of parts behind each chord

    @classmethod
    def of(cls, F: Ints, edges: Edges, loop: Ints, place: Ints) -> Chords:
        """Find the chords of a disk.

        Parameters
        ----------
        F : (m, 3) int64
        edges : Edges
        loop : (nB,) int64
        place : (n,) int64
            Of each vertex in the loop, -1 inside.
        """
        m, inside, on_boundary = len(F), edges.valence == 2, place >= 0
        one, other = (edges.sides[edges.start[inside] + k].astype(np.int64) for k in (0, 1))
        chord = edges.chords(on_boundary)[inside]
        near = coo_matrix(
            (np.ones(np.count_nonzero(~chord)), (one[~chord] % m, other[~chord] % m)), (m, m)
        )
        count, part = connected_components(near, directed=False)
        # The parts are a tree, with a chord between each and its parent.
        one, other = one[chord], other[chord]
        tree = coo_matrix((np.ones(len(one)), (part[one % m], part[other % m])), (count, count))
        order, parent = depth_first_order(tree, np.bincount(part).argmax(), directed=False)
        size = np.ones(count, dtype=np.int64)
        for child in order[:0:-1]:
            size[parent[child]] += size[child]
        rank = np.empty(count, dtype=np.int64)
        rank[order] = np.arange(count)
        # Of the two sides of a chord, that of the child; it runs from the end of the boundary.
        side = np.where(rank[part[one % m]] > rank[part[other % m]], one, other)
        side = side[np.argsort(rank[part[side % m]])]
        face, corner = side % m, side // m
        hollow = np.bincount(rank[part], ~on_boundary[F].all(axis=1), count) > 0
        return cls(
            start=place[F[face, (corner + 1) % 3]],
            end=place[F[face, corner]],
            hollow=hollow[1:],
            _loop=loop,
            _rank=rank[part],
            _behind=size[order][1:],
        )

    def faces(self, k: int) -> Ints:
        """Rows of F of a piece, those behind further chords included."""
        return np.flatnonzero(self.holds(k)[self._rank])

    def holds(self, k: int) -> Bools:
        """Which parts, by their rank, are in a piece."""
        parts = np.zeros(len(self.start) + 1, dtype=bool)
        parts[k + 1 : k + 1 + self._behind[k]] = True
        return parts

    def run(self, k: int) -> Ints:
        """Boundary vertices of a piece in the order of the loop, ends of the chord included."""
        length = (self.end[k] - self.start[k]) % len(self._loop) + 1
        return self._loop[(self.start[k] + np.arange(length)) % len(self._loop)]

    def outermost(self, chosen: Ints) -> Ints:
        """Of chosen pieces, ascending, those that no other chosen piece contains."""
        found, after = [], 0
        for k in chosen:
            if k >= after:
                found.append(k)
                after = k + self._behind[k]
        return np.array(found, dtype=np.int64)
