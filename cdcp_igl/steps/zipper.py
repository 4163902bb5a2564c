"""The geodesic (zipper) algorithm on the exterior of the boundary trace, eqs. (1)-(6)."""

from __future__ import annotations

import numpy as np

from ..arrays import Bools, Complex, Floats, Numbers, shifted

COINCIDENT = 1e-8  # points closer than this to the one before, by the size of the curve
PINCHED = 1e-14  # the flattest geodesic arc that double precision can open

PARTS = 4  # into which a block is cut
FEW = 32  # points whose arcs are opened one by one: the fixed cost of a call still shows
WORTH = 256  # far points from which on a series costs less than the steps that it stands for

# The circle within which points are far is this much smaller than the one through the next
# point. The series then loses a digit of the 52 of a double with each term.
SEPARATION = 2
TERMS = 52
CONVERGED = 1e-13  # its last terms, by the largest

_ANGLES = (np.arange(TERMS // 2) + 0.5) * np.pi / (TERMS // 2)
_HALF_CIRCLE = np.exp(1j * _ANGLES)
_TO_COEFFICIENTS = np.exp(-1j * np.outer(np.arange(TERMS), _ANGLES)) / (TERMS // 2)


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
    # Start at the longest edge, which two points describe worst; of several, at the first.
    lengths = abs(shifted(z) - z)
    first = int((lengths >= (1 - 1e-9) * lengths.max()).argmax())
    curve = shifted(z, first)
    steps: Floats = np.abs(curve - shifted(curve, -1))
    kept = steps > COINCIDENT * abs(curve - curve.mean()).max()
    kept[:2] = True
    f = np.empty_like(curve)
    f[kept] = _zip(curve[kept])
    if not kept.all():
        f = _interpolate_dropped(f, kept, steps)
    return shifted(f, -first)


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


def open_blocks(x: Complex, y: Floats, k: int) -> None:
    """Do what `open_arcs` does, in O(n log n) operations on a reasonable curve.

    The arcs to the next k points are a hull about infinity, and what opens them is one
    conformal map, real on the real axis: by reflection, it is analytic in each disk with a real
    centre that holds none of these points. A disk around the real part of the base point, the
    last of x, holds most of the others. Points on its circle are opened with the points outside,
    and their images are the coefficients of the power series that moves those inside. The outside
    is treated in the same way, block by block.

    References
    ----------
    T. Kennedy. A fast algorithm for simulating the chordal Schramm-Loewner evolution.
    J. Stat. Phys. 128(5), 2007: power series for blocks of maps, there about infinity.
    """
    if k <= FEW or len(x) + len(y) - k < WORTH:
        open_arcs(x, y, k)
        return
    opened, size = len(y) - k, -(-k // PARTS)
    for first in range(0, k, size):
        last = min(first + size, k)
        rest, so_far = x[first:], y[: opened + last]
        if not _open_by_series(rest, so_far, last - first):
            open_blocks(rest, so_far, last - first)


def _open_by_series(x: Complex, y: Floats, k: int) -> bool:
    """Open a block; return whether that is worth its cost and the series converges."""
    rest, opened = x[k:], y[:-k]
    center = x[-1].real
    radius = abs(x[:k] - center).min() / SEPARATION
    far, opened_far = abs(rest - center) < radius, abs(opened - center) < radius
    far[-1] = False  # the base point stays at the end
    if far.sum() + opened_far.sum() < WORTH:
        return False
    near = np.concatenate([x[:k], center + radius * _HALF_CIRCLE, rest[~far]])
    opened_near = np.append(opened[~opened_far], np.empty(k))
    open_blocks(near, opened_near, k)  # fewer points: WORTH is more than the circle has
    images = near[k : k + len(_HALF_CIRCLE)]
    series = (_TO_COEFFICIENTS @ images).real
    size = abs(series)
    if not size[-4:].max() < CONVERGED * size.max():  # nor if it is NaN
        return False
    rest[far] = _sum(series, (rest[far] - center) / radius)
    rest[~far] = near[k + len(images) :]
    opened[opened_far] = _sum(series, (opened[opened_far] - center) / radius)
    opened[~opened_far] = opened_near[:-k]
    y[-k:] = opened_near[-k:]
    return True


def _sum(series: Floats, x: Numbers) -> Numbers:
    """Sum a power series by Horner's method."""
    total = np.full_like(x, series[-1])
    for coefficient in series[-2::-1]:
        total *= x
        total += coefficient
    return total


def open_arcs(x: Complex, y: Floats, k: int) -> None:
    """Open the arcs to the next k points, one after the other, eqs. (2)-(5).

    In the coordinate x = i / q of the upper half-plane, with the tip of what has been opened at
    infinity, the geodesic arc from there to the next point c is the ray upwards from c. It
    becomes the ray from i, and opens:

        s = x - Re c,  x <- s / sqrt(s^2 + (Im c)^2)

    The root is the principal one, which jumps on that ray and nowhere else. Where the tip was is
    x = 1 then, and c is the tip. x (N,) are points that are not opened yet, the next ones first;
    y (M,), on the real axis, those that are, with room for k more. Both are moved in place.
    """
    opened = len(y) - k
    points = np.concatenate([y[:opened], x])
    for j in range(opened, len(y)):
        c = complex(points[j])
        height = max(c.imag, PINCHED * abs(c.real))
        points -= complex(c.real)
        points[j] = 1  # any number that is not on the arc
        root = points * points
        root += complex(height * height)
        points /= np.sqrt(root, out=root)
        points[j] = 1
    y[:], x[k:] = points[: len(y)].real, points[len(y) :]
