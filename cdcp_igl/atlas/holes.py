"""Holes filled for the time of a map."""

from __future__ import annotations

import numpy as np

from ..surface.filling import fill_hole
from ..surface.topology import Topology, outer_loop
from .cut_surface import CutSurface

__all__ = ["fill_holes"]


def fill_holes(surface: CutSurface) -> tuple[CutSurface, int]:
    """Fill all boundary loops but the outermost.

    Parameters
    ----------
    surface : CutSurface
        Not cut yet.

    Returns
    -------
    surface : CutSurface
        The faces that fill holes come last. A hole that only faces without area would fill,
        such as a slit of coinciding edges, stays.
    n_filled : int
    """
    loops = Topology(surface.F, len(surface.V)).loops
    if len(loops) < 2:
        return surface, 0
    V, F, n_filled = surface.V, [surface.F], 0
    outer = outer_loop(V, loops)
    for loop in loops:
        faces = None if loop is outer else fill_hole(V, loop)
        if faces is not None:
            if faces.max() == len(V):
                V = np.vstack([V, V[loop].mean(axis=0)])
            F.append(faces)
            n_filled += 1
    filled = np.vstack(F)
    alone = surface.polygon.max() + np.arange(1, len(filled) - len(surface.F) + 1)
    return CutSurface(V, filled, np.append(surface.polygon, alone)), n_filled
