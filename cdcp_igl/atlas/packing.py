"""Charts laid side by side into the unit square."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from ..arrays import Complex, Floats, coordinates, evenly_spaced_rows

# Several boxes are apart by this share of the side of the square: two texels of 1,024.
GAP = 2 / 1024
# So many widths of the rows are tried at most.
MOST_WIDTHS = 200


def packed_boxes(sizes: Floats) -> tuple[Floats, float]:
    """Lower left corners (k, 2) of disjoint boxes in the unit square, and their common scale.

    `sizes` (k, 2) are widths and heights. In rows, the highest first; as large as the width of the
    rows lets them be.
    """
    if len(sizes) == 1:
        return np.zeros((1, 2)), 1 / sizes.max()
    gap = GAP * _best_rows(sizes)[1]
    corners, side = _best_rows(sizes + gap)
    return (corners + gap / 2) / side, 1 / side


def _best_rows(sizes: Floats) -> tuple[Floats, float]:
    """Lower left corners (k, 2) of boxes in rows, and the side of the square that they need."""
    order = np.argsort(-sizes[:, 1], kind="stable")
    width, height = sizes[order].T
    most = 2 * np.sqrt((width * height).sum()) + width.max()
    widths = np.unique(np.clip(np.cumsum(width), width.max(), most))
    widths = widths[evenly_spaced_rows(len(widths), MOST_WIDTHS)]
    boxes = sizes[order].tolist()  # plain numbers, as one after the other is looked at
    rows = (_rows(boxes, limit) for limit in widths.tolist())
    placed, side = min(rows, key=lambda row: row[1])
    corners = np.empty_like(sizes)
    corners[order] = placed
    return corners, side


def _rows(boxes: list[list[float]], limit: float) -> tuple[list[tuple[float, float]], float]:
    """Lower left corners of boxes laid in rows of at most a given width, and the larger side."""
    corners = []
    left = bottom = right = 0.0
    top = boxes[0][1]
    most = limit * (1 + 1e-12)
    for width, height in boxes:
        if left and left + width > most:
            left, bottom, top = 0.0, top, top + height
        corners.append((left, bottom))
        left += width
        right = max(right, left)
    return corners, max(right, top)


def laid_flat(z: Complex) -> complex:
    """Return the number of modulus 1 that turns points so that their smallest box lies flat.

    One side of the smallest rectangle around points lies along their convex hull.
    """
    try:
        hull = z[ConvexHull(coordinates(z)).vertices]
    except QhullError:  # they lie on a line
        return 1
    edges = np.roll(hull, -1) - hull
    turns = abs(edges) / edges
    turned = turns[:, None] * hull
    width, height = np.ptp(turned.real, axis=1), np.ptp(turned.imag, axis=1)
    best = int((width * height).argmin())
    return complex(turns[best] * (1 if width[best] >= height[best] else 1j))
