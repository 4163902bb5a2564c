"""Polygonal faces, as files have them, into triangles; and back."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import libigl
from ..arrays import Ints
from ..errors import Defect, MeshError

POLYGONS = ("triangle", "quad", "polygon")  # types of cells, as meshio calls them


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


def triangulated(faces: Any) -> tuple[NDArray[Any], Ints]:
    """Split faces, however they are written, into triangles; and the polygon (m,) of each.

    Rows of corners, of one length or of several; PyVista's flat list, in which the number of
    corners comes before them; or meshio's list of cells by their type, of which only those in
    two dimensions count. What is none of these comes back as it is, to be refused.
    """
    if isinstance(faces, list) and faces and all(hasattr(block, "type") for block in faces):
        flat = [np.asarray(block.data) for block in faces if block.type in POLYGONS]
        flat.append(np.empty((0, 3), np.int64))
        sizes = np.concatenate([np.full(len(rows), rows.shape[1]) for rows in flat])
        return fans(np.concatenate([rows.ravel() for rows in flat]), sizes)
    try:
        rows = np.asarray(faces)
    except ValueError:  # of several lengths
        lists = map(np.atleast_1d, faces)
        rows = np.array([number for row in lists for number in (len(row), *row)])
    if rows.dtype.kind in "iu" and rows.ndim == 2 and rows.shape[1] > 3:
        return fans(rows.ravel(), np.full(len(rows), rows.shape[1]))
    if rows.dtype.kind not in "iu" or rows.ndim != 1:
        return rows, np.arange(len(np.atleast_1d(rows)))
    flat, before = rows.tolist(), [0]
    while before[-1] < len(flat):
        before.append(before[-1] + 1 + abs(flat[before[-1]]))
    if before.pop() != len(flat):
        return rows, np.arange(len(rows))
    return fans(np.delete(rows, before), rows[before])


def strips(vertices: Ints, lengths: Ints) -> Ints:
    """(m, 3) triangles of rows that are strips: each vertex makes one with the two before it.

    A row has several strips if -1 stands between them. Every other triangle of a strip is
    flipped, so that all have one orientation; and those that name a vertex twice, by which a
    strip turns, are left out.
    """
    vertices = np.insert(vertices, np.cumsum(lengths), -1)
    vertices = np.append(vertices, [-1, -1])  # so that a triangle begins with each
    place = np.arange(len(vertices))
    start = np.maximum.accumulate(np.where(vertices == -1, place + 1, 0))
    F = np.lib.stride_tricks.sliding_window_view(vertices, 3).copy()
    odd = (place - start)[:-2] % 2 == 1
    F[odd] = F[odd][:, [1, 0, 2]]
    i, j, k = F.T
    return F[(F >= 0).all(axis=1) & (i != j) & (j != k) & (k != i)]


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
        raise MeshError(*in_polygons(error.defects, polygon_of_face)) from None
