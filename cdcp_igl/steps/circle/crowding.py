"""Crowding: a conformal map shrinks remote parts of a surface below double precision."""

from __future__ import annotations

import numpy as np

from ...arrays import Floats
from ...errors import spell
from ...surface.mesh import DiskMesh

__all__ = ["crowding_reason"]

# A boundary is crowded when more than MANY_CROWDED of its edges get less than this share of
# the circle. On a corridor n times longer than wide, those at the ends get about exp(-pi n / 2).
CROWDED = 1e-14
MANY_CROWDED = 0.1


def crowding_reason(mesh: DiskMesh, steps: Floats) -> str:
    """Say so if many boundary vertices coincide in double precision; empty otherwise.

    `steps` (nB,) are the shares of the circle from each boundary vertex to the next by
    harmonic measure. Zero is the share of what hangs on a surface without an interior of its
    own: that has nothing to do with how far away it is.
    """
    crowded = mesh.loop[(steps > 0) & (steps < CROWDED)]
    if len(crowded) <= MANY_CROWDED * np.count_nonzero(steps):
        return ""
    return (
        f"crowding, {len(crowded):,} of {len(steps):,} boundary vertices (vertices "
        f"{spell(crowded)}) closer to their neighbours than double precision can tell apart; "
        "to lower the distortion, cut the surface into shorter parts"
    )
