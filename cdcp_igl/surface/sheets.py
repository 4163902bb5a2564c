"""The sheets of a surface that is not a manifold, parted and oriented."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, Ints
from ..errors import Defect, MeshError
from .edges import group_by_edge, half_edges
from .report import (
    as_vertices,
    degenerate_faces,
    duplicate_faces,
    face_array,
    face_components,
    faces_to_reverse,
    fans,
    repeated_corners,
    vertex_array,
)
from .triangles import corner_cotangents

__all__ = [
    "Sheets",
    "counted",
    "orient",
    "oriented_sheets",
    "part_sheets",
    "twins",
    "used_positions",
]


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
    rows: Ints
    turned: Ints
    changes: tuple[str, ...]


def oriented_sheets(V: ArrayLike, F: ArrayLike) -> Sheets:
    """Leave out what is no face, part sheets and turn faces over.

    Raises
    ------
    MeshError
        If V and F are no triangle mesh, no face is left, or a component is one-sided.
    """
    positions = used_positions(V, F)
    faces = face_array(F, len(positions))
    rows, changes = proper_faces(positions, faces)
    faces = faces[rows]
    vertices = part_sheets(faces, len(positions))
    split = len(np.unique(vertices)) - len(np.unique(faces))
    if split:
        changes.append(f"split off {counted(split, 'vertex', 'vertices')} where sheets met")
    turned = orient(vertices, int(vertices.max()) + 1)
    if len(turned):
        changes.append(f"reversed {counted(len(turned), 'face', 'faces')}")
    for corners in (faces, vertices):
        corners[turned] = corners[turned, ::-1]
    return Sheets(positions, faces, vertices, rows, turned, tuple(changes))


def counted(number: int, one: str, many: str) -> str:
    """Write out a number of things."""
    return f"{number:,} {one if number == 1 else many}"


def used_positions(V: ArrayLike, F: ArrayLike) -> Floats:
    """V scaled to unit size, rows that no face uses 0; MeshError if the others are not finite."""
    given = vertex_array(V).astype(np.float64)
    unused = np.ones(len(given), dtype=bool)
    unused[face_array(F, len(given))] = False
    given[unused] = 0
    return as_vertices(given)


def proper_faces(V: Floats, F: Ints) -> tuple[Ints, list[str]]:
    """Find the faces that have an area and repeat no other; say which were left out.

    Raises
    ------
    MeshError
        If there are none.
    """
    kept, changes = np.arange(len(F)), []
    for find, why in (
        (repeated_corners, "with a repeated corner"),
        (duplicate_faces, "that repeat another"),
        (lambda faces: degenerate_faces(corner_cotangents(V, faces)), "without area"),
    ):
        bad = find(F[kept])
        if len(bad):
            changes.append(f"left out {counted(len(bad), 'face', 'faces')} {why}")
            kept = np.delete(kept, bad)
    if len(kept) == 0:
        raise MeshError(
            Defect(
                "nothing left",
                "No face has an area",
                "Restore the mesh.",
                "faces",
                np.arange(len(F)),
            )
        )
    return kept, changes


def part_sheets(F: Ints, n: int) -> Ints:
    """Make a manifold of faces: split vertices where fans meet, part edges of several faces.

    Where the faces around an edge of three or more hang together at both its ends, all of
    them but one are parted from everything.

    Parameters
    ----------
    F : (m, 3) int64
        Rows of n vertices, no corner repeated.
    n : int

    Returns
    -------
    (m, 3) int64
        The same faces, their corners numbered anew: corners with the same number are one
        vertex of the manifold.
    """
    m = len(F)
    alone = np.zeros(m, dtype=bool)
    while True:
        one, other, singular = twins(F, n)
        together = ~alone[one % m] & ~alone[other % m]
        count, vertex = fans(F, one[together], other[together])
        F, n, before = np.ascontiguousarray(vertex.reshape(3, m).T.astype(np.int64)), count, n
        if len(singular) == 0 and count == before:
            return F
        if count == before:
            alone[singular % m] = True


def twins(F: Ints, n: int) -> tuple[Ints, Ints, Ints]:
    """Half-edges on either side of each edge of two faces; and all but one of other edges.

    Those of an edge of three or more faces come third, without the first.
    """
    edges = group_by_edge(*half_edges(F, n), n)
    start, valence = edges.start, edges.valence
    two = start[valence == 2]
    first = np.zeros(len(edges.sides), dtype=bool)
    first[start] = True
    surplus = ~first & np.repeat(valence > 2, valence)
    return edges.sides[two], edges.sides[two + 1], edges.sides[surplus]


def orient(F: Ints, n: int) -> Ints:
    """Find the faces of a manifold that are turned over, in each component the fewer.

    Raises
    ------
    MeshError
        If a component is one-sided.
    """
    m, tail = len(F), F.T.ravel()
    one, other, _ = twins(F, n)
    clash = tail[one] == tail[other]
    turned = faces_to_reverse(one % m, other % m, clash, m)
    if turned is not None:
        return turned
    _, part = face_components(one, other, m)
    one_sided = np.zeros(m, dtype=bool)
    for k in np.unique(part[one[clash] % m]):
        inside = part[one % m] == k
        if faces_to_reverse(one[inside] % m, other[inside] % m, clash[inside], m) is None:
            one_sided |= part == k
    raise MeshError(
        Defect(
            "not orientable",
            "The surface is one-sided, like a Möbius strip",
            "Cut it across with cut(V, F, path).",
            "faces",
            np.flatnonzero(one_sided),
        )
    )
