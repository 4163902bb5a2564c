"""Polygonal faces and strips of triangles, as files have them, into triangles; and back."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from .. import libigl
from ..arrays import Ints
from ..errors import Defect, MeshError

__all__ = ["fans", "in_polygons", "naming_polygons", "strips"]


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
        raise MeshError(Defect.of("too few corners", few))
    F = libigl.fans(vertex, np.append(0, np.cumsum(size)))
    return F, np.repeat(np.arange(len(size)), size - 2)


def strips(entries: Ints) -> Ints:
    """Take strips apart: each entry makes a triangle with the two before it.

    Parameters
    ----------
    entries : (k,) int64
        Vertices; -1 ends a strip.

    Returns
    -------
    (m, 3) int64
        The triangles, every other one turned, so that all of a strip have one orientation;
        without those that name a vertex twice, by which a strip turns.
    """
    if len(entries) < 3:
        return np.empty((0, 3), dtype=np.int64)
    ends = np.flatnonzero(entries == -1)
    starts = np.append(0, ends + 1)
    place = np.arange(len(entries)) - np.repeat(starts, np.diff(starts, append=len(entries)))
    F = np.lib.stride_tricks.sliding_window_view(entries, 3).copy()
    turned = place[:-2] % 2 == 1
    F[turned] = F[turned][:, [1, 0, 2]]
    i, j, k = F.T
    return F[(F >= 0).all(axis=1) & (i != j) & (j != k) & (k != i)]


def in_polygons(defects: Sequence[Defect], whole: Ints) -> tuple[Defect, ...]:
    """Let the defects of faces name the polygons of the file that these are parts of."""
    if np.array_equal(whole, np.arange(len(whole))):
        return tuple(defects)  # all are triangles
    return tuple(
        replace(defect, kind="polygons", indices=whole[defect.indices])
        if defect.kind == "faces" and len(defect.indices)
        else defect
        for defect in defects
    )


@contextmanager
def naming_polygons(whole: Ints) -> Iterator[None]:
    """Let a MeshError of the body name polygons, as `in_polygons` does."""
    try:
        yield
    except MeshError as error:
        raise MeshError(*in_polygons(error.defects, whole)) from error
