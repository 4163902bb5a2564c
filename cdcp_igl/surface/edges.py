"""The edges of a triangle mesh, and the half-edges on their sides."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, get_index_dtype

from ..arrays import Bools, Floats, Indices, Ints

__all__ = ["Edges", "group_by_edge", "heads", "tails"]


@dataclass(frozen=True, eq=False)
class Edges:
    """Undirected edges, by their smaller vertex and then by the larger.

    Attributes
    ----------
    low, high : (e,) ndarray of int
        The ends of each edge, the smaller index first.
    sides : (3m,) ndarray of int
        The half-edges, those of an edge in succession.
    start : (e,) ndarray of int
        Where each edge begins in `sides`.
    """

    low: Indices
    high: Indices
    sides: Indices
    start: Indices

    @property
    def valence(self) -> Indices:
        """(e,) number of half-edges, which is that of faces, of each edge."""
        return np.diff(self.start, append=self.start.dtype.type(len(self.sides)))

    def chords(self, on_boundary: Bools) -> Bools:
        """(e,) which edges with two faces join two boundary vertices, or two of some of these."""
        return (self.valence == 2) & on_boundary[self.low] & on_boundary[self.high]

    def ends(self, chosen: Bools) -> Ints:
        """(k, 2) vertices of some of the edges."""
        return np.column_stack([self.low[chosen], self.high[chosen]]).astype(np.int64)

    def sum_opposite(self, x: Floats) -> Floats:
        """(e,) sums of the values x (m, 3) at the corners opposite each edge."""
        # Half-edge k m + f leaves corner k of face f, so it lies opposite corner k - 1, where
        # that of the first is the last: counted from the end, as negative indices are.
        opposite = x.T.ravel()[self.sides - len(x)]
        return np.add.reduceat(opposite, self.start)


def tails(F: Ints, n: int) -> Indices:
    """(3m,) where half-edges begin: k m + f leaves corner k of face f for the next corner."""
    # Sorting them is most of the work of all checks, and takes half the time on 32 bits.
    return F.T.astype(get_index_dtype(maxval=max(2 * F.size, n)), order="C").ravel()


def heads(tail: Indices) -> Indices:
    """(3m,) where half-edges end, by where they begin."""
    return np.roll(tail, -(len(tail) // 3))


def group_by_edge(tail: Indices, n: int) -> Edges:
    """Sort the half-edges of a mesh of n vertices, by their tails (3m,), by edge; stable."""
    head = heads(tail)
    low = np.minimum(tail, head)
    high = np.maximum(tail, head, out=head)
    high, low, sides = _counting_sort(high, low, np.arange(len(tail), dtype=tail.dtype), n)
    low, high, sides = _counting_sort(low, high, sides, n)
    first = np.ones(len(sides), dtype=bool)
    first[1:] = (low[1:] != low[:-1]) | (high[1:] != high[:-1])
    start = np.flatnonzero(first).astype(sides.dtype)
    return Edges(low[start], high[start], sides, start)


def _counting_sort(
    keys: Indices, values: Indices, order: Indices, n: int
) -> tuple[Indices, Indices, Indices]:
    """Sort keys from 0 to n - 1, and what goes with them, like a matrix by its rows; stable."""
    entries = coo_matrix((values, (keys, order)), (n, len(keys)))
    entries.has_canonical_format = True  # saves scipy a search
    rows = entries.tocsr()
    keys = np.repeat(np.arange(n, dtype=keys.dtype), np.diff(rows.indptr))
    return keys, rows.data, rows.indices
