"""Crowding: a conformal map shrinks remote parts of a surface below double precision."""

from __future__ import annotations

import numpy as np

from ..arrays import Complex, Floats, Ints
from ..errors import MapError, spell
from ..mesh import DiskMesh

__all__ = ["blame_crowding", "refuse_crowding"]

# A trace is crowded when more than this share of its steps is below this part of its size.
# On a corridor n times longer than wide, steps at the ends shrink like exp(-pi n).
CROWDED, MANY_CROWDED = 1e-14, 0.1
TINY = 1e-12  # shortest by longest edge of a face in the unit disk, which bound its area

REMEDY = (
    "The surface is too long and thin for a disk: cut it into shorter parts, or use a map "
    "with a free boundary."
)


def refuse_crowding(mesh: DiskMesh, trace: Complex) -> None:
    """Raise MapError if the images of many boundary vertices coincide in double precision."""
    with np.errstate(invalid="ignore"):
        steps = abs(np.roll(trace, -1) - trace)
        crowded = mesh.loop[steps < CROWDED * abs(trace - trace.mean()).max()]
    if len(crowded) > MANY_CROWDED * len(trace):
        raise MapError(
            f"Crowding: the conformal map puts {len(crowded):,} of {len(trace):,} boundary "
            "vertices closer to their neighbours than double precision can tell apart "
            f"(vertices {spell(crowded)}). {REMEDY}"
        )


def blame_crowding(uv: Floats, F: Ints, flipped: Ints) -> str:
    """Say so if all flipped faces are tiny; empty where crowding is not the cause."""
    corners = uv[F[flipped]]
    edges = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    if len(flipped) == 0 or not (edges.min(axis=1) * edges.max(axis=1) < TINY).all():
        return ""
    return (
        f". Crowding: the flipped faces (faces {spell(flipped)}) are too small in the disk for "
        f"double precision. {REMEDY}"
    )
