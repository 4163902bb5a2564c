"""Polygonal faces, as files have them, into triangles; and back."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import libigl
from ..arrays import Floats, Ints, as_complex, unit_size
from ..errors import Defect, MeshError
from ..surface.filling import MOST_CORNERS, least_triangulation
from ..surface.triangles import DEGENERATE

BLOCK = 1 << 21  # triangles that are weighed at a time
# What a triangle costs that has no area, or is flipped; cotangents of others are below 1e10.
FLAT, FLIPPED = 1e12, 1e16
# Triangles of a quad by its diagonal from the first corner, or by the other one; and by what part
# that must be better, so that in a grid of rectangles rounding does not decide.
DIAGONALS = np.array([[[0, 1, 2], [0, 2, 3]], [[0, 1, 3], [1, 2, 3]]])
TIE = 1e-9

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


def triangles_of(V: ArrayLike, corners: ArrayLike, sizes: ArrayLike) -> tuple[Ints, Ints]:
    """Split polygons, as of `fans`, into triangles that cover each of them once."""
    rows, polygon = rows_of_triangles(V, corners, sizes)
    return np.array(corners, dtype=np.int64)[rows], polygon


def rows_of_triangles(V: ArrayLike, corners: ArrayLike, sizes: ArrayLike) -> tuple[Ints, Ints]:
    """(m, 3) rows of `corners`, the triangles of `triangles_of`; and the polygon (m,) of each.

    They are Delaunay's in the plane of each polygon, so that the surface does not depend on which
    corner comes first; a rectangle is cut from its corner of least coordinates. Polygons without
    area, or whose corners are no vertices or have no coordinates, stay fans, to be refused as
    such triangles are.
    """
    vertex, size = np.array(corners, dtype=np.int64), np.array(sizes, dtype=np.int64)
    F, polygon = fans(np.arange(len(vertex)), size)
    if size.max(initial=3) == 3 or len(points := _positions(V)) == 0:
        return F, polygon
    start, first = np.cumsum(size) - size, np.cumsum(size - 2) - (size - 2)
    P = points.take(vertex, axis=0, mode="clip")
    P[(vertex < 0) | (vertex >= len(points))] = np.nan
    for k in np.unique(size[size > 3]).tolist():
        these = np.flatnonzero(size == k)
        for some in np.array_split(these, 1 + len(these) * k**3 // BLOCK):
            rows = start[some, None] + np.arange(k)
            anew = abs(_normals(P[rows])).max(axis=1) > 0  # and a number
            if anew.any():
                triangles = np.take_along_axis(rows[anew, None], _triangulation(P[rows[anew]]), 2)
                F[first[some[anew], None] + np.arange(k - 2)] = triangles
    return F, polygon


def _positions(V: ArrayLike) -> Floats:
    """(n, 3) positions of unit size, NaN where they are not finite; none if V is no such array."""
    try:
        given = np.asarray(V)
        finite = np.isfinite(given).all(axis=1)
        return np.where(finite[:, None], unit_size(given), np.nan)
    except (TypeError, ValueError, IndexError):
        return np.empty((0, 3))


def _normals(P: Floats) -> Floats:
    """(p, 3) unit normals of polygons (p, k, 3) by Newell, of vector areas; 0 without area."""
    arms = P - P[:, :1]
    areas = np.cross(arms[:, 1:-1], arms[:, 2:]).sum(axis=1)
    size = np.linalg.norm(areas, axis=1, keepdims=True)
    flat = size <= DEGENERATE * np.einsum("pkx,pkx->p", arms, arms)[:, None]
    return np.where(flat, 0, areas / np.where(flat, 1, size))


def _cotangents(normals: Floats, *corners: Floats) -> Floats:
    """Sum the cotangents of triangles with corners (p, ..., 3), seen along the normals (p, 3).

    Of all triangulations that cover a plane polygon, Delaunay's has the least sum: O. R. Musin,
    Properties of the Delaunay triangulation. Symposium on Computational Geometry, 1997.
    """
    i, j, k = corners
    u, v = j - i, k - i
    squared = [np.einsum("...x,...x->...", edge, edge) for edge in (u, v, v - u)]
    area = np.einsum("p...x,px->p...", np.cross(u, v), normals)
    flat = abs(area) <= 2 * DEGENERATE * np.maximum(np.maximum(*squared[:2]), squared[2])
    with np.errstate(divide="ignore", invalid="ignore"):
        cotangents = sum(squared) / (2 * area)
    return np.where(flat, FLAT, np.where(area < 0, FLIPPED, cotangents))


def _triangulation(P: Floats) -> Ints:
    """(p, k - 2, 3) corners of Delaunay's triangles of polygons (p, k, 3), each in its plane."""
    p, k = P.shape[:2]
    # From here on all begin with the corner of least coordinates, whichever was the first.
    turned = (_least_corner(P)[:, None] + np.arange(k)) % k
    P = np.take_along_axis(P, turned[..., None], 1)
    normals, ears = _normals(P), np.empty((p, 0, 3), np.int64)
    if k == 4:
        costs = _cotangents(normals, *P[:, DIAGONALS].transpose(3, 0, 1, 2, 4)).sum(axis=2)
        other = costs[:, 1] < (1 - TIE) * costs[:, 0]
        return DIAGONALS[(turned[:, 0] + other) % 2]
    if k > MOST_CORNERS:
        ears, left = map(np.stack, zip(*map(_without_ears, P, normals), strict=True))
    else:
        left = np.tile(np.arange(k), (p, 1))
    inner = least_triangulation(
        np.take_along_axis(P, left[..., None], 1), lambda *at: _cotangents(normals, *at)
    )
    triangles = np.concatenate([ears, np.take_along_axis(left[:, None], inner, 2)], axis=1)
    return np.take_along_axis(turned[:, None], triangles, 2)


