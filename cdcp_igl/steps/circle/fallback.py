"""From the boundary trace to the unit circle: the geodesic algorithm and what stands in for it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from ...arrays import Complex
from ...certificate import is_around
from ...solve.factored import FactoredSurface
from ...surface.mesh import DiskMesh
from ..extension import harmonic_extension
from .crowding import crowding_reason
from .geodesic import geodesic_map
from .harmonic_measure import arc_length_shares, harmonic_shares
from .spread import around
from .whiten import whiten_trace

__all__ = [
    "FALLBACKS",
    "BoundaryMethod",
    "CircleMap",
    "Rejected",
    "arc_length_map",
    "by_arc_length",
    "by_harmonic_measure",
    "by_trace",
    "whitened_geodesic_map",
]


# On nefertiti_299 (34 boundary vertices) subdivision lowers the mean angular distortion
# from 2.500 to 2.463 degrees; from about 200 points on it changes less than 0.02 %.
ENOUGH_POINTS = 200

# Shares of the circle are at least this part of those by arc length. Less, and fewer crowded
# maps can be certified (corridors 20 times longer than wide still are); more, and they get
# worse by degrees. Elsewhere only edges without flux are concerned.
LEAST_SHARE = 1e-8


class Rejected(Exception):
    """A method that gives no map of the boundary onto the circle; the message says why."""


@dataclass(frozen=True)
class BoundaryMethod:
    """How the boundary got onto the circle.

    Attributes
    ----------
    name : str
        The method whose result was used: ``"geodesic"`` unless something went wrong, else
        ``"harmonic measure"`` or, at last, ``"arc length"``, which is not conformal.
    rejected : tuple of str
        The other methods that were tried, each with the reason why its map was not used.
    n_spread : int
        Faces inscribed in the circle whose corners were moved apart, by some 1e-7, lest they
        collapse in double precision.
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
        opened = f", arcs of {self.n_spread:,} faces opened" if self.n_spread else ""
        reasons = "".join(f" (rejected {reason})" for reason in self.rejected)
        return self.name + laplacian + opened + reasons


@dataclass(frozen=True, eq=False)
class CircleMap:
    """The boundary on the circle, and how to go on from there.

    Attributes
    ----------
    f_B : (nB,) complex128
        On the unit circle, strictly counterclockwise, once around, the first at 1.
    extend : callable
        Extends boundary values harmonically to all of the surface.
    method : BoundaryMethod
    """

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
        If slivers or a bad dipole have made the trace cross itself.
    """
    f_B = circle(trace)
    if not np.isfinite(f_B).all():
        raise Rejected("geodesic: not finite")
    if not is_around(f_B):
        raise Rejected("geodesic: not monotone")
    f_B = f_B / f_B[0]
    extend = partial(harmonic_extension, surface.mesh, surface.laplacian, surface.factor)
    return CircleMap(f_B / abs(f_B), extend, BoundaryMethod("geodesic"))


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
        If crowding spoils it: many boundary vertices would coincide.
    """
    mesh, delaunay = surface.mesh, surface.delaunay
    steps = harmonic_shares(mesh, delaunay.laplacian, delaunay.factor, face)
    if not np.isfinite(steps).all():
        raise Rejected("harmonic measure: no interior vertex at the central face")
    if crowded := crowding_reason(mesh, steps):
        raise Rejected(f"harmonic measure: {crowded}")
    steps = np.maximum(steps, LEAST_SHARE * arc_length_shares(mesh))
    return _on_delaunay(surface, around(steps), "harmonic measure")


def by_arc_length(surface: FactoredSurface, face: int) -> CircleMap:
    """Place the boundary by its length: not conformal, but always possible.

    On very crowded surfaces it has lower angular distortion than conformal boundaries that
    are opened as far as double precision requires. `face` is not looked at.
    """
    return _on_delaunay(surface, arc_length_map(surface.mesh), "arc length")


def _on_delaunay(surface: FactoredSurface, f_B: Complex, name: str) -> CircleMap:
    delaunay = surface.delaunay
    extend = partial(harmonic_extension, surface.mesh, delaunay.laplacian, delaunay.factor)
    return CircleMap(f_B, extend, BoundaryMethod(name, laplacian="intrinsic Delaunay"))


def arc_length_map(mesh: DiskMesh) -> Complex:
    """(nB,) boundary vertices around the circle in proportion to their distances, from 1."""
    return around(arc_length_shares(mesh))


# In the order in which they are tried.
FALLBACKS = (by_harmonic_measure, by_arc_length)
