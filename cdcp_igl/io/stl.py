"""Stereolithography files, stl: triangles that share no vertices."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .. import libigl
from ..arrays import Floats, Ints

__all__ = ["merge_duplicates", "read_stl"]


def read_stl(path: Path) -> tuple[Floats, Ints]:
    """(n, 3) vertices and (m, 3) faces, vertices in equal places merged."""
    try:
        V, F = libigl.read_stl(path)
    except RuntimeError as error:
        raise ValueError(f"libigl: {error}") from error
    return merge_duplicates(V, F)


def merge_duplicates(V: Floats, F: Ints) -> tuple[Floats, Ints]:
    """Merge vertices with exactly equal coordinates, in order of first appearance."""
    order = np.lexsort(V.T)
    leads = np.ones(len(V), dtype=bool)
    leads[1:] = (V[order[1:]] != V[order[:-1]]).any(axis=1)
    # The sort is stable: the first of a group is its first appearance.
    first = np.empty(len(V), dtype=np.int64)
    first[order] = order[leads][np.cumsum(leads) - 1]
    kept = first == np.arange(len(V))
    return V[kept], (np.cumsum(kept) - 1)[first[F]]
