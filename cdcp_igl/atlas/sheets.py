"""The sheets of a surface that is not a manifold, parted and oriented."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Bools, Floats, Ints
from ..errors import Defect, MeshError, counted
from ..surface.defects import degenerate_faces, one_sided_defect
from ..surface.topology import Topology, duplicate_faces
from ..surface.triangles import corner_cotangents
from ..surface.validation import (
    face_array,
    non_finite_defect,
    refuse_swapped,
    repeated_corners,
    unit_size,
    vertex_array,
)


@dataclass(frozen=True, eq=False)
class Sheets:
    """A surface as an oriented manifold.

    Attributes
    ----------
    V : (n, 3) float64
        The given positions, scaled to unit size.
    F : (k, 3) int64
        Faces, rows of V, oriented.
    vertices : (k, 3) int64
        Numbers of their corners: corners with the same number are one vertex of the manifold.
    polygon : (k,) int64
        Number of the polygon that each face is a part of.
    rows : (k,) int64
        The rows of the given F that they come from.
    turned : (t,) int64
        Rows of this F whose corners are reversed.
    changes : tuple of str
        What was done, a sentence each.
    """

    V: Floats
    F: Ints
    vertices: Ints
    polygon: Ints
    rows: Ints
    turned: Ints
    changes: tuple[str, ...]


def oriented_sheets(V: ArrayLike, F: ArrayLike, polygon_of_face: ArrayLike | None = None) -> Sheets:
    """Leave out what is no face, part sheets and turn faces over.

    Raises
    ------
    MeshError
        If V and F are no triangle mesh, no face is left, or a component is one-sided.
    ValueError
        If `polygon_of_face` does not number the polygons of the faces.
    """
    positions = used_positions(V, F)
    faces = face_array(F, len(positions))
    polygon = polygon_numbers(polygon_of_face, len(faces))
    rows, changes = _proper_faces(positions, faces)
    faces, polygon = faces[rows], polygon[rows]
    vertices = part_sheets(faces, len(positions), polygon)
    copies = np.arange(len(np.unique(faces)), len(np.unique(vertices)))
    if len(copies):
        changes.append(f"split off {counted(len(copies), 'vertex', 'vertices')} where sheets met")
    turned = orient(vertices, rows)
    if len(turned):
        changes.append(f"reversed {counted(len(turned), 'face', 'faces')}")
    for corners in (faces, vertices):
        corners[turned] = corners[turned, ::-1]
    return Sheets(positions, faces, vertices, polygon, rows, turned, tuple(changes))


def polygon_numbers(polygon_of_face: ArrayLike | None, m: int) -> Ints:
    """(m,) numbers of the polygons from 0; without `polygon_of_face`, each face is one."""
    if polygon_of_face is None:
        return np.arange(m)
    given = np.asarray(polygon_of_face)
    if given.dtype.kind not in "iu" or given.shape != (m,):
        raise ValueError(
            f"polygon_of_face must say of each of {m:,} faces, by an integer, which polygon it is "
            f"a part of; it has shape {given.shape} and type {given.dtype}"
        )
    return np.unique(given, return_inverse=True)[1].astype(np.int64)


def used_positions(V: ArrayLike, F: ArrayLike) -> Floats:
    """V scaled to unit size, rows that no face uses 0; MeshError if the others are not finite."""
    refuse_swapped(V, F)
    given = vertex_array(V).astype(np.float64)
    unused = np.ones(len(given), dtype=bool)
    unused[face_array(F, len(given))] = False
    given[unused] = 0
    if defect := non_finite_defect(given):
        raise MeshError(defect)
    return unit_size(given)


def _proper_faces(V: Floats, F: Ints) -> tuple[Ints, list[str]]:
    """Find the faces that have an area and repeat no other; say which were left out."""
    kept, changes = np.arange(len(F)), []
    for find, why in (
        (repeated_corners, "with a repeated corner"),
        (duplicate_faces, "that repeated another"),
        (lambda faces: degenerate_faces(corner_cotangents(V, faces)), "without area"),
    ):
        bad = find(F[kept])
        if len(bad):
            changes.append(f"left out {counted(len(bad), 'face', 'faces')} {why}")
            kept = np.delete(kept, bad)
    if len(kept) == 0:
        what = f"cdcp_igl.surface_map {', '.join(changes)}, and no face is left"
        raise MeshError(Defect("nothing left", what, "Restore the mesh."))
    return kept, changes


def part_sheets(F: Ints, n: int, polygon: Ints) -> Ints:
    """Make a manifold of faces: split vertices where fans meet, part edges of several faces.

    Where the faces around an edge of three or more hang together at both its ends, all of
    them but one are parted from everything, each with the other faces of its polygon.

    Parameters
    ----------
    F : (m, 3) int64
        Rows of n vertices, no corner repeated.
    n : int
    polygon : (m,) int64
        Number of the polygon that each face is a part of.

    Returns
    -------
    (m, 3) int64
        The same faces, their corners numbered anew: corners with the same number are one
        vertex of the manifold.
    """
    while True:
        surface = Topology(F, n)
        count, fan = surface.fans
        F = np.ascontiguousarray(fan.reshape(3, -1).T, dtype=np.int64)
        if count == int(surface.used.sum()):  # nothing was split
            if not surface.singular.any():
                return F
            first = np.zeros(F.size, dtype=bool)
            first[surface.edges.start] = True
            surplus = ~first & np.repeat(surface.singular, surface.edges.valence)
            polygon = _without_folds(surface, polygon)
            alone = np.isin(polygon, polygon[surface.edges.sides[surplus] % len(F)])
            corners = polygon[alone][:, None] * count + F[alone]
            F[alone] = count + np.unique(corners, return_inverse=True)[1].reshape(-1, 3)
        n = int(F.max()) + 1


def _without_folds(surface: Topology, polygon: Ints) -> Ints:
    """Take polygons apart into faces where three or more of these meet in the same edge."""
    edge = np.repeat(np.arange(len(surface.edges.start)), surface.edges.valence)
    at_edge = edge * (polygon.max() + 1) + polygon[surface.edges.sides % len(surface.F)]
    pairs, count = np.unique(at_edge, return_counts=True)
    folded = np.isin(polygon, pairs[count > 2] % (polygon.max() + 1))
    return np.where(folded, polygon.max() + 1 + np.arange(len(polygon)), polygon)


def orient(F: Ints, named: Ints) -> Ints:
    """Find the faces of a manifold that are turned over, in each component the fewer.

    `named` (m,) are the rows that an error says instead of those of F.

    Raises
    ------
    MeshError
        If a component is one-sided.
    """
    surface = Topology(F, int(F.max()) + 1)
    if surface.against is not None:
        return surface.against
    _, part = surface.components
    one_sided = [
        rows
        for rows in (np.flatnonzero(part == k) for k in range(int(part.max()) + 1))
        if Topology(F[rows], surface.n).against is None
    ]
    raise MeshError(one_sided_defect(np.sort(named[np.concatenate(one_sided)])))


def fill_left_out(F: Ints, mapped: Bools, corners: Ints, uv: Floats) -> None:
    """Give faces that are not mapped the corners (m, 3) and images of faces that are, in place.

    A duplicate has all those of its twin; of another face, each corner is that of some face there.
    Along a cut these may be on either side. Where no mapped face is, images are NaN.
    """
    left_out = np.flatnonzero(~mapped)
    if len(left_out) == 0:
        return
    some = np.full(F.max() + 1, -1)
    some[F[mapped]] = 3 * np.flatnonzero(mapped)[:, None] + np.arange(3)
    source = some[F[left_out]]  # place in the rows of F, one after the other
    twin = _twins(F, mapped)[left_out]
    of_twin = np.flatnonzero(twin >= 0)
    for k in range(3):
        at = (F[twin[of_twin]] == F[left_out[of_twin], k : k + 1]).argmax(axis=1)
        source[of_twin, k] = 3 * twin[of_twin] + at
    known = source >= 0
    corners[left_out] = np.where(known, corners.ravel()[source], corners[left_out])
    uv[left_out] = np.where(known[..., None], uv.reshape(-1, 2)[source], np.nan)


def _twins(F: Ints, mapped: Bools) -> Ints:
    """(m,) a mapped face with the same three vertices as each face; -1 where there is none."""
    _, group = np.unique(np.sort(F, axis=1), axis=0, return_inverse=True)
    group, twin = group.ravel(), np.full(len(F), -1)
    twin[group[mapped]] = np.flatnonzero(mapped)
    return twin[group]
