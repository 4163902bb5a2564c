"""The line search of refinement: how far to go without a flipped face."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..arrays import Complex, Floats
from ..surface.mesh import DiskMesh
from .figures import Figure
from .recentering import extents

HALVINGS = 6  # of a step, before it is computed again with more damping
# Rounding may flip a face less high than this, by its distance from 0, as when the map is rotated.
THIN = 1e-15
# The corners of a face that a step flips go a shorter part of it; where this part is too long, too,
# they stay where they are.
SMALLEST_SCALE = 0.03
# The corners of faces smaller than this, by their distance from 0, stay at once: rounding flips
# these faces however short the step is.
TINY = 1e-14


def search_along(
    mesh: DiskMesh,
    f: Complex,
    step: Complex,
    measure: Callable[[Floats], float],
    objective: float,
    halvings: int,
    thin: float,
    figure: Figure,
) -> tuple[Complex, Floats, float] | None:
    """Halve a step until the objective falls, and at faces that it flips until it does not.

    The step (n,) is tangential to the `figure`; `measure` takes angle errors (m, 3) to the
    objective. Faces that become less high than `thin`, by their distance from 0, count as flipped.
    Returns the map, its angle errors and its objective; None if nothing helps.
    """
    scale, low = np.ones(len(f)), figure.lower(mesh.F, f, thin)
    for _ in range(halvings):
        trial = figure.moved(mesh, f, scale * step)
        flipped = figure.lower(mesh.F, trial, thin) & ~low
        flipped[figure.flipped(mesh.F, trial)] = True
        if flipped.any():
            faces = mesh.F[flipped]
            corners = np.unique(faces)
            scale[corners] = np.where(scale[corners] > SMALLEST_SCALE, scale[corners] / 2, 0)
            size, distance = extents(f[faces])
            scale[faces[size < TINY * distance]] = 0
            continue
        r = figure.errors(mesh, trial)
        value = measure(r)
        if value < objective and figure.holds(mesh, trial):
            return trial, r, value
        scale /= 2
    return None
