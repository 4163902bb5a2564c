"""Whitening: take the first-order anisotropy out of a boundary trace."""

from __future__ import annotations

import numpy as np

from ..arrays import Complex

ROUNDS = 3


def whiten_trace(z: Complex) -> Complex:
    """Make the moments of inertia of a closed polygon (N,) equal, and its area pi.

    The trace of a dipole on one face is sum a_k zeta^k + b_k zeta^-k with a dominant
    b_1, since the face has a shape. Subtracting a multiple of the conjugate removes b_1
    and leaves a rounder curve, on which the geodesic algorithm loses fewer digits; the
    exterior map does not change to first order. Not in the paper. A polygon that crosses itself so
    much that it has no moments of inertia is only moved and scaled; one without area becomes NaN.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        return _whitened(z)


def _whitened(z: Complex) -> Complex:
    for _ in range(ROUNDS):
        area, centroid = _area_and_centroid(z)
        z = z - centroid
        q = _anisotropy(z)
        if 0 < abs(q) < 1:
            kappa = (1 - np.sqrt(1 - abs(q) ** 2)) / abs(q)
            z = z - kappa * q / abs(q) * z.conj()
    area, centroid = _area_and_centroid(z)
    return (z - centroid) / np.sqrt(abs(area) / np.pi)


def _area_and_centroid(z: Complex) -> tuple[float, complex]:
    origin = z.mean()  # near the polygon, so that the products below do not cancel
    z = z - origin
    after = np.roll(z, -1)
    cross = (z.conj() * after).imag
    area = cross.sum() / 2
    return area, origin + (cross * (z + after)).sum() / (6 * area)


def _anisotropy(z: Complex) -> complex:
    """Integral of z^2 over integral of |z|^2, both over the enclosed area."""
    after = np.roll(z, -1)
    cross = (z.conj() * after).imag
    squares = (cross * (z * z + z * after + after * after)).sum()
    moduli = (cross * (abs(z) ** 2 + (z.conj() * after).real + abs(after) ** 2)).sum()
    return squares / moduli
