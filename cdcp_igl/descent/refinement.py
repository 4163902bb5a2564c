"""Refinement beyond the harmonic map: a descent of the angle errors, and an account of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from ..errors import counted
from .descent import Descent, Limits
from .energies import Angles, Measured

# Further steps are taken while one of the last three lowers the objective by this share.
PATIENCE, WORTH = 3, 0.004
HALVINGS = 6  # of a step, before it is computed again with more damping


@dataclass(frozen=True)
class Refinement:
    """What was done to lower the angular distortion beyond that of the harmonic map.

    Attributes
    ----------
    asked : int
        Steps that were allowed, at least 1: as many as were asked for, or were due.
    steps : int
        Steps that were taken.
    stopped : str
        Why they are fewer: ``"no improvement"``; of steps that were not asked for,
        ``"little to gain"``, or ``"out of reach"`` if they cannot make the map conformal;
        ``"no certificate"`` of the map that they led to, or ``"not conformal"`` if steps would have
        taken this from the map; or ``"time limit"``. Empty if they are not fewer.
    norm : float
        The exponent p.
    before, after : float
        The objective in degrees: the power mean, with exponent p, of the angle errors of
        all corners, each at least 0.1 degree.
    """

    asked: int
    steps: int
    stopped: str
    norm: float
    before: float
    after: float

    def undone(self, why: str) -> Refinement:
        """Account for steps that were taken back."""
        return replace(self, steps=0, stopped=why, after=self.before)

    def __str__(self) -> str:
        if self.steps == 0:
            return self.stopped
        note = f" ({self.stopped})" if self.stopped else ""
        asked = counted(self.asked, "step", "steps")
        return (
            f"{self.steps} of {asked}{note}, angle errors in the {self.norm:g}-norm "
            f"from {self.before:.4f} to {self.after:.4f} degrees"
        )


def lower_angle_distortion(
    descent: Descent,
    angles: Angles,
    limits: Limits,
    accepted: Callable[[Measured], bool] = lambda found: True,
    advance: Callable[[float], None] = lambda done: None,
) -> Refinement:
    """Lower the angle errors of a map in place, see `Descent.lower`; its image stays the target.

    A map that has flipped faces or overlaps itself, or nothing of which may move, stays.
    """
    mesh, target, f = descent.mesh, descent.target, descent.f
    flipped = target.flipped(mesh.F, f)
    before = after = angles.measured(f, flipped).value
    if descent.is_fixed or not target.certificate(mesh, f, flipped).valid:
        return Refinement(limits.steps, 0, "no improvement", angles.norm, before, after)
    after = descent.lower(angles, limits, accepted, advance)
    return Refinement(limits.steps, descent.steps, descent.stopped, angles.norm, before, after)
