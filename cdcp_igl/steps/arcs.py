"""The step of the geodesic algorithm: an arc opens, eqs. (2)-(5)."""

from __future__ import annotations

import numpy as np

from ..arrays import Complex, Floats

__all__ = ["open_arcs"]


PINCHED = 1e-14  # the flattest geodesic arc that double precision can open


def open_arcs(x: Complex, y: Floats, k: int) -> None:
    """Open the arcs to the next k points, one after the other.

    In the coordinate x = i / q of the upper half-plane, with the tip of what has been opened at
    infinity, the geodesic arc from there to the next point c is the ray upwards from c. It
    becomes the ray from i, and opens:

        s = x - Re c,  x <- s / sqrt(s^2 + (Im c)^2)

    The root is the principal one, which jumps on that ray and nowhere else. Where the tip was is
    x = 1 then, and c is the tip.

    Parameters
    ----------
    x : (N,) complex128
        Points that are not opened yet, the next ones first. They are moved; of the first k,
        which become real, nothing is left.
    y : (M,) float64
        Points that are opened, on the real axis, with room for k more at the end. They are
        moved.
    k : int
        At most N and M.
    """
    opened = len(y) - k
    for j in range(k):
        c = x[j]
        height = max(c.imag, PINCHED * abs(c.real))
        for points in (x[j + 1 :], y[: opened + j]):
            points -= c.real
            root = points * points
            root += height * height
            points /= np.sqrt(root, out=root)
        y[opened + j] = 1
