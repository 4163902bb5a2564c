"""Seams of one's own: edges that are to be cut, and edges that must not be."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Bools, Ints, distinct_rows, rows_not_in
from ..errors import Defect, MeshError, counted
from ..surface.topology import Topology
from .sheets import Sheets

NAMES = ("uv", "keep")

Seams = str | NDArray[Any]


def checked_seams(given: ArrayLike | str) -> Seams:
    """Return a name, edges (k, 2) or texture coordinates (m, 3, 2); else ValueError."""
    if isinstance(given, str):
        if given not in NAMES:
            raise ValueError(
                f'seams must be "uv", "keep", edges (k, 2) or coordinates (m, 3, 2), not {given!r}'
            )
        return given
    array = _array_of(given)
    is_texture = array.ndim == 3 and array.shape[1:] == (3, 2) and array.dtype.kind in "iuf"
    return array if is_texture else checked_edges("seams", given)


def checked_edges(name: str, given: ArrayLike) -> Ints:
    """(k, 2) edges by their vertices, the smaller first; ValueError if they are none."""
    pairs = _array_of(given)
    if pairs.shape == (0,):  # an empty list, which numpy takes for one of floats
        pairs = np.empty((0, 2), np.int64)
    if pairs.dtype.kind not in "iu" or pairs.shape[1:] != (2,):
        raise ValueError(
            f"{name} must be edges (k, 2), each by its two rows of V, integers; "
            f"it has shape {pairs.shape} and type {pairs.dtype}"
        )
    return np.sort(pairs.astype(np.int64), axis=1)


def _array_of(given: ArrayLike) -> NDArray[Any]:
    try:
        return np.asarray(given)
    except ValueError:  # ragged
        return np.array(None)


def wanted_edges(sheets: Sheets, F: Ints, seams: Seams, forbidden: Ints) -> tuple[Ints, Ints]:
    """(k, 2) edges to be cut, and (l, 2) those not to be cut, by the vertices of `Sheets.given`.

    `F` are the faces before vertices were merged. MeshError if a pair is no edge, ValueError if one
    is to be cut and not to be cut.
    """
    barred = _edges_of("forbidden", sheets, F, forbidden)
    if isinstance(seams, str):
        if seams == "uv":
            raise ValueError('seams="uv" are those of a file: give its path in place of V and F')
        cut = _between_unlike(sheets, F)
    elif seams.ndim == 3:
        if len(seams) != len(F):
            raise ValueError(f"seams are coordinates of {len(seams):,} faces; F has {len(F):,}")
        images = np.where(np.isfinite(seams), seams, np.inf).reshape(-1, 2)
        cut = _between_unlike(sheets, distinct_rows(images)[1].reshape(F.shape))
    else:
        cut = _edges_of("seams", sheets, F, seams)
    if n_both := len(cut) - len(rows_not_in(barred, cut)):
        edges = counted(n_both, "edge is", "edges are")
        raise ValueError(f"{edges} in seams and in forbidden: leave them out of one of these")
    return cut, barred


def _edges_of(name: str, sheets: Sheets, F: Ints, pairs: Ints) -> Ints:
    """(k, 2) the edges that pairs of rows of V name."""
    if len(pairs) == 0:  # as a rule: no edge need be looked for
        return pairs
    edges = Topology(F, len(sheets.V)).edges
    missing = rows_not_in(edges.ends(edges.valence > 0), pairs)
    if len(missing):
        given = {"missing": len(missing), "pairs": len(pairs), "name": name}
        raise MeshError(Defect.of("not an edge, but a pair", missing, **given))
    first = np.arange(len(sheets.V))
    first[F] = sheets.given
    return np.sort(first[pairs], axis=1)


def _between_unlike(sheets: Sheets, label: Ints) -> Ints:
    """(k, 2) edges whose faces have other labels (m, 3) at one of its ends."""
    F, label = sheets.given[sheets.rows], label[sheets.rows]
    ends = np.stack([F, np.roll(F, -1, axis=1)], axis=-1).reshape(-1, 2)
    labels = np.stack([label, np.roll(label, -1, axis=1)], axis=-1).reshape(-1, 2)
    order = np.argsort(ends, axis=1)
    ends, labels = (np.take_along_axis(each, order, axis=1) for each in (ends, labels))
    sides, _ = distinct_rows(np.hstack([ends, labels]))
    first, edge = distinct_rows(ends[sides])
    return ends[sides][first][np.bincount(edge) > 1]


def among_edges(F: Ints, edges: Ints) -> Bools:
    """(m, 3) whether the edge that leaves each corner for the next is one of some edges (k, 2)."""
    if len(edges) == 0:
        return np.zeros(F.shape, dtype=bool)
    n = int(max(F.max(), edges.max())) + 1
    low, high = np.sort(np.stack([F, np.roll(F, -1, axis=1)]), axis=0)
    return np.isin(low * n + high, edges[:, 0] * n + edges[:, 1])


def cut_at(F: Ints, is_seam: Bools) -> Ints:
    """(m, 3) numbers of the vertices of a surface cut at some of the edges that leave corners."""
    surface = Topology(F, int(F.max()) + 1)
    one, other = surface.twins
    joined = ~is_seam.T.ravel()[one]
    return surface.vertices_across(one[joined], other[joined])
