"""Crowding: a conformal map shrinks remote parts of a surface below double precision."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..arrays import Complex, Floats
from ..errors import spell
from ..surface.mesh import DiskMesh
from .harmonic_measure import around

__all__ = ["balanced", "crowding_reason"]

# A boundary is crowded when more than MANY_CROWDED of its edges get less than this share of
# the circle, which is a third of the distance between doubles. On a corridor n times longer
# than wide, those at the ends get about exp(-pi n / 2).
CROWDED = 2e-17
MANY_CROWDED = 0.03  # maps of corridors can be certified with 1 % of such edges, and not with 5 %
# The centre of the map is moved where shares smaller than this might become larger.
SMALL = 1e-14
ROUNDS = 8  # of moving it: one is enough unless the first centre is far off
FARTHEST = 1 - 1e-6  # that it is moved to in one round: still among faces of a size to tell apart


def crowding_reason(mesh: DiskMesh, steps: Floats, *, few: bool = False) -> str:
    """Say so if many boundary vertices coincide in double precision; empty otherwise.

    With `few`, say so whatever their number.

    `steps` (nB,) are the shares of the circle from each boundary vertex to the next by
    harmonic measure.
    """
    crowded = mesh.loop[steps < CROWDED * steps.sum()]
    if len(crowded) <= MANY_CROWDED * len(steps) and not few:
        return ""
    where = "vertices inside"
    if len(crowded):
        where = f"{len(crowded):,} of {len(steps):,} boundary vertices (vertices {spell(crowded)})"
    return (
        f"crowding, {where} closer to their neighbours than double precision can tell apart; "
        "to lower the distortion, cut the surface into shorter parts"
    )


def balanced(
    mesh: DiskMesh,
    measure: Callable[[int], Floats],
    extend: Callable[[Complex], Complex],
    face: int,
) -> tuple[int, Floats]:
    """Find the face from where the smallest shares are as large as they can be, and the shares.

    psi_w, eq. (19), multiplies short arcs at z by (1 - |w|^2) / |1 - conj(w) z|^2. The sum of
    their reciprocals, in which the smallest decide, is a linear function of the point of the
    hyperboloid that w is: it is least where w, in Klein's model of the hyperbolic plane, is
    the centre of mass of the z, weighed by the reciprocals. All remote parts then are equally
    far away.

    Parameters
    ----------
    mesh : DiskMesh
    measure : callable
        Harmonic measure of the boundary edges seen from a face.
    extend : callable
        Extends boundary values harmonically; called only if a share is too small.
    face : int
        The central face.

    Returns
    -------
    face : int
        The central face, where no share is small or none would be larger.
    steps : (nB,) float64
        The measure from there.
    """
    steps = measure(face)
    for _ in range(ROUNDS):
        if steps.min() >= SMALL * steps.sum():
            break
        f_B = around(steps)
        f = extend(f_B)
        shorter = np.minimum(steps, np.roll(steps, 1))  # of the arcs on either side
        least = max(shorter.min(), np.finfo(float).tiny)
        weights = least / np.maximum(shorter, least)
        klein = complex(np.average(f_B, weights=weights))
        w = klein / (1 + np.sqrt(max(1 - abs(klein) ** 2, 0)))
        if abs(w) > FARTHEST:
            w *= FARTHEST / abs(w)
        other = int(abs(f[mesh.F].mean(axis=1) - w).argmin())
        moved = measure(other)
        if not moved.min() / moved.sum() > steps.min() / steps.sum():
            break
        face, steps = other, moved
    return face, steps
