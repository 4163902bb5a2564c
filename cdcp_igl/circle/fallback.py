"""From the boundary trace to the unit circle: the geodesic algorithm and its fallbacks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..arrays import Complex
from ..distortion import angle_errors
from ..injectivity import is_around
from ..mesh import DiskMesh
from .crowding import refuse_crowding
from .geodesic import geodesic_map
from .spread import around
from .theodorsen import theodorsen_map
from .whiten import whiten

__all__ = ["BoundaryMethod", "by_arc_length", "map_to_circle"]


# On nefertiti_299 (34 boundary vertices) subdivision lowers the mean angular distortion
# from 2.500 to 2.463 degrees; from about 200 points on it changes less than 0.02 %.
ENOUGH_POINTS = 200

DELAUNAY = " on the intrinsic Delaunay trace"

LEAST_STEP = 1e-12  # of directions that are made monotone


@dataclass(frozen=True)
class BoundaryMethod:
    """How the boundary got onto the circle.

    Attributes
    ----------
    name : str
        The method whose result was used; ``"geodesic"`` unless something went wrong.
    rejected : tuple of str
        The methods that gave no map, each with the reason for its rejection.
    n_spread : int
        Faces inscribed in the circle whose corners were moved apart, by some 1e-7, lest they
        collapse in double precision.
    """

    name: str
    rejected: tuple[str, ...] = ()
    n_spread: int = 0

    def __str__(self) -> str:
        opened = f", arcs of {self.n_spread:,} faces opened" if self.n_spread else ""
        return self.name + opened + "".join(f" (rejected {reason})" for reason in self.rejected)


def map_to_circle(
    mesh: DiskMesh,
    trace: Complex,
    delaunay_trace: Callable[[], Complex],
    extend: Callable[[Complex], Complex],
    *,
    whitened: bool,
) -> tuple[Complex, BoundaryMethod]:
    """Map the exterior of the boundary trace onto the disk, eqs. (1)-(6).

    The geodesic algorithm needs a simple curve. Where slivers or a bad dipole have made
    the trace cross itself, that of the intrinsic Delaunay Laplacian is tried. Where that
    does too, the map with the least angular distortion is taken of these: the directions
    of either trace from its centroid, made monotone; Theodorsen's method on either, made
    star-shaped in this way; arc length on the surface, which always works and is not
    conformal.

    Parameters
    ----------
    mesh : DiskMesh
    trace : (nB,) complex128
        Boundary trace of the cotangent Laplacian, clockwise.
    delaunay_trace : callable
        Computes that of the intrinsic Delaunay Laplacian; called only when needed.
    extend : callable
        Extends boundary values to all of the surface; called only when needed.
    whitened : bool
        Whiten the traces first, and subdivide the edges of short ones. The paper does
        neither.

    Returns
    -------
    f_B : (nB,) complex128
        On the unit circle, strictly counterclockwise, once around, the first at 1.
    BoundaryMethod

    Raises
    ------
    MapError
        If the geodesic algorithm fails because of crowding: the exact map is not to be had
        in double precision, and the others would be nothing like it.
    """
    geodesic = _whitened_geodesic_map if whitened else geodesic_map
    rejected: list[str] = []

    def accepted(name: str, f_B: Complex | None) -> Complex | None:
        objection = _objection(f_B)
        if f_B is None or objection is not None:
            rejected.append(f"{name}: {objection}")
            return None
        f_B = f_B / f_B[0]
        return f_B / abs(f_B)

    name = "geodesic"
    if (f_B := accepted(name, geodesic(trace))) is not None:
        return f_B, BoundaryMethod(name)
    traces = {"": trace, DELAUNAY: delaunay_trace()}
    name += DELAUNAY
    if (f_B := accepted(name, geodesic(traces[DELAUNAY]))) is not None:
        return f_B, BoundaryMethod(name, tuple(rejected))

    refuse_crowding(mesh, trace)
    maps: dict[str, Complex | None] = {}
    for which, curve in traces.items():
        z = whiten(curve)
        radial = _radial(z)
        maps["radial" + which] = accepted("radial" + which, radial)
        maps["Theodorsen" + which] = accepted(
            "Theodorsen" + which, theodorsen_map(abs(z) * radial.conj())
        )
    maps["arc length"] = by_arc_length(mesh)
    valid = {name: f_B for name, f_B in maps.items() if f_B is not None}
    best = min(valid, key=lambda name: _mean_distortion(mesh, extend(valid[name])))
    return valid[best], BoundaryMethod(best, tuple(rejected))


def _mean_distortion(mesh: DiskMesh, f: Complex) -> float:
    return float(abs(angle_errors(mesh, f)).mean())


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


def _objection(f_B: Complex | None) -> str | None:
    """Why these are not points once around the circle, strictly counterclockwise."""
    if f_B is None:
        return "the curve is not star-shaped, or no convergence"
    if not np.isfinite(f_B).all():
        return "not finite"
    if not is_around(f_B):
        return "not monotone"
    return None


def _radial(z: Complex) -> Complex:
    """Directions of a clockwise curve from 0, reversed, steps back made small ones on."""
    steps = np.angle(z * np.roll(z, -1).conj())
    chords = abs(np.roll(z, -1) - z)
    with np.errstate(invalid="ignore"):  # of a trace without area
        floor = np.maximum(1e-3 * chords / chords.sum(), LEAST_STEP)
        return around(np.maximum(steps, floor))


def by_arc_length(mesh: DiskMesh) -> Complex:
    """(nB,) boundary vertices around the circle in proportion to their distances, from 1."""
    points = mesh.V[mesh.loop]
    return around(np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1))
