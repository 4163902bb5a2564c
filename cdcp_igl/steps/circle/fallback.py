"""From the boundary trace to the unit circle: the geodesic algorithm and what stands in for it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from ...arrays import Complex, Floats
from ...certificate import increments, is_around
from ...solve.factored import FactoredSurface
from ...surface.mesh import DiskMesh
from ..extension import harmonic_extension
from .crowding import balanced, crowding_reason
from .geodesic import geodesic_map
from .harmonic_measure import arc_length_shares, around, harmonic_shares
from .whiten import whiten_trace

__all__ = [
    "FALLBACKS",
    "BoundaryMethod",
    "CircleMap",
    "Rejected",
    "arc_length_map",
    "by_arc_length",
    "by_harmonic_measure",
    "by_opened_arcs",
    "by_trace",
    "whitened_geodesic_map",
]


# On nefertiti_299 (34 boundary vertices) subdivision lowers the mean angular distortion
# from 2.500 to 2.463 degrees; from about 200 points on it changes less than 0.02 %.
ENOUGH_POINTS = 200

# Opened arcs are at least this part of those by arc length. Less, and fewer crowded maps can be
# certified; more, and they get worse by degrees.
LEAST_SHARE = 1e-8

# The trace is known to some 1e-16 of its size, so that arcs shorter than this, in radians, have
# lost more than four digits. Harmonic measure keeps them.
RESOLVED = 1e-11


class Rejected(Exception):
    """A method that gives no map of the boundary onto the circle; the message says why."""


@dataclass(frozen=True)
class BoundaryMethod:
    """How the boundary got onto the circle.

    Attributes
    ----------
    name : str
        The method whose result was used: ``"geodesic"`` unless something went wrong, else
        ``"harmonic measure"``, ``"opened arcs"`` or, at last, ``"arc length"``, which is not
        conformal.
    rejected : tuple of str
        The other methods that were tried, each with the reason why its map was not used.
    n_spread : int
        Faces inscribed in the circle that had collapsed in double precision, and are held
        open by the last digits of their corners.
    laplacian : str
        Whose harmonic functions the map is made of: ``"cotangent"``, or, after the geodesic
        algorithm has failed, ``"intrinsic Delaunay"``.
    """

    name: str
    rejected: tuple[str, ...] = ()
    n_spread: int = 0
    laplacian: str = "cotangent"

    def __str__(self) -> str:
        laplacian = "" if self.laplacian == "cotangent" else f", {self.laplacian} Laplacian"
        opened = f", {self.n_spread:,} inscribed faces held open" if self.n_spread else ""
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
    """

    steps: Floats
    f_B: Complex
    extend: Callable[[Complex], Complex]
    method: BoundaryMethod


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
        If slivers or a bad dipole have made the trace cross itself, or the surface is so long
        that the trace has too few digits.
    """
    f_B = circle(trace)
    if not np.isfinite(f_B).all():
        raise Rejected("geodesic: not finite")
    if not is_around(f_B):
        raise Rejected("geodesic: not monotone")
    steps = increments(f_B)
    if steps.min() < RESOLVED and len(surface.mesh.interior):
        raise Rejected("geodesic: arcs too short for the digits of the trace")
    f_B = f_B / f_B[0]
    extend = _extension(surface)
    return CircleMap(steps, f_B / abs(f_B), extend, BoundaryMethod("geodesic"))


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

    Where remote parts would be too small, it is seen from where they are equally far away.

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
        If crowding spoils it: many boundary vertices would coincide.
    """
    steps = _seen(surface, face)
    if crowded := crowding_reason(surface.mesh, steps):
        raise Rejected(f"harmonic measure: {crowded}")
    return _on_delaunay(surface, steps, "harmonic measure")


def by_opened_arcs(surface: FactoredSurface, face: int) -> CircleMap:
    """Place the boundary by harmonic measure, and open its shortest arcs."""
    steps = _seen(surface, face)
    if crowded := crowding_reason(surface.mesh, steps):
        raise Rejected(f"opened arcs: {crowded}")
    steps = np.maximum(steps, LEAST_SHARE * arc_length_shares(surface.mesh))
    return _on_delaunay(surface, steps, "opened arcs")


def _seen(surface: FactoredSurface, face: int) -> Floats:
    """(nB,) harmonic measure of the boundary edges."""
    mesh, delaunay = surface.mesh, surface.delaunay
    measure = partial(harmonic_shares, mesh, delaunay.laplacian, delaunay.factor)
    steps = balanced(mesh, measure, _extension(delaunay), face)
    if not np.isfinite(steps).all():
        raise Rejected("harmonic measure: no interior vertex at the central face")
    return steps


def by_arc_length(surface: FactoredSurface, face: int) -> CircleMap:
    """Place the boundary by its length: not conformal, but always possible.

    On very crowded surfaces it has lower angular distortion than conformal boundaries that
    are opened as far as double precision requires. `face` is not looked at.
    """
    return _on_delaunay(surface, arc_length_shares(surface.mesh), "arc length")


def _on_delaunay(surface: FactoredSurface, steps: Floats, name: str) -> CircleMap:
    method = BoundaryMethod(name, laplacian="intrinsic Delaunay")
    return CircleMap(steps, around(steps), _extension(surface.delaunay), method)


def _extension(surface: FactoredSurface) -> Callable[[Complex], Complex]:
    return partial(harmonic_extension, surface.mesh, surface.laplacian, surface.factor)


def arc_length_map(mesh: DiskMesh) -> Complex:
    """(nB,) boundary vertices around the circle in proportion to their distances, from 1."""
    return around(arc_length_shares(mesh))


# In the order in which they are tried.
FALLBACKS = (by_harmonic_measure, by_opened_arcs, by_arc_length)
