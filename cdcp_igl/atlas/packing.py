"""Disks laid side by side into the unit square."""

from __future__ import annotations

import numpy as np

from ..arrays import Floats, evenly_spaced_rows

# Circles are this share smaller than those that would touch, lest rounding make them overlap.
GAP = 1e-6
# So many widths of the rows are tried at most.
MOST_WIDTHS = 200


def packed_circles(radii: Floats) -> tuple[Floats, Floats]:
    """Centres (k, 2) and radii (k,) of disjoint circles in the unit square, in proportion.

    In rows, the largest first; as large as the width of the rows lets them be.
    """
    order = np.argsort(-radii, kind="stable")
    sides = 2 * radii[order]
    widths = np.unique(
        np.clip(np.cumsum(sides), sides[0], 2 * np.sqrt((sides**2).sum()) + sides[0])
    )
    widths = widths[evenly_spaced_rows(len(widths), MOST_WIDTHS)]
    best = min(widths, key=lambda width: max(width, _rows(sides, width)[-1].max()))
    x, y, height = _rows(sides, best)
    scale = 1 / max(best, height.max())
    centers = np.empty((len(radii), 2))
    centers[order] = np.column_stack([x, y]) * scale
    return centers, radii * scale * (1 - GAP)


def _rows(sides: Floats, width: float) -> tuple[Floats, Floats, Floats]:
    """Centres of squares laid in rows of at most a given width, and the upper edges."""
    x, y = np.empty(len(sides)), np.empty(len(sides))
    left = bottom = 0.0
    height = sides[0]
    for k, side in enumerate(sides.tolist()):
        if left and left + side > width * (1 + 1e-12):
            left, bottom, height = 0.0, bottom + height, side
        x[k], y[k] = left + side / 2, bottom + side / 2
        left += side
    return x, y, y + sides / 2
