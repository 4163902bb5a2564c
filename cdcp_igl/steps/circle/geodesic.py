"""The geodesic (zipper) algorithm on the exterior of the boundary trace, eqs. (1)-(6)."""

from __future__ import annotations

import numpy as np

from ...arrays import Bools, Complex, Floats

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
    # and are kept as reals, y for the point iy; u + iv are the others and, last, the base
    # point. Infinite y and zero divisors follow IEEE arithmetic to the right limits.
    # Real numbers, in place: complex ones take a third longer.
    y = np.empty(len(z))
    y[0], y[1] = np.inf, 0
    with np.errstate(all="ignore"):
        q = np.append(np.sqrt((z[2:] - z[1]) / (z[2:] - z[0])), 1)
        u, v, buffers = q.real.copy(), q.imag.copy(), np.empty((3, len(q)))
        for j in range(2, len(z)):
            # Eqs. (2)-(5): the geodesic arc from 0 to a + ib becomes the segment [0, 1],
            # and opens. Its two sides are y = 1 (where 0 was) and y = 0 (the tip).
            a, b = float(u[j - 2]), float(v[j - 2])
            a = max(a, PINCHED * abs(b))
            m = a * a + b * b
            _open_on_axis(y[:j], a, b, m)
            y[j - 1], y[j] = 1, 0
            _open(u[j - 1 :], v[j - 1 :], a, b, m, buffers[:, j - 1 :])
        # Eq. (6): the last edge, from y_0 to 0, closes; then the quadrant becomes the disk
        # with the base point at 0.
        w = complex(u[-1], v[-1])
        w /= 1 - w / (1j * y[0])
        y /= 1 - y / y[0]
        y[0] = np.inf
        y, w = y / abs(w), w / abs(w)
        A, x = w * w, -y * y
        f = np.where(
            abs(y) > 1, (1 - A / x) / (1 - A.conjugate() / x), (x - A) / (x - A.conjugate())
        )
        return f / abs(f)


def _open_on_axis(y: Floats, a: float, b: float, m: float) -> None:
    """Move zipped points iy by eqs. (2)-(5): t = a / (m / y - b), y <- sqrt(1 + t^2) t's way."""
    t = np.divide(m, y)
    t -= b
    np.divide(a, t, out=t)
    np.multiply(t, t, out=y)
    y += 1
    np.sqrt(y, out=y)
    np.copysign(y, t, out=y)


def _open(u: Floats, v: Floats, a: float, b: float, m: float, buffers: Floats) -> None:
    """Move points q = u + iv by eqs. (2)-(5): t = a q / (m + ibq), q <- sqrt(t^2 - 1).

    The root has positive real part; on the imaginary axis it keeps t's side. This is the
    branch that eq. (4) leaves open.
    """
    s, t, d = buffers
    # t = a (u m + i (v d - b u^2)) / (d^2 + (b u)^2) with d = m - b v; below it is s + it.
    np.multiply(u, b, out=s)
    np.multiply(v, -b, out=d)
    d += m
    np.multiply(v, d, out=t)
    np.multiply(u, s, out=v)
    t -= v
    d *= d
    s *= s
    d += s
    np.divide(a, d, out=d)
    t *= d
    np.multiply(u, m, out=s)
    s *= d
    # w = (t - 1) (t + 1); its real part in u, half of its imaginary part in s.
    np.add(s, 1, out=u)
    np.subtract(s, 1, out=v)
    u *= v
    np.multiply(t, t, out=v)
    u -= v
    s *= t
    # The larger part of the root, in d, is sqrt((|w| + |Re w|) / 2), the smaller, in s,
    # |Im w| / 2 divided by that.
    np.abs(s, out=s)
    np.multiply(s, 2, out=d)
    d *= d
    np.multiply(u, u, out=v)
    d += v
    np.sqrt(d, out=d)
    np.abs(u, out=v)
    d += v
    d *= 0.5
    np.sqrt(d, out=d)
    s /= d
    left = u < 0
    np.copyto(u, d)
    np.copyto(u, s, where=left)
    np.copyto(s, d, where=left)
    np.copysign(s, t, out=v)


def _interpolate_dropped(f: Complex, kept: Bools, steps: Floats) -> Complex:
    """Place the dropped points between their neighbours in proportion to chord length."""
    angle = np.unwrap(np.angle(f[kept]))
    along = np.cumsum(steps) - steps[0]
    knots = np.append(along[kept], along[-1] + steps[0])
    return np.exp(1j * np.interp(along, knots, np.append(angle, angle[0] + 2 * np.pi)))
