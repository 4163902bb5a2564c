"""The circle onto the sides of a rectangle, by elliptic integrals."""

from __future__ import annotations

import numpy as np
from scipy.special import ellipk, ellipkinc

from ..arrays import Complex, Floats

__all__ = ["along_side"]


def along_side(z: Complex, corners: Complex) -> Floats:
    """Where the conformal map of the disk onto a rectangle takes an arc between two corners.

    Parameters
    ----------
    z : (k,) complex128
        Points of the arc from the first corner to the second.
    corners : (4,) complex128
        On the unit circle, counterclockwise, the start of the side first.

    Returns
    -------
    (k,) float64
        From 0 at the start of the side to 1 at its end.

    References
    ----------
    L. V. Ahlfors. Complex Analysis. McGraw-Hill, 1979. Chapter 6, sect. 2.3: mapping on
    a rectangle.
    """
    a, b, c, d = corners
    # In the half-plane the corners lie at -1, 1, 1/k and -1/k; chords on the circle tell k, and
    # with it root = (1 - k) / (1 + k) (Ptolemy).
    across = abs(c - a) * abs(d - b)
    root = np.sqrt(abs(c - b) * abs(a - d) / across)
    k = abs(b - a) * abs(d - c) / across / (1 + root) ** 2
    with np.errstate(divide="ignore"):
        ratio = abs(z - a) / abs(z - b) * abs(c - b) / abs(c - a) / root  # (1 + x) / (1 - x)
    amplitude = 2 * np.arctan(np.sqrt(ratio)) - np.pi / 2  # arcsin x
    return (1 + ellipkinc(amplitude, k * k) / ellipk(k * k)) / 2