def _least_corner(P: Floats) -> Ints:
    """(p,) which corners of polygons (p, k, 3) come first by x, y, z; then by the next corners."""
    least = np.ones(P.shape[:2], dtype=bool)
    for following, axis in np.ndindex(P.shape[1:]):
        value = np.where(least, np.roll(P[..., axis], -following, axis=1), np.inf)
        least &= value == value.min(axis=1, keepdims=True)
        if np.count_nonzero(least) == len(P):
            break
    return least.argmax(axis=1)


def _without_ears(P: Floats, normal: Floats) -> tuple[Ints, Ints]:
    """Cut off the best ears of a polygon (k, 3): these (j, 3), and the corners that are left.

    What is left, MOST_CORNERS, has the best triangulation in a time that is the cube.
    """
    right = np.linalg.svd(normal[None])[2][1]
    z = as_complex(P @ np.column_stack([right, np.cross(normal, right)]))
    left, ears = np.arange(len(z)), []
    nearly = DEGENERATE * np.ptp(P, axis=0).max() ** 2

    def weight(at: int) -> float:
        tip = left[[at - 1, at, (at + 1) % len(left)]]
        corners = z[tip]
        sides = np.roll(corners, -1) - corners
        others = z[left]
        height = (sides[:, None].conj() * (others - corners[:, None])).imag
        inside = (height >= -nearly).all(axis=0) & ~np.isin(others, corners)
        return _cotangents(normal[None], *P[tip][:, None])[0] + FLIPPED * inside.any()

    weights = np.array([weight(at) for at in range(len(z))])
    while len(left) > MOST_CORNERS:
        at = int(weights.argmin())
        ears.append(left[[at - 1, at, (at + 1) % len(left)]])
        left, weights = np.delete(left, at), np.delete(weights, at)
        for near in (at - 1, at % len(left)):
            weights[near] = weight(near)
    return np.array(ears), left


def triangulated(V: Any, faces: Any) -> tuple[NDArray[Any], Ints]:
    """Split faces, however they are written, into triangles; and the polygon (m,) of each.

    Rows of corners, of one length or of several; PyVista's flat list, in which the number of
    corners comes before them; or meshio's list of cells by their type, of which only those in
    two dimensions count. What is none of these comes back as it is, to be refused.
    """
    if isinstance(faces, list) and faces and all(hasattr(block, "type") for block in faces):
        flat = [np.asarray(block.data) for block in faces if block.type in POLYGONS]
        flat.append(np.empty((0, 3), np.int64))
        sizes = np.concatenate([np.full(len(rows), rows.shape[1]) for rows in flat])
        return triangles_of(V, np.concatenate([rows.ravel() for rows in flat]), sizes)
    try:
        rows = np.asarray(faces)
    except ValueError:  # of several lengths
        lists = map(np.atleast_1d, faces)
        rows = np.array([number for row in lists for number in (len(row), *row)])
    if rows.dtype.kind in "iu" and rows.ndim == 2 and rows.shape[1] > 3:
        return triangles_of(V, rows.ravel(), np.full(len(rows), rows.shape[1]))
    if rows.dtype.kind not in "iu" or rows.ndim != 1:
        return rows, np.arange(len(np.atleast_1d(rows)))
    flat, before = rows.tolist(), [0]
    while before[-1] < len(flat):
        before.append(before[-1] + 1 + abs(flat[before[-1]]))
    if before.pop() != len(flat):
        return rows, np.arange(len(rows))
    return triangles_of(V, np.delete(rows, before), rows[before])


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
