"""The Möbius transformation of the disk that brings points to where others are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Complex, Floats
from ..steps.mobius import conformal_barycenter

MAX_STEPS = 100
EPS = np.finfo(float).eps
INSIDE = 0.99  # factor on points whose barycentre is sought
# With less damping, the system of two points on the circle, which leave one degree of freedom, is
# singular; with more, steps no longer move a point.
LEAST_DAMPING, LARGEST_DAMPING = 1e-12, 1e12
LONGEST = 0.5  # step, from the middle of the disk
# The point that goes to 0 is no nearer to the circle: |a|^2 - |b|^2 would be rounding errors.
NEAREST = 1e-10


@dataclass(frozen=True)
class Automorphism:
    """A conformal map of the unit disk onto itself: (a z + b) / (conj(b) z + conj(a)).

    Attributes
    ----------
    a, b : complex
        |a|^2 - |b|^2 = 1.
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
    def w(self) -> complex:
        """The point that goes to 0."""
        return -self.b / self.a

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
    between = _descend(here(z), there(target))
    return there.inverse.after(between.after(here))


def _misfit(moved: Complex, target: Complex) -> float:
    return float((abs(moved - target) ** 2).sum())


def _descend(z: Complex, target: Complex) -> Automorphism:
    """Minimise the misfit, from the best rotation on, by Levenberg's and Marquardt's method."""
    T = Automorphism.of(float(np.angle(np.vdot(z, target))), 0)
    damping, least = 1e-3, _misfit(T(z), target)
    for _ in range(MAX_STEPS):
        y = T(z)
        # To first order, an automorphism moves y by i angle y + d - conj(d) y^2.
        J = _real(np.stack([1j * y, 1 - y**2, 1j * (1 + y**2)], axis=1))
        while True:
            system, scale = J.T @ J, np.diag(np.maximum((J**2).sum(axis=0), EPS))
            angle, *d = np.linalg.solve(system + damping * scale, J.T @ _real(target - y))
            if abs(complex(*d)) < LONGEST:
                trial = Automorphism.of(angle, complex(*d)).after(T)
                misfit = _misfit(trial(z), target)
                if misfit < least and abs(trial.w) < 1 - NEAREST:
                    break
            damping *= 4
            if damping > LARGEST_DAMPING:
                return T
        T, least, damping = trial, misfit, max(damping / 10, LEAST_DAMPING)
    return T


def _real(x: Complex) -> Floats:
    """Real parts above the imaginary parts."""
    return np.concatenate([x.real, x.imag])
