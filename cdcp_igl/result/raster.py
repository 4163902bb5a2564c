"""Images of the square around the disk."""

from __future__ import annotations

import numpy as np

from ..arrays import Complex, Floats

__all__ = ["bilinear", "pixel_centers"]


def pixel_centers(size: int) -> Complex:
    """(size * size,) centres of the pixels of the square from -1 to 1, row by row, top first."""
    x = (2 * np.arange(size) + 1) / size - 1
    return (x[None, :] - 1j * x[:, None]).ravel()


def bilinear(image: Floats, z: Complex) -> Floats:
    """Read an image of the square from -1 to 1 between its pixel centres.

    Parameters
    ----------
    image : (height, width, ...) float64
        The top row lies at v = 1.
    z : (k,) complex128
        In the square; between its rim and the outermost centres, these count.

    Returns
    -------
    (k, ...) float64
    """
    height, width = image.shape[:2]
    row = np.clip((1 - z.imag) / 2 * height - 0.5, 0, height - 1)
    column = np.clip((1 + z.real) / 2 * width - 0.5, 0, width - 1)
    top, left = row.astype(np.int64), column.astype(np.int64)
    bottom, right = np.minimum(top + 1, height - 1), np.minimum(left + 1, width - 1)
    down, across = (
        share.reshape(-1, *[1] * (image.ndim - 2)) for share in (row - top, column - left)
    )
    above = (1 - across) * image[top, left] + across * image[top, right]
    below = (1 - across) * image[bottom, left] + across * image[bottom, right]
    return (1 - down) * above + down * below
