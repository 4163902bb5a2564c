"""How the next step of a descent is found: its model, how far it is solved, a factor or none.

Both start roughly, and say after each step how the next one is found.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import NamedTuple

from ..arrays import Complex
from .energies import Angles, Energy, Measured, Quadratic, SymmetricDirichlet

# A step that gains less than this share is near the minimum; WORTH ends a descent.
NEAR, WORTH = 0.03, 1e-3
# Directions of CG at most, and the share of what all have gained that ends them: roughly or not.
DIRECTIONS, ENOUGH_ROUGHLY, ENOUGH = 12, 1e-2, 1e-3
SPARE = 6  # further directions than with a factor that is new, before another is made

# Not far from the conformal map three lower the objective to within 0.3 % of what the solved system
# would; the weights of other maps differ more.
CG_ITERATIONS, FAR_ITERATIONS = 3, 8
# Below this objective in degrees, what is left of the errors belongs to single faces: after the way
# that the map has just gone and one direction by the factor, so many by the diagonal alone, each
# a sixth of the time, bring as much; and the preconditioner stays while a step gains less than so.
GOOD, SMOOTHING, GOOD_GAIN = 4, 3, 0.08
# Near the conformal map, the diagonal alone will do until a step gains more than that, or fails:
# it gives directions until one brings less than this share of what all have, but at most so many.
ENOUGH_SMOOTHING, MOST_SMOOTHING = 0.05, 40
DAMPINGS = (0, 1, 10, 100)  # tried in turn
# The preconditioner is used again after a step that has lowered the objective by less than this
# share, as the weights are much the same; but not if p is smaller, as they change too much then.
SMALL_GAIN, STEADY = 0.02, 1.5
# A step that faces held back and that gained less is followed by a damped one, which flips fewer.
HELD_GAIN = 0.004
LOWERING = 0.5  # of p from 2 to the norm, with each step


@dataclass(frozen=True)
class Directions:
    """Of conjugate gradients: one `along` the last step, then by the factor, then by the diagonal.

    They end when one brings less than the share `enough` of what all have.
    """

    by_factor: int
    by_diagonal: int
    along: Complex | None
    enough: float


class Taken(NamedTuple):
    """A step (n,), the largest part of it that a vertex went, and the energy before and after.

    So many directions by the factor were `used` to find it.
    """

    step: Complex
    length: float
    before: float
    after: float
    used: int


class Schedule(ABC):
    """How the next step is found.

    Attributes
    ----------
    is_stale : bool
        Whether the preconditioner is to be factored anew.
    is_exhausted : bool
        Whether there is no further way to find a step.
    """

    is_stale = True
    is_exhausted = False

    @abstractmethod
    def model(self, at: Measured) -> Quadratic:
        """Expand the energy."""

    @abstractmethod
    def directions(self, value: float) -> Directions:
        """Return the directions for a map whose energy has this `value`."""

    @abstractmethod
    def failed(self) -> None:
        """Find the next step more carefully: the last one was none."""

    @abstractmethod
    def went(self, taken: Taken) -> None:
        """Take account of a step."""


class DampedGaussNewton(Schedule):
    """Of angle errors: p falls to the norm step by step, and a failure is followed by more damping.

    The weights begin with those of p = 2, which bring the large errors down that a smaller p would
    take for outliers. A damped step has Levenberg-Marquardt damping of the shear of every face.
    """

    def __init__(self, energy: Angles) -> None:
        self._energy, self._p, self._damping, self._gained_little = energy, 2.0, 0, True
        self._along: Complex | None = None

    def model(self, at: Measured) -> Quadratic:
        """Expand the energy."""
        return self._energy.quadratic(at, self._p, DAMPINGS[self._damping])

    def directions(self, value: float) -> Directions:
        """Return the directions for a map whose energy has this `value`."""
        if self._energy.is_near and self._gained_little and value < GOOD and not self._damping:
            return Directions(0, MOST_SMOOTHING, self._along, ENOUGH_SMOOTHING)
        if self._along is not None:
            return Directions(1, SMOOTHING, self._along, 0)
        return Directions(CG_ITERATIONS if value < GOOD else FAR_ITERATIONS, 0, None, 0)

    def failed(self) -> None:
        """Take more damping."""
        self._damping, self._along, self.is_stale = self._damping + 1, None, True
        self.is_exhausted = self._damping == len(DAMPINGS)

    def went(self, taken: Taken) -> None:
        """Take account of a step; one that faces held back says nothing of a damped one."""
        before, after = taken.before, taken.after
        if taken.length < 1 and 1 - after / before < HELD_GAIN and not self._damping:
            self.failed()
            return
        as_before = self._p, self._damping
        self._p = max(self._energy.norm, self._p - LOWERING)
        self._damping = max(self._damping - 1, 0)
        self._along = taken.step if after < GOOD else None
        self._gained_little = after >= (1 - GOOD_GAIN) * before
        alike = (self._p, self._damping) == as_before and after >= (1 - SMALL_GAIN) * before
        if self._along is not None:
            alike = self._gained_little
        self.is_stale = self._energy.norm < STEADY or not alike


class ProjectedNewton(Schedule):
    """Of shear and scale: far from the minimum the part of the Hessian that is always positive.

    Near it the whole, its negative eigenvalues at 0, unless the descent is a rough one.
    """

    def __init__(self, energy: SymmetricDirichlet, worth: float) -> None:
        self._energy, self._whole, self._used_when_new = energy, False, 0
        self._is_rough, self._may_be_whole = worth > WORTH, worth < NEAR

    def model(self, at: Measured) -> Quadratic:
        """Expand the energy."""
        return self._energy.quadratic(at.f, whole=self._whole)

    def directions(self, value: float) -> Directions:
        """Return the directions for a map whose energy has this `value`."""
        return Directions(DIRECTIONS, 0, None, ENOUGH_ROUGHLY if self._is_rough else ENOUGH)

    def failed(self) -> None:
        """Take what is always positive, with a new factor; there is no more."""
        self.is_exhausted = not self._whole
        self._whole = self._may_be_whole = False
        self.is_stale = True

    def went(self, taken: Taken) -> None:
        """Take account of a step."""
        if self.is_stale:
            self._used_when_new = taken.used
        was, near = self._whole, 1 - taken.after / taken.before < NEAR
        self._whole = self._may_be_whole and (was or near)
        is_solved = taken.used < min(DIRECTIONS, self._used_when_new + SPARE + 1)
        self.is_stale = not (was and self._whole and near and is_solved)


def schedule_of(energy: Energy, worth: float) -> Schedule:
    """Return how steps are found in a descent to the last that gains a share of `worth`."""
    if isinstance(energy, Angles):
        return DampedGaussNewton(energy)
    return ProjectedNewton(energy, worth)
