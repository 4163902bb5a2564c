"""The sheets of a surface that is not a manifold, parted and oriented."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import breadth_first_order

from ..arrays import Bools, Floats, Ints, distinct_rows, marked, size_exponent
from ..errors import Defect, MeshError, counted
from ..surface.checking import hint, near_pairs
from ..surface.sheets import fans_of_sheets
from ..surface.topology import Topology, components_of_pairs, duplicate_faces, sewn
from ..surface.triangles import corner_cotangents, degenerate_faces
from ..surface.validation import checked_vertices, repeated_corners, without_data


@dataclass(frozen=True, eq=False)
class Sheets:
    """A surface as an oriented manifold."""

    V: Floats  # (n, 3) the given positions, scaled to unit size
    F: Ints  # (k, 3) faces, rows of V, oriented
    vertices: Ints  # (k, 3) corners with the same number are one vertex of the manifold
    polygon: Ints  # (k,) number of the polygon that each face is a part of
    rows: Ints  # (k,) the rows of the given F that the faces come from
    flipped: Ints  # the rows of this F whose corners are reversed
    given: Ints  # (m, 3) the given F, with equal vertices merged
    changes: tuple[str, ...]  # what was done, a sentence each


def oriented_sheets(
    V: NDArray[Any], F: Ints, polygon_of_face: ArrayLike | None, merge: bool
) -> Sheets:
    """Sew seams, leave out what is no face, part sheets and reverse corners of flipped faces.

    MeshError if a corner of a face is not finite, or no face is left;
    ValueError if `polygon_of_face` does not number the polygons of the faces.
    """
    positions = used_positions(V, F)
    polygon = polygon_numbers(polygon_of_face, len(F))
    missing, place = without_data(V, F)
    measured = np.flatnonzero(~np.isin(F, missing).any(axis=1))
    given = F.copy()
    given[measured], n_merged = sewn(positions, F[measured]) if merge else (F[measured], 0)
    F = given
    near = near_pairs(positions, Topology(F[measured], len(V)).edges, size_exponent(V))
    rows, changes = _proper_faces(positions, F, measured)
    if len(measured) < len(F):
        left_out = counted(len(F) - len(measured), "face", "faces")
        changes.insert(0, f"left out {left_out} at points without data, at {place}")
    if n_merged:
        merged = f"merged {counted(n_merged, 'vertex', 'vertices')} with an equal one"
        changes.insert(0, merged)
    faces, polygon = F[rows], polygon[rows]
    vertices = part_sheets(positions, faces)
    n_copies = len(np.unique(vertices)) - len(np.unique(faces))
    if n_copies > 0:
        changes.append(f"split off {counted(n_copies, 'vertex', 'vertices')} where sheets met")
    vertices, n_cut = two_sided(vertices)
    if n_cut:
        changes.append(f"cut one-sided parts open along {counted(n_cut, 'edge', 'edges')}")
    flipped = orient(vertices, rows)
    if len(flipped):
        changes.append(f"reversed {counted(len(flipped), 'face', 'faces')}")
    if near[0]:
        changes.append(hint(*near))
    for corners in (faces, vertices):
        corners[flipped] = corners[flipped, ::-1]
    return Sheets(positions, faces, vertices, polygon, rows, flipped, F, tuple(changes))


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


def used_positions(V: NDArray[Any], F: Ints) -> Floats:
    """V scaled to unit size, rows that no face uses 0; MeshError if the others are not finite."""
    return checked_vertices(np.where(marked(len(V), F)[:, None], V, 0))


def _proper_faces(V: Floats, F: Ints, kept: Ints) -> tuple[Ints, list[str]]:
    """Find those of some faces that have an area and repeat no other; say which were left out."""
    changes = list[str]()
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
        done = f"cdcp_igl.surface_map {', '.join(changes)}"
        raise MeshError(Defect.of("nothing left", done=done))
    return kept, changes


def part_sheets(V: Floats, F: Ints) -> Ints:
    """(m, 3) numbers of the corners: those with the same are one vertex of a manifold."""
    _, fan = fans_of_sheets(V, F)
    return np.ascontiguousarray(fan.reshape(3, -1).T, dtype=np.int64)


def two_sided(F: Ints) -> tuple[Ints, int]:
    """Cut one-sided components of a manifold where their orientation turns over.

    The faces (m, 3), and how many edges were cut. Orientation goes from face to face, from the
    first of each component to the nearest ones first.
    """
    surface = Topology(F, int(F.max()) + 1)
    if surface.misoriented is not None:
        return F, 0
    (one, other), m = (sides.astype(np.int64) for sides in surface.twins), len(F)
    tail = F.T.ravel()
    aligned = tail[one] == tail[other]
    graph = coo_matrix((1.0 + aligned, (one % m, other % m)), (m, m)).tocsr()
    graph = graph.maximum(graph.T)
    _, part = surface.components
    before = np.full(m, -1)
    for root in np.unique(part, return_index=True)[1]:
        reached, way = breadth_first_order(graph, root, directed=False)
        before[reached[1:]] = way[reached[1:]]
    face = np.flatnonzero(before >= 0)
    turned = np.asarray(graph[before[face], face]).ravel() > 1
    _, side = components_of_pairs(
        np.concatenate([face, face + m]),
        np.concatenate([before[face] + m * turned, before[face] + m * ~turned]),
        2 * m,
    )
    flipped = side[:m] > side[m:]
    joined = (flipped[one % m] ^ flipped[other % m]) == aligned
    return surface.vertices_across(one[joined], other[joined]), int((~joined).sum())


def orient(F: Ints, named: Ints) -> Ints:
    """Find the faces of a manifold that are flipped, in each component the fewer.

    MeshError if a component is one-sided; it says `named` (m,) instead of the rows of F.
    """
    surface = Topology(F, int(F.max()) + 1)
    if surface.misoriented is not None:
        return surface.misoriented
    _, component = surface.components
    one_sided = [
        rows
        for rows in (np.flatnonzero(component == k) for k in range(int(component.max()) + 1))
        if Topology(F[rows], surface.n).misoriented is None
    ]
    rows = np.sort(named[np.concatenate(one_sided)])
    raise MeshError(Defect.of("not orientable", rows))


def fill_left_out(F: Ints, mapped: Bools, corners: Ints, uv: Floats) -> None:
    """Give faces that are not mapped the corners (m, 3) and images of faces that are, in place.

    A duplicate has all those of its twin. Another face, which would lie across what is mapped, has
    all its images where some mapped face has its first corner; they are NaN if one of
    its corners is at no mapped face.
    """
    left_out = np.flatnonzero(~mapped)
    if len(left_out) == 0:
        return
    some = np.full(F.max() + 1, -1)
    some[F[mapped]] = 3 * np.flatnonzero(mapped)[:, None] + np.arange(3)
    source = some[F[left_out]]  # place in the rows of F, one after the other
    row, first = np.arange(len(left_out)), (source >= 0).argmax(axis=1)
    place = source[row, first]
    twin = _twins(F, mapped)[left_out]
    same = np.equal(F[left_out][:, :, None], F[twin][:, None, :])
    of_twin = 3 * twin[:, None] + same.argmax(axis=2)
    known: Bools = source.min(axis=1) >= 0
    has_twin: Bools = twin >= 0
    images = np.where(has_twin[:, None], of_twin, place[:, None])
    uv[left_out] = np.where(known[:, None, None], uv.reshape(-1, 2)[images], np.nan)
    corners[left_out[has_twin]] = corners.ravel()[of_twin[has_twin]]
    one = known & ~has_twin
    corners[left_out[one], first[one]] = corners.ravel()[place[one]]


def _twins(F: Ints, mapped: Bools) -> Ints:
    """(m,) a mapped face with the same three vertices as each face; -1 where there is none."""
    _, group = distinct_rows(np.sort(F, axis=1))
    twin = np.full(len(F), -1)
    twin[group[mapped]] = np.flatnonzero(mapped)
    return twin[group]
