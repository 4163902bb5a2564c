"""The geodesic (zipper) algorithm on the exterior of the boundary trace, eqs. (1)-(6)."""

from __future__ import annotations

import numpy as np

from ..arrays import Bools, Complex, Floats

__all__ = ["geodesic_map"]


COINCIDENT = 1e-8  # points closer than this to the one before, by the size of the curve
PINCHED = 1e-14  # the flattest geodesic arc that double precision can open


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
    # Eq. (1): the first edge opens onto the imaginary axis and the exterior becomes the
    # right half-plane, with infinity at 1. Points that have been zipped stay on the axis
    # and are kept as reals, y for the point iy; q holds the others and, last, the base
    # point. Infinite y and zero divisors follow IEEE arithmetic to the right limits.
    y = np.empty(len(z))
    y[0], y[1] = np.inf, 0
    with np.errstate(all="ignore"):
        q = np.append(np.sqrt((z[2:] - z[1]) / (z[2:] - z[0])), 1)
        for j in range(2, len(z)):
            # Eqs. (2)-(5): the geodesic arc from 0 to a + ib becomes the segment [0, 1],
            # and opens. Its two sides are y = 1 (where 0 was) and y = 0 (the tip).
            a, b = q[0].real, q[0].imag
            a = max(a, PINCHED * abs(b))
            m = a * a + b * b
            t = a / (m / y[:j] - b)
            np.copysign(np.sqrt(1 + t * t), t, out=y[:j])
            y[j - 1], y[j] = 1, 0
            q = _open(a * q[1:] / (m + 1j * b * q[1:]))
        # Eq. (6): the last edge, from y_0 to 0, closes; then the quadrant becomes the disk
        # with the base point at 0.
        w = q[0] / (1 - q[0] / (1j * y[0]))
        y /= 1 - y / y[0]
        y[0] = np.inf
        y, w = y / abs(w), w / abs(w)
        A, x = w * w, -y * y
        f = np.where(abs(y) > 1, (1 - A / x) / (1 - A.conj() / x), (x - A) / (x - A.conj()))
        return f / abs(f)


def _open(t: Complex) -> Complex:
    """sqrt(t^2 - 1) with positive real part; on the imaginary axis it keeps t's side.

    This is the branch that eq. (4) leaves open.
    """
    w = (t - 1) * (t + 1)
    major = np.sqrt((abs(w) + abs(w.real)) / 2)
    minor = abs(w.imag) / (2 * major)
    right = w.real >= 0
    return np.where(right, major, minor) + 1j * np.copysign(np.where(right, minor, major), t.imag)


def _interpolate_dropped(f: Complex, kept: Bools, steps: Floats) -> Complex:
    """Place the dropped points between their neighbours in proportion to chord length."""
    angle = np.unwrap(np.angle(f[kept]))
    along = np.cumsum(steps) - steps[0]
    knots = np.append(along[kept], along[-1] + steps[0])
    return np.exp(1j * np.interp(along, knots, np.append(angle, angle[0] + 2 * np.pi)))
