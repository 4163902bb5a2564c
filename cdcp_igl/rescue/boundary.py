"""From the boundary trace to the unit circle: the geodesic algorithm and what stands in for it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..arrays import Complex, Floats
from ..certificate import increments, is_around
from ..errors import counted
from ..solve.factored import FactoredSurface
from ..steps.extension import harmonic_extension, settled_extension
from ..steps.whiten import whiten_trace
from ..steps.zipper import geodesic_map
from ..surface.mesh import DiskMesh
from .crowding import balanced, crowding_reason
from .harmonic_measure import arc_length_shares, around, harmonic_shares
from .shorten import Shortened

__all__ = [
    "FALLBACKS",
    "BoundaryMethod",
    "CircleMap",
    "Rejected",
    "arc_length_map",
    "by_arc_length",
    "by_balanced_measure",
    "by_harmonic_measure",
    "by_shortening",
    "by_trace",
    "whitened_geodesic_map",
]


# On nefertiti_299 (34 boundary vertices) subdivision lowers the mean angular distortion
# from 2.500 to 2.463 degrees; from about 200 points on it changes less than 0.02 %.
ENOUGH_POINTS = 200

# The trace is known to some 1e-16 of its size, so that arcs shorter than this, in radians, have
# lost more than four digits. Harmonic measure keeps them.
RESOLVED = 1e-11

# The trace of a dipole of size 1 is as small as this on surfaces that are closed but for a small
# hole, or long. Its errors are some 1e-17 whatever its size, and 10 to 100 times larger in the map.
SMALLEST_TRACE = 1e-10

# How many times larger the smallest share must become for another centre to be tried.
WORTH_MOVING = 10


class Rejected(Exception):
    """A method that gives no map of the boundary onto the circle; the message says why."""


@dataclass(frozen=True)
class BoundaryMethod:
    """How the boundary got onto the circle.

    Attributes
    ----------
    name : str
        The method whose result was used: ``"geodesic"`` unless something went wrong, else
        ``"harmonic measure"``, ``"balanced harmonic measure"``, ``"shortened"`` or, at last,
        ``"arc length"``; the last two are not conformal everywhere.
    rejected : tuple of str
        The other methods that were tried, each with the reason why its map was not used.
    n_spread : int
        Faces inscribed in the circle, or behind chords of it, that had collapsed in double
        precision, and are held open by the last digits of their corners.
    laplacian : str
        Whose harmonic functions the map is made of: ``"cotangent"``, or, after the geodesic
        algorithm has failed, ``"intrinsic Delaunay"``; ``"constrained Delaunay"`` where faces had
        to be kept lest they be turned over.
    reason : str
        Why the map of this boundary cannot be conformal everywhere; empty if it can.
    """

    name: str
    rejected: tuple[str, ...] = ()
    n_spread: int = 0
    laplacian: str = "cotangent"
    reason: str = ""

    def __str__(self) -> str:
        laplacian = "" if self.laplacian == "cotangent" else f", {self.laplacian} Laplacian"
        faces = counted(self.n_spread, "face", "faces")
        opened = f", {faces} held open" if self.n_spread else ""
        reasons = "".join(f" (rejected {reason})" for reason in self.rejected)
        return self.name + laplacian + opened + reasons


@dataclass(frozen=True, eq=False)
class CircleMap:
    """The boundary on the circle, and how to go on from there.

    Attributes
    ----------
    steps : (nB,) float64
        From each boundary vertex to the next, in proportion to the angles.
    f_B : (nB,) complex128
        On the unit circle by these steps, counterclockwise, once around, the first at 1.
    extend : callable
        Extends boundary values harmonically to all of the surface.
    method : BoundaryMethod
    settle : callable or None
        Makes the interior of a map harmonic again, as `settled_extension`; None if there is
        nothing too small.
    """

    steps: Floats
    f_B: Complex
    extend: Callable[[Complex], Complex]
    method: BoundaryMethod
    settle: Callable[[Complex], Complex] | None = None

    @property
    def is_crowded(self) -> bool:
        """Whether there are arcs that positions on the circle do not describe well."""
        return bool(self.steps.min() < RESOLVED * self.steps.sum())

    def turned(self, f_B: Complex) -> CircleMap:
        """Take other places for the boundary; not for a crowded one."""
        return replace(self, steps=increments(f_B), f_B=f_B)


def by_trace(
    surface: FactoredSurface, trace: Complex, circle: Callable[[Complex], Complex]
) -> CircleMap:
    """Map the exterior of the boundary trace onto the disk, eqs. (1)-(6).

    Parameters
    ----------
    surface : FactoredSurface
    trace : (nB,) complex128
        Boundary trace, clockwise.
    circle : callable
        Takes a closed curve to the circle: `geodesic_map`, or with whitening before it.

    Returns
    -------
    CircleMap

    Raises
    ------
    Rejected
        If slivers or a bad dipole have made the trace cross itself, or the dipole is so far from
        the boundary that the trace has too few digits.
    """
    if 0 < abs(trace - trace[0]).max() < SMALLEST_TRACE:
        raise Rejected("geodesic: the trace is too small for the digits of the dipole")
    if _turns_back(trace):
        raise Rejected("geodesic: the trace turns back")
    f_B = circle(trace)
    if not np.isfinite(f_B).all():
        raise Rejected("geodesic: not finite")
    if not is_around(f_B):
        raise Rejected("geodesic: not monotone")
    steps = increments(f_B)
    if steps.min() < RESOLVED and len(surface.mesh.interior):
        raise Rejected("geodesic: arcs too short for the digits of the trace")
    f_B = f_B / f_B[0]
    extend, settle = _extension(surface), partial(settled_extension, surface)
    return CircleMap(steps, f_B / abs(f_B), extend, BoundaryMethod("geodesic"), settle)


def _turns_back(trace: Complex) -> bool:
    """Whether a step of a clockwise curve has nothing of the direction of the one before.

    Next to a circle, a chord turns from the one before by half of both arcs.
    """
    step = np.roll(trace, -1) - trace
    length = abs(step)
    half_arcs = np.pi * (length + np.roll(length, -1)) / max(length.sum(), SMALLEST_TRACE)
    turn = np.roll(step, -1) * step.conj() * np.exp(1j * half_arcs)
    return bool((turn.real < 0).any())


def whitened_geodesic_map(trace: Complex) -> Complex:
    """Run the geodesic algorithm on the trace as a round polygon with enough points.

    The algorithm follows circular arcs from point to point; on a short boundary, points
    along the edges of the trace keep it to the harmonic map, which is linear there.
    """
    z = whiten_trace(trace)
    pieces = -(-ENOUGH_POINTS // len(z))
    along = np.arange(pieces) / pieces
    polygon = np.outer(z, 1 - along) + np.outer(np.roll(z, -1), along)
    return geodesic_map(polygon.ravel())[::pieces]


def by_harmonic_measure(surface: FactoredSurface, face: int) -> CircleMap:
    """Place the boundary as it is seen from the central face; needs no curve.

    Parameters
    ----------
    surface : FactoredSurface
    face : int
        The central face.

    Returns
    -------
    CircleMap

    Raises
    ------
    Rejected
        If no corner of the face lies inside, or crowding spoils it: many boundary vertices would
        coincide.
    """
    name = "harmonic measure"
    return _by_shares(surface, _shares(surface, name, face), name)


def by_balanced_measure(surface: FactoredSurface, face: int) -> CircleMap:
    """Place the boundary as it is seen from where remote parts are equally far away.

    Not the first choice: the discrete map is at its best around the face that it is seen from,
    and that should not be a narrow part of the surface unless there is nothing but narrow parts.

    Parameters
    ----------
    surface : FactoredSurface
    face : int
        The central face.

    Returns
    -------
    CircleMap

    Raises
    ------
    Rejected
        If no corner of the face lies inside, remote parts are equally far away from it already,
        or crowding spoils it nevertheless.
    """
    name = "balanced harmonic measure"
    _, shares = _balanced(surface, name, face)
    if shares.min() < WORTH_MOVING * _shares(surface, name, face).min():
        raise Rejected(f"{name}: remote parts are equally far away")
    return _by_shares(surface, shares, name)


def _by_shares(surface: FactoredSurface, shares: Floats, name: str) -> CircleMap:
    if crowded := crowding_reason(surface.mesh, shares):
        raise Rejected(f"{name}: {crowded}")
    return _on_delaunay(surface, shares, name)


def by_shortening(surface: FactoredSurface, face: int) -> CircleMap:
    """Place the boundary by harmonic measure of a surface that is short enough for doubles.

    Conformal where the faces of the disk are large enough, and not in remote parts.

    Parameters
    ----------
    surface : FactoredSurface
    face : int
        The central face.

    Returns
    -------
    CircleMap

    Raises
    ------
    Rejected
        If no corner of the face lies inside, nothing is too small to be told apart, or all is so
        small that nothing helps.
    """
    name = "shortened"
    face, steps = _balanced(surface, name, face)
    shortened = Shortened(surface.delaunay, face)
    if shortened.part == 1:
        raise Rejected(f"{name}: no face is too small")
    reason = crowding_reason(surface.mesh, steps, few=True)
    if shortened.part == 0:
        raise Rejected(f"{name}: {reason}")
    method = BoundaryMethod(name, laplacian="intrinsic Delaunay", reason=reason)
    return CircleMap(shortened.steps, around(shortened.steps), shortened.extend, method)


def _balanced(surface: FactoredSurface, name: str, face: int) -> tuple[int, Floats]:
    """Return the central face, moved if need be, and the harmonic measure (nB,) from there."""
    extend = _extension(surface.delaunay)
    return balanced(surface.mesh, partial(_shares, surface, name), extend, face)


def _shares(surface: FactoredSurface, name: str, face: int) -> Floats:
    """(nB,) harmonic measure of the boundary edges seen from a face, for the method `name`."""
    shares = harmonic_shares(surface.delaunay, face)
    if not np.isfinite(shares).all():
        raise Rejected(f"{name}: no interior vertex at the central face")
    return shares


def by_arc_length(surface: FactoredSurface, face: int) -> CircleMap:
    """Place the boundary by its length: not conformal, but always possible.

    On very crowded surfaces it has lower angular distortion than conformal boundaries that
    are opened as far as double precision requires. `face` is not looked at.
    """
    return _on_delaunay(surface, arc_length_shares(surface.mesh), "arc length")


def _on_delaunay(surface: FactoredSurface, steps: Floats, name: str) -> CircleMap:
    method = BoundaryMethod(name, laplacian="intrinsic Delaunay")
    extend, settle = _extension(surface.delaunay), partial(settled_extension, surface.delaunay)
    return CircleMap(steps, around(steps), extend, method, settle)


def _extension(surface: FactoredSurface) -> Callable[[Complex], Complex]:
    return partial(harmonic_extension, surface)


def arc_length_map(mesh: DiskMesh) -> Complex:
    """(nB,) boundary vertices around the circle in proportion to their distances, from 1."""
    return around(arc_length_shares(mesh))


# In the order in which they are tried.
FALLBACKS = (by_harmonic_measure, by_balanced_measure, by_shortening, by_arc_length)
