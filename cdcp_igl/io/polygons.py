"""Polygonal faces, as files have them, into triangles; and back."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from .. import libigl
from ..arrays import Ints
from ..errors import Defect, MeshError


def fans(corners: ArrayLike, sizes: ArrayLike) -> tuple[Ints, Ints]:
    """Split each polygon into the triangles around its first corner.

    Given are the vertices of all polygons, one after the other, and the number of corners of
    each. Returned are the triangles (m, 3) and the polygon (m,) that each is a part of.
    MeshError if a polygon has fewer than three corners.
    """
    vertex, size = np.array(corners, dtype=np.int64), np.array(sizes, dtype=np.int64)
    few = np.flatnonzero(size < 3)
    if len(few):
        raise MeshError(Defect.of("too few corners", few))
    F = libigl.fans(vertex, np.append(0, np.cumsum(size)))
    return F, np.repeat(np.arange(len(size)), size - 2)


def in_polygons(defects: Sequence[Defect], polygon_of_face: Ints) -> tuple[Defect, ...]:
    """Let the defects of faces name the polygons of the file that these are parts of."""
    if np.array_equal(polygon_of_face, np.arange(len(polygon_of_face))):
        return tuple(defects)  # all are triangles
    return tuple(
        replace(defect, kind="polygons", indices=polygon_of_face[defect.indices])
        if defect.kind == "faces" and len(defect.indices)
        else defect
        for defect in defects
    )


@contextmanager
def naming_polygons(polygon_of_face: Ints) -> Iterator[None]:
    """Let a MeshError of the body name polygons, as `in_polygons` does."""
    try:
        yield
    except MeshError as error:
        raise MeshError(*in_polygons(error.defects, polygon_of_face)) from error
