"""Texture coordinates that differ from corner to corner, by index."""

from __future__ import annotations

import numpy as np

from ..arrays import Floats, Ints

__all__ = ["indexed"]


def indexed(F: Ints, uv: Floats) -> tuple[Floats, Ints, Ints]:
    """List each pair of a vertex and its texture coordinates once.

    Parameters
    ----------
    F : (m, 3) int64
    uv : (m, 3, 2) float64
        Texture coordinates at the corners. Where the surface was cut open, a vertex has
        several; NaN is the same as NaN.

    Returns
    -------
    texture : (k, 2) float64
        In the order of the vertices.
    FT : (m, 3) int64
        ``texture[FT]`` is `uv`.
    vertex : (k,) int64
        The vertex of each row of `texture`.
    """
    corner, plane = F.ravel(), uv.reshape(-1, 2)
    key = np.nan_to_num(plane, nan=np.inf)
    order = np.lexsort((key[:, 1], key[:, 0], corner))
    corner, plane, key = corner[order], plane[order], key[order]
    new = np.ones(len(order), dtype=bool)
    new[1:] = (corner[1:] != corner[:-1]) | (key[1:] != key[:-1]).any(axis=1)
    FT = np.empty(len(order), dtype=np.int64)
    FT[order] = np.cumsum(new) - 1
    return plane[new], FT.reshape(F.shape), corner[new]
