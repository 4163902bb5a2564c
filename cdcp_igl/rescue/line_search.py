"""The line search of refinement: how far to go without a flipped face."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..arrays import Bools, Complex, Floats, Ints, coordinates
from ..certificate import certify, certify_outline
from ..distortion import angle_errors
from ..surface.mesh import DiskMesh
from ..surface.triangles import flipped_faces, twice_areas
from .collapsed_faces import open_collapsed_faces
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
    *,
    free: bool = False,
) -> tuple[Complex, Floats, float] | None:
    """Halve a step until the objective falls, and at faces that it flips until it does not.

    The step (n,) is tangential to the circle on the boundary, unless that is `free`; `measure`
    takes angle errors (m, 3) to the objective. Faces that become less high than `thin`, by their
    distance from 0, count as flipped. Returns the map, its angle errors and its objective; None if
    nothing helps.
    """
    certified = certify_outline if free else certify
    scale, low = np.ones(len(f)), _lower(mesh.F, f, thin)
    for _ in range(halvings):
        trial = f + scale * step
        if not free:
            trial = open_collapsed_faces(mesh, _slide(mesh, f, scale * step))[0]
        flipped = _lower(mesh.F, trial, thin) & ~low
        flipped[flipped_faces(trial, mesh.F)[0]] = True
        if flipped.any():
            faces = mesh.F[flipped]
            corners = np.unique(faces)
            scale[corners] = np.where(scale[corners] > SMALLEST_SCALE, scale[corners] / 2, 0)
            size, distance = extents(f[faces])
            scale[faces[size < TINY * distance]] = 0
            continue
        r = angle_errors(mesh, trial)
        value = measure(r)
        if value < objective and certified(mesh, coordinates(trial)).valid:
            return trial, r, value
        scale /= 2
    return None


def _slide(mesh: DiskMesh, f: Complex, step: Complex) -> Complex:
    """Move a map by a displacement; the boundary by its angle, so that it stays on the circle.

    What has no displacement stays to the last bit.
    """
    moved, sliding = f + step, mesh.loop[step[mesh.loop] != 0]
    boundary = f[sliding]
    boundary = boundary * np.exp(step[sliding] / boundary)  # by i times a real number
    moved[sliding] = boundary / abs(boundary)
    return moved


def _lower(F: Ints, f: Complex, height: float) -> Bools:
    """(m,) whether faces are flipped, or less high than that by their distance from 0."""
    corner = f[F]
    e = corner - corner[:, [2, 0, 1]]
    twice_area = twice_areas(e)
    if height == 0:
        return np.asarray(twice_area < 0)
    size, distance = extents(corner)
    return np.asarray(twice_area < height * distance * size)
