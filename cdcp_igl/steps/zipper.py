"""The geodesic (zipper) algorithm on the exterior of the boundary trace, eqs. (1)-(6)."""

from __future__ import annotations

import numpy as np

from ..arrays import Bools, Complex, Floats
from .blocks import open_blocks

__all__ = ["geodesic_map"]


COINCIDENT = 1e-8  # points closer than this to the one before, by the size of the curve


def geodesic_map(z: Complex) -> Complex:
    """Map the exterior of a closed curve onto the disk, infinity to 0.

    Parameters
    ----------
    z : (N,) complex128
        Points along a simple closed **clockwise** curve, N at least 3.

    Returns
    -------
    (N,) complex128
        Their images on the unit circle, counterclockwise. On a curve that crosses itself
        the images are not monotone or not finite.

    References
    ----------
    D. E. Marshall, S. Rohde. Convergence of a variant of the zipper algorithm for
    conformal mapping. SIAM J. Numer. Anal. 45(6), 2007.
    """
    # From the longest edge, the one that two points describe worst; the first of several.
    lengths = abs(np.roll(z, -1) - z)
    first = int((lengths >= (1 - 1e-9) * lengths.max()).argmax())
    curve = np.roll(z, -first)
    steps: Floats = np.abs(np.diff(curve, prepend=curve[-1]))
    kept = steps > COINCIDENT * abs(curve - curve.mean()).max()
    kept[:2] = True
    f = np.empty_like(curve)
    f[kept] = _zip(curve[kept])
    if not kept.all():
        f = _interpolate_dropped(f, kept, steps)
    return np.roll(f, first)


def _zip(z: Complex) -> Complex:
    """Run the algorithm on a curve whose first edge is a good place to start."""
    # In the coordinate x = i / q of the upper half-plane the tip is at infinity. The last of x is
    # the base point, and y are the points that have been opened, which stay on the real axis.
    y = np.empty(len(z))
    with np.errstate(all="ignore"):
        # Eq. (1): the first edge opens, the point at infinity comes to i, z_0 to 0.
        x = np.append(1j * np.sqrt((z[2:] - z[0]) / (z[2:] - z[1])), 1j)
        y[0], y[-1] = 0, np.inf
        open_blocks(x, y[:-1], len(z) - 2)  # (2)-(5)
        # Eq. (6): the last edge, from y_0 to infinity, closes; then the quadrant becomes the disk
        # with the base point at 0.
        w = x[-1] - y[0]
        x, w = (y - y[0]) ** 2 / abs(w) ** 2, (w / abs(w)) ** 2
        f = np.where(x > 1, (1 - w / x) / (1 - w.conj() / x), (x - w) / (x - w.conj()))
        return f / abs(f)


def _interpolate_dropped(f: Complex, kept: Bools, steps: Floats) -> Complex:
    """Place the dropped points between their neighbours in proportion to chord length."""
    angle = np.unwrap(np.angle(f[kept]))
    along = np.cumsum(steps) - steps[0]
    knots = np.append(along[kept], along[-1] + steps[0])
    return np.exp(1j * np.interp(along, knots, np.append(angle, angle[0] + 2 * np.pi)))
