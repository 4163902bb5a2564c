"""Many steps of the geodesic algorithm at once: far from the next points they are one series."""

from __future__ import annotations

from typing import TypeVar

import numpy as np

from ..arrays import Complex, Floats
from .arcs import open_arcs

__all__ = ["open_blocks"]

Points = TypeVar("Points", Complex, Floats)

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


def open_blocks(x: Complex, y: Floats, k: int) -> None:
    """Do what `open_arcs` does, in O(n log n) operations on a reasonable curve.

    The arcs to the next k points are a hull about infinity, and what opens them is one
    conformal map, real on the real axis: by reflection, it is analytic in each disk with a real
    centre that holds none of these points. A disk around the real part of the base point holds
    most of the others. Points on its circle are opened with the points outside, and their
    images are the coefficients of the power series that moves those inside. The outside is
    treated in the same way, block by block.

    Parameters
    ----------
    x : (N,) complex128
        As of `open_arcs`; the last one is the base point.
    y : (M,) float64
        As of `open_arcs`.
    k : int
        At most N - 1 and M.

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
    open_blocks(near, opened_near, k)
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


def _sum(series: Floats, x: Points) -> Points:
    """Sum a power series by Horner's method."""
    total = np.full_like(x, series[-1])
    for coefficient in series[-2::-1]:
        total *= x
        total += coefficient
    return total
