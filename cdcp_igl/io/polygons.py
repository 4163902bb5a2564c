"""Polygonal faces, as obj and off files have them, into triangles."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .. import libigl
from ..arrays import Ints
from ..errors import Defect, MeshError

__all__ = ["fans"]


def fans(corners: ArrayLike, sizes: ArrayLike) -> tuple[Ints, Ints]:
    """Split each polygon into the triangles around its first corner.

    Parameters
    ----------
    corners : (k,) array_like of int
        Vertices of all polygons, one after the other.
    sizes : (p,) array_like of int
        Number of corners of each polygon.

    Returns
    -------
    F : (m, 3) int64
    whole : (m,) int64
        Which polygon each triangle is a part of.

    Raises
    ------
    MeshError
        If a polygon has fewer than three corners.
    """
    vertex, size = np.array(corners, dtype=np.int64), np.array(sizes, dtype=np.int64)
    few = np.flatnonzero(size < 3)
    if len(few):
        raise MeshError(
            Defect(
                "too few corners",
                f"{len(few):,} of {len(size):,} faces have fewer than three corners",
                "The file may be cut off: export it again, or drop these faces.",
                "faces",
                few,
            )
        )
    F = libigl.fans(vertex, np.append(0, np.cumsum(size)))
    return F, np.repeat(np.arange(len(size)), size - 2)
