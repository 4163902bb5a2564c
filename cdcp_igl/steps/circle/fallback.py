"""From the boundary trace to the unit circle: the geodesic algorithm and its fallbacks."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from ...arrays import Complex, Floats
from ...certificate import increments, is_around
from ...solve.factor import Factor
from ...solve.laplacian import Laplacian, intrinsic_delaunay_laplacian
from ...surface.mesh import DiskMesh
from ..extension import harmonic_extension
from .crowding import balanced, crowding
from .geodesic import geodesic_map
from .harmonic_measure import arc_length, around, harmonic_measure
from .whiten import whiten

__all__ = ["BoundaryMethod", "OnCircle", "by_arc_length", "maps_to_circle"]


# On nefertiti_299 (34 boundary vertices) subdivision lowers the mean angular distortion
# from 2.500 to 2.463 degrees; from about 200 points on it changes less than 0.02 %.
ENOUGH_POINTS = 200

# Shares of the circle are at least this part of those by arc length. Less, and fewer crowded
# maps can be certified (corridors 20 times longer than wide still are); more, and they get
# worse by degrees. Elsewhere only edges without flux are concerned.
LEAST = 1e-8

# The trace is known to some 1e-16 of its size, so that arcs shorter than this, in radians, have
# lost more than four digits. Harmonic measure keeps them.
RESOLVED = 1e-11


@dataclass(frozen=True)
class BoundaryMethod:
    """How the boundary got onto the circle.

    Attributes
    ----------
    name : str
        The method whose result was used: ``"geodesic"`` unless something went wrong, else
        ``"harmonic measure"`` or, at last, ``"arc length"``, which is not conformal.
    rejected : tuple of str
        The methods that gave no map, each with the reason for its rejection.
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
class OnCircle:
    """The boundary on the circle.

    Attributes
    ----------
    steps : (nB,) float64
        From each boundary vertex to the next, in proportion to the angles.
    f_B : (nB,) complex128
        On the unit circle, strictly counterclockwise, once around, the first at 1.
    extend : callable
        Extends boundary values harmonically to all of the surface.
    method : BoundaryMethod
    """

    steps: Floats
    f_B: Complex
    extend: Callable[[Complex], Complex]
    method: BoundaryMethod


def maps_to_circle(
    mesh: DiskMesh,
    L: Laplacian,
    factor: Factor,
    trace: Complex,
    face: int,
    *,
    whitened: bool,
) -> Iterator[OnCircle]:
    """Map the exterior of the boundary trace onto the disk, eqs. (1)-(6), or make do without.

    The geodesic algorithm needs a simple curve. Where slivers or a bad dipole have made the
    trace cross itself, or its map cannot be certified, the next one is by harmonic measure,
    which needs no curve. Where crowding spoils that too, the last one is by arc length: on
    such surfaces it has lower angular distortion than conformal boundaries that are opened
    as far as double precision requires.

    Parameters
    ----------
    mesh : DiskMesh
    L : Laplacian
        Of cotangents.
    factor : Factor
        Its factorization.
    trace : (nB,) complex128
        Boundary trace, clockwise.
    face : int
        Central face.
    whitened : bool
        Whiten the trace first, and subdivide the edges of a short one. The paper does
        neither.

    Yields
    ------
    OnCircle
        Asking for the next map means that this one was rejected.
    """
    f_B = (_whitened_geodesic_map if whitened else geodesic_map)(trace)
    objection = _objection(f_B)
    geodesic = None
    if not objection:
        f_B = f_B / f_B[0]
        extend = partial(harmonic_extension, mesh, L, factor)
        geodesic = OnCircle(increments(f_B), f_B / abs(f_B), extend, BoundaryMethod("geodesic"))
        if geodesic.steps.min() < RESOLVED:
            objection = "arcs too short for the digits of the trace"
        else:
            yield geodesic
            geodesic, objection = None, "no certificate"
    rejected = [f"geodesic: {objection}"]

    delaunay = intrinsic_delaunay_laplacian(mesh)
    delaunay_factor = Factor(mesh, delaunay)
    extend = partial(harmonic_extension, mesh, delaunay, delaunay_factor)
    method = partial(BoundaryMethod, laplacian="intrinsic Delaunay")

    steps = balanced(mesh, partial(harmonic_measure, mesh, delaunay, delaunay_factor), extend, face)
    if not np.isfinite(steps).all():
        rejected.append("harmonic measure: no interior vertex at the central face")
    elif crowded := crowding(mesh, steps):
        rejected.append(f"harmonic measure: {crowded}")
    else:
        yield OnCircle(steps, around(steps), extend, method("harmonic measure", tuple(rejected)))
        rejected.append("harmonic measure: no certificate")
        steps = np.maximum(steps, LEAST * steps.sum() * arc_length(mesh))
        yield OnCircle(steps, around(steps), extend, method("harmonic measure", tuple(rejected)))
        rejected.append("harmonic measure, short arcs opened: no certificate")

    if geodesic:
        yield geodesic
    steps = arc_length(mesh)
    yield OnCircle(steps, around(steps), extend, method("arc length", tuple(rejected)))


def _whitened_geodesic_map(trace: Complex) -> Complex:
    """Run the geodesic algorithm on the trace as a round polygon with enough points.

    The algorithm follows circular arcs from point to point; on a short boundary, points
    along the edges of the trace keep it to the harmonic map, which is linear there.
    """
    z = whiten(trace)
    pieces = -(-ENOUGH_POINTS // len(z))
    along = np.arange(pieces) / pieces
    polygon = np.outer(z, 1 - along) + np.outer(np.roll(z, -1), along)
    return geodesic_map(polygon.ravel())[::pieces]


def _objection(f_B: Complex) -> str | None:
    """Why these are not points once around the circle, strictly counterclockwise."""
    if not np.isfinite(f_B).all():
        return "not finite"
    if not is_around(f_B):
        return "not monotone"
    return None


def by_arc_length(mesh: DiskMesh) -> Complex:
    """(nB,) boundary vertices around the circle in proportion to their distances, from 1."""
    return around(arc_length(mesh))
