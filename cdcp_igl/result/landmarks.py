"""The Möbius transformation of the disk that brings points to where others are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Complex, Floats
from ..steps.mobius import conformal_barycenter

EPS = np.finfo(float).eps
MAX_STEPS = 3_000  # where landmarks ask for all and nothing; a few dozen elsewhere
INSIDE = 0.99  # factor on points whose barycentre is sought
# 0 moves to d, and |d| / sqrt(1 - |d|^2) is no larger: |a|^2 - |b|^2 would be rounding errors.
FARTHEST = 1e5


@dataclass(frozen=True)
class Automorphism:
    """A conformal map of the unit disk onto itself.

    It is (a z + b) / (conj(b) z + conj(a)), where |a|^2 - |b|^2 = 1.
    """

    a: complex = 1
    b: complex = 0

    def __call__(self, z: Complex) -> Complex:
        """Transform points (k,) of the disk."""
        return (self.a * z + self.b) / (np.conj(self.b) * z + np.conj(self.a))

    def after(self, first: Automorphism) -> Automorphism:
        """Return the transformation that does `first` and then this one."""
        a = self.a * first.a + self.b * first.b.conjugate()
        b = self.a * first.b + self.b * first.a.conjugate()
        # The determinant strays from 1 by rounding, and would do so more and more.
        scale = np.sqrt(abs(a) ** 2 - abs(b) ** 2)
        return Automorphism(complex(a / scale), complex(b / scale))

    @property
    def inverse(self) -> Automorphism:
        """The transformation back."""
        return Automorphism(self.a.conjugate(), -self.b)

    @classmethod
    def of(cls, angle: float, d: complex) -> Automorphism:
        """Move 0 to d, |d| < 1, along the diameter through d, and turn by an angle."""
        half, scale = np.exp(0.5j * angle), 1 / np.sqrt(1 - abs(d) ** 2)
        return cls(complex(half * scale), complex(half * scale * d))


def landmark_automorphism(z: Complex, target: Complex) -> Automorphism:
    """Find the automorphism T of the disk that brings points nearest to others.

    It minimises the sum of |T(z) - target|^2, once the disk has been moved so that the
    conformal barycentre of `target` lies at 0. Points that crowd near the circle then
    count, and the result does not depend on how the two maps are normalised. The points (k,) lie
    in the closed unit disk; there are at least two.
    """
    even = np.ones(len(z))
    here, there = (
        Automorphism.of(0, -conformal_barycenter(INSIDE * points, even)) for points in (z, target)
    )
    between = _nearest(here(z), there(target))
    return there.inverse.after(between.after(here))


def _nearest(z: Complex, target: Complex) -> Automorphism:
    """Minimise the sum of |T(z) - target|^2, from the best rotation on, by least squares."""
    from scipy.optimize import least_squares  # slow to import, and used here alone

    def transformation(x: Floats) -> Automorphism:
        turn, far = np.exp(0.5j * x[0]), complex(*x[1:])
        return Automorphism(complex(turn * np.hypot(1, abs(far))), complex(turn * far))

    def misfit(x: Floats) -> Floats:
        return (transformation(x)(z) - target).view(np.float64)

    start = [np.angle(np.vdot(z, target)), 0, 0]
    most = [np.inf, FARTHEST, FARTHEST]
    until = dict.fromkeys(("ftol", "xtol", "gtol"), EPS) | {"max_nfev": MAX_STEPS}
    bounds = np.negative(most), most
    found = least_squares(misfit, start, "3-point", bounds, x_scale="jac", **until)
    return transformation(found.x)
