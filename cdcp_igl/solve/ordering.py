"""The order of elimination: nested dissection from above, minimum degree from below."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_matrix

from ..arrays import Bools, Floats, Indices, Ints, evenly_spaced_rows
from .cholesky import Cholesky, Ordering
from .laplacian import Laplacian

# Minimum degree is greedy; a few straight cuts first keep its fronts short. Below this many
# vertices there is nothing to gain, and on surfaces with folds something to lose.
LARGE = 100_000
LEVELS = 5
SAMPLE = 20_000  # vertices from which the cuts are found


def elimination_order(
    L: Laplacian, V: Floats, free: Bools, solver: type[Cholesky]
) -> tuple[Ints | Indices, Ordering, str]:
    """Find an order of the free vertices in which the factor of their Laplacian stays sparse.

    The places V (n, 3) matter on large meshes only, and to the map by rounding errors only.

    Return the free vertices (k,), whether the solver is still to find an order of these ("amd")
    or takes them as they come ("natural"), and what the order is called.

    A. George. Nested dissection of a regular finite element mesh. SIAM J. Numer. Anal.
    10(2), 1973.
    P. R. Amestoy, T. A. Davis, I. S. Duff. An approximate minimum degree ordering algorithm.
    SIAM J. Matrix Anal. Appl. 17(4), 1996.
    """
    if not solver.ORDERS:
        return np.flatnonzero(free), "natural", "minimum degree"
    if len(V) < LARGE:
        return np.flatnonzero(free), "amd", "AMD"
    order = _order_by_parts(dissected(L.low, L.high, V), L.low, L.high, solver)
    return order[free[order]], "natural", "nested dissection and AMD"


def dissected(low: Indices, high: Indices, V: Floats, levels: int = LEVELS) -> Indices:
    """Cut a mesh with these edges into parts and separators, each part again and again.

    Return the part of each vertex (n,): for each level a digit in base 3, the first level first.
    0 and 1 are the two sides, 2 the separator, so that in ascending order separators come after
    what they separate. No edge joins two parts of which neither is a separator that comes after
    the other.
    """
    side = sides(V, cuts(V[evenly_spaced_rows(len(V), SAMPLE)], levels))
    apart = np.flatnonzero(side[low] != side[high])
    one, other = low[apart], high[apart]
    # The level at which an edge is cut is that of the first bit in which its ends differ.
    level = levels - np.frexp(side[one] ^ side[other])[1]
    from_0 = (side[one] >> (levels - 1 - level)) & 1 == 0
    cut_at = np.full(len(V), levels)
    np.minimum.at(cut_at, np.where(from_0, one, other), level)
    part = np.zeros(len(V), dtype=np.int16)  # NumPy sorts 16 bits in linear time
    for k in range(levels):
        digit = ((side >> (levels - 1 - k)) & 1).astype(part.dtype)
        digit[cut_at == k] = 2
        digit[cut_at < k] = 0
        part = 3 * part + digit
    return part


def cuts(seen: Floats, levels: int) -> list[tuple[Ints, Floats]]:
    """Cut points (k, 3) in two again and again: for each level, axis and place of its cuts.

    Each part is cut at its centre, across the axis along which it is longest.
    """
    found = list[tuple[Ints, Floats]]()
    at = np.zeros(len(seen), dtype=np.int64)
    for level in range(levels):
        k = 1 << level
        size = np.maximum(np.bincount(at, minlength=k), 1)
        mean = np.array([np.bincount(at, x, k) for x in seen.T]) / size
        variance = np.array([np.bincount(at, x * x, k) for x in seen.T]) / size - mean**2
        axis = variance.argmax(axis=0)
        found.append((axis, mean[axis, np.arange(k)]))
        at = _cut(seen, at, *found[-1])
    return found


def sides(V: Floats, found: list[tuple[Ints, Floats]]) -> Ints:
    """(n,) on which side of each cut points lie, a bit for each level, the first is the highest."""
    at = np.zeros(len(V), dtype=np.int64)
    for axis, middle in found:
        at = _cut(V, at, axis, middle)
    return at


def _cut(V: Floats, at: Ints, axis: Ints, middle: Floats) -> Ints:
    return 2 * at + (V[np.arange(len(V)), axis[at]] > middle[at])


def _order_by_parts(part: Indices, low: Indices, high: Indices, solver: type[Cholesky]) -> Indices:
    """Order every part by minimum degree on its own: in one graph, it would jump between them."""
    vertices = np.argsort(part, kind="stable").astype(low.dtype)
    place = np.empty_like(vertices)
    place[vertices] = np.arange(len(vertices))
    within = np.flatnonzero(part[low] == part[high])
    low, high = low[within], high[within]
    by_part = np.argsort(part[low], kind="stable")
    low, high = place[low[by_part]], place[high[by_part]]
    starts = np.flatnonzero(np.diff(part[vertices], prepend=-1))
    ends = np.append(starts[1:], len(vertices))
    edges = np.searchsorted(low, np.append(starts, len(vertices)))
    order = np.empty_like(vertices)
    for start, end, first, last in zip(starts, ends, edges[:-1], edges[1:], strict=True):
        pattern = _pattern(low[first:last] - start, high[first:last] - start, end - start)
        order[start:end] = vertices[start + solver.fill_reducing_order(pattern)]
    return order


def _pattern(low: Indices, high: Indices, n: int) -> csc_matrix:
    """(n, n) zeros below the diagonal where edges are."""
    ends = np.append(0, np.cumsum(np.bincount(low, minlength=n))).astype(low.dtype)
    return csc_matrix((np.zeros(len(low)), high, ends), (n, n))
