"""Corners of faces that are on no disk: duplicates, and faces without area."""

from __future__ import annotations

import numpy as np

from ..arrays import Bools, Floats, Ints

__all__ = ["fill_left_out"]


def fill_left_out(F: Ints, mapped: Bools, corners: Ints, uv: Floats) -> None:
    """Give faces that are not mapped the corners of faces that are, in place.

    A duplicate has all those of its twin; of another face, each corner is that of some face there.
    Along a cut these may be on either side.

    Parameters
    ----------
    F : (m, 3) int64
    mapped : (m,) bool
    corners : (m, 3) int64
        Vertices of the opened surface; stay as they are where no mapped face is.
    uv : (m, 3, 2) float64
        Their images; NaN where no mapped face is.
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
