"""The order of elimination: nested dissection from above, minimum degree from below."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_matrix

from ..arrays import Floats, Indices, Ints
from .cholesky import fill_reducing_order
from .laplacian import Laplacian
from .solvers import solver

__all__ = ["LARGE", "dissected", "elimination_order"]

# Minimum degree sees no further than the next vertex, and where the boundary has to come
# last, its front grows with every part of the surface that reaches the boundary. A few
# straight cuts first keep the fronts short. With 5 levels, the numeric factorization with the
# boundary last takes 0.7 times as long on 997,000 vertices of which 3,987 are on the boundary,
# 0.75 on 216,000 (1,852), 0.7-0.8 on 750,000 (848); the order takes as long as before, as its
# parts are smaller. Below this many vertices there is nothing to gain, and on folded surfaces
# something to lose (1.3 times on 48,000).
LARGE = 100_000
LEVELS = 5


def elimination_order(L: Laplacian, V: Floats) -> tuple[Indices, str]:
    """Find an order of the vertices in which the factor of their Laplacian stays sparse.

    Parameters
    ----------
    L : Laplacian
    V : (n, 3) float64
        Where the vertices are. The order depends on it on large meshes only, and the map
        by rounding errors only.

    Returns
    -------
    order : (n,) ndarray of int
    str
        What it is called.

    References
    ----------
    A. George. Nested dissection of a regular finite element mesh. SIAM J. Numer. Anal.
    10(2), 1973.
    P. R. Amestoy, T. A. Davis, I. S. Duff. An approximate minimum degree ordering algorithm.
    SIAM J. Matrix Anal. Appl. 17(4), 1996.
    """
    n = len(V)
    if not solver().ORDERS:
        return np.arange(n), "minimum degree"
    if n < LARGE:
        return fill_reducing_order(_pattern(L.low, L.high, n)), "AMD"
    part, low, high = dissected(L.low, L.high, V, LEVELS)
    order = fill_reducing_order(_pattern(low, high, n))
    return order[np.argsort(part[order], kind="stable")], "nested dissection and AMD"


def dissected(low: Indices, high: Indices, V: Floats, levels: int) -> tuple[Ints, Indices, Indices]:
    """Cut a mesh into parts and separators, each part again and again.

    Parameters
    ----------
    low, high : (e,) ndarray of int
        The ends of its edges.
    V : (n, 3) float64
    levels : int

    Returns
    -------
    part : (n,) int64
        For each level a digit in base 3, the first level first: 0 and 1 are the two sides, 2
        the separator, so that in ascending order separators come after what they separate.
    low, high : ndarray of int
        The ends of the edges within the parts, in their order.
    """
    part = np.zeros(len(V), dtype=np.int64)
    columns = np.ascontiguousarray(V.T)
    vertices = np.arange(len(V))
    for level in range(levels):
        k = 3**level
        size = np.maximum(np.bincount(part, minlength=k), 1)
        mean = np.array([np.bincount(part, x, k) for x in columns]) / size
        variance = np.array([np.bincount(part, x * x, k) for x in columns]) / size - mean**2
        # Each part is cut at its centre, across the axis along which it is longest.
        axis = variance.argmax(axis=0)
        side = columns[axis[part], vertices] > mean[axis, np.arange(k)][part]
        cut = side[low] != side[high]
        one, other = low[cut], high[cut]
        digit = side.astype(np.int8)
        digit[np.where(side[one], other, one)] = 2
        part = 3 * part + digit
        within = digit[low] == digit[high]
        low, high = low[within], high[within]
    return part, low, high


def _pattern(low: Indices, high: Indices, n: int) -> csc_matrix:
    """(n, n) zeros below the diagonal where edges are."""
    ends = np.append(0, np.cumsum(np.bincount(low, minlength=n))).astype(low.dtype)
    return csc_matrix((np.zeros(len(low)), high, ends), (n, n))
