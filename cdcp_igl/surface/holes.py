"""Small holes, filled by fans around a new vertex."""

from __future__ import annotations

import numpy as np

from .cut_surface import CutSurface
from .report import DEGENERATE
from .triangles import face_areas, parallelogram_areas

__all__ = ["fill_small_holes"]


def fill_small_holes(surface: CutSurface, share: float) -> tuple[CutSurface, int]:
    """Fill the boundary loops, but for the longest, that are small by the surface.

    A loop is small if a round hole of its length has at most a given share of the
    surface's area. One that no fan with areas fills, such as a slit, stays.

    Parameters
    ----------
    surface : CutSurface
        Not cut yet.
    share : float

    Returns
    -------
    surface : CutSurface
        The faces of the fans come last.
    n_filled : int
    """
    opened = surface.opened()
    border = np.flatnonzero(surface.twin < 0)
    loop = opened.loop[opened.tail[border]]
    if len(border) == 0 or loop.max() == 0:
        return surface, 0
    tail, head = surface.tail[border], surface.head[border]
    length = np.bincount(loop, np.linalg.norm(surface.V[head] - surface.V[tail], axis=1))
    area = face_areas(surface.V, surface.F).sum()
    small = length**2 / (4 * np.pi) <= share * area
    small[length.argmax()] = False
    V, F, filled = [surface.V], [surface.F], 0
    for k in np.flatnonzero(small):
        a, b = surface.V[tail[loop == k]], surface.V[head[loop == k]]
        middle = a.mean(axis=0)
        twice_area = parallelogram_areas(a - middle, b - middle)
        longest = np.maximum(((a - middle) ** 2).sum(axis=1), ((a - b) ** 2).sum(axis=1))
        if (twice_area <= 2 * DEGENERATE * longest).any():
            continue
        center = np.full((loop == k).sum(), len(surface.V) + filled)
        F.append(np.column_stack([head[loop == k], tail[loop == k], center]))
        V.append(middle[None])
        filled += 1
    if filled == 0:
        return surface, 0
    return CutSurface(np.vstack(V), np.vstack(F)), filled
