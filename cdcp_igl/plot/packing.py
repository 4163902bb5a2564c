"""Arrays of integers as text that a browser can unpack."""

from __future__ import annotations

import gzip
from base64 import b64encode
from collections.abc import Mapping

import numpy as np

from ..arrays import Floats, Ints, as_complex
from ..surface.location import z_order

__all__ = ["ordered", "pack", "quantized"]

STEPS = 2**16 - 1  # of a coordinate


def quantized(x: Floats, low: float, high: float, steps: int = STEPS) -> Ints:
    """(n,) whole steps of x from `low`, which is 0, to `high`; the ends for all beyond, and NaN."""
    share = (x - low) / (high - low if high > low else 1)
    return np.rint(steps * np.clip(np.nan_to_num(share, nan=0.0), 0, 1)).astype(np.int64)


def pack(arrays: Mapping[str, Ints]) -> str:
    """Base64 of the arrays, one after the other: differences, sign last, by planes of bytes.

    Differences of neighbours are small, so that the upper planes are nearly empty.
    """
    differences = np.concatenate([np.diff(array, prepend=0) for array in arrays.values()])
    numbers = ((differences << 1) ^ (differences >> 63)).astype("<u4")
    planes = numbers.view(np.uint8).reshape(-1, 4).T.tobytes()
    # No time stamp, so that equal input gives equal files.
    return b64encode(gzip.compress(planes, 6, mtime=0)).decode()


def ordered(uv: Floats, F: Ints) -> tuple[Ints, Ints]:
    """Orders of the vertices and of the faces in which neighbours follow one another.

    Parameters
    ----------
    uv : (n, 2) float64
    F : (m, 3) int64

    Returns
    -------
    vertices : (n,) int64
        Along a Z-shaped curve in the plane.
    faces : (m,) int64
        By their vertices in this order.
    """
    vertices = z_order(as_complex(uv))
    rank = np.empty(len(uv), dtype=np.int64)
    rank[vertices] = np.arange(len(uv))
    return vertices, np.lexsort(np.sort(rank[F], axis=1).T[::-1])
