"""Refinement beyond the harmonic map: a descent of the angle errors, and an account of it."""

from __future__ import annotations

from collections.abc import Callable

from ..records import Refinement
from .descent import Descent, Limits
from .energies import Angles, Measured

# Further steps are taken while one of the last three lowers the objective by this share.
PATIENCE, WORTH = 3, 0.004
HALVINGS = 6  # of a step, before it is computed again with more damping


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
