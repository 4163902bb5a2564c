"""Grow a cut to what a map shrinks most."""

from __future__ import annotations

import numpy as np
from scipy.sparse.csgraph import connected_components, dijkstra

from ..arrays import Floats
from ..surface.triangles import face_areas
from .cut_arcs import branch_to, straighten
from .cut_surface import CutSurface

__all__ = ["grow", "lead_away"]

# The map has shrunk a part of the surface where lengths are this much shorter, by the
# power of e, than on the average.
SHRUNK = 1.0
# A boundary is tiny if a round hole as long has at most this share of the surface's area.
TINY = 0.01
# Branches in one round.
MOST_BRANCHES = 8


def lead_away(surface: CutSurface) -> None:
    """Cut from a boundary that is tiny by the surface to the vertex farthest from it.

    Almost all of a surface that is closed but for a small hole would be shrunk.
    """
    opened = surface.opened()
    length = float(surface.length[opened.border].sum())
    a, b = surface.V[surface.F[:, 0]], surface.V[surface.F[:, 1]]
    mean = np.linalg.norm(b - a, axis=1).sum() / surface.length[: len(a)].sum()
    area = face_areas(surface.V, surface.F).sum() / mean**2
    if length**2 > TINY * 4 * np.pi * area:
        return
    boundary = np.flatnonzero(opened.on_boundary)
    distance = dijkstra(opened.graph(surface.length), indices=boundary, min_only=True)
    farthest = int(distance.argmax())  # in the interior, whose vertices keep their numbers
    branch_to(surface, farthest)


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
    grown = False
    for tip in tips[np.argsort(factor[tips])][:MOST_BRANCHES]:
        grown |= branch_to(surface, int(tip))  # interior vertices keep their numbers
    if grown:
        straighten(surface)
    return grown
