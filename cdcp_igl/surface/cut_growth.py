"""Grow a cut to what a map shrinks most."""

from __future__ import annotations

import numpy as np
from scipy.sparse.csgraph import connected_components

from ..arrays import Floats
from .cut_arcs import branch_to, straighten
from .cut_surface import CutSurface

__all__ = ["grow"]

# The map has shrunk a part of the surface where lengths are this much shorter, by the
# power of e, than on the average.
SHRUNK = 1.0
# Branches in one round.
MOST_BRANCHES = 8


def grow(surface: CutSurface, factor: Floats, average: float) -> bool:
    """Cut on to the vertex that shrank most, in each part of the surface that did.

    Parameters
    ----------
    surface : CutSurface
        Cut to a disk.
    factor : (n,) float64
        Conformal factor of a map at the vertices of ``surface.opened()``.
    average : float
        Its average.

    Returns
    -------
    bool
        Whether there was anything to cut.

    References
    ----------
    X. Gu, S. J. Gortler, H. Hoppe. Geometry images. SIGGRAPH 2002.
    """
    opened = surface.opened()
    shrunk = np.flatnonzero(~opened.on_boundary & (factor < average - SHRUNK))
    inside = opened.graph(np.ones(len(opened.tail)))[shrunk][:, shrunk]
    n_parts, part = connected_components(inside, directed=False)
    order = np.lexsort((factor[shrunk], part))
    tips = shrunk[order[np.searchsorted(part[order], np.arange(n_parts))]]
    vertex = np.empty(opened.n, np.int64)
    vertex[opened.tail] = surface.tail
    grown = False
    for tip in tips[np.argsort(factor[tips])][:MOST_BRANCHES]:
        grown |= branch_to(surface, int(vertex[tip]))
    if grown:
        straighten(surface)
    return grown
