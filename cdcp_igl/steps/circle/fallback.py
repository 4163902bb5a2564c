"""From the boundary trace to the unit circle: the geodesic algorithm and its fallbacks."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from ...arrays import Complex
from ...certificate import is_around
from ...solve.factor import Factor
from ...solve.laplacian import Laplacian, intrinsic_delaunay_laplacian
from ...surface.mesh import DiskMesh
from ..extension import harmonic_extension
from .crowding import crowding_reason
from .geodesic import geodesic_map
from .harmonic_measure import arc_length_shares, harmonic_shares
from .spread import around
from .whiten import whiten_trace

__all__ = ["BoundaryMethod", "by_arc_length", "maps_to_circle"]


# On nefertiti_299 (34 boundary vertices) subdivision lowers the mean angular distortion
# from 2.500 to 2.463 degrees; from about 200 points on it changes less than 0.02 %.
ENOUGH_POINTS = 200

# Shares of the circle are at least this part of those by arc length. Less, and fewer crowded
# maps can be certified (corridors 20 times longer than wide still are); more, and they get
# worse by degrees. Elsewhere only edges without flux are concerned.
LEAST = 1e-8


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


def maps_to_circle(
    mesh: DiskMesh,
    L: Laplacian,
    factor: Factor,
    trace: Complex,
    face: int,
    *,
    whitened: bool,
) -> Iterator[tuple[Complex, Callable[[Complex], Complex], BoundaryMethod]]:
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
    f_B : (nB,) complex128
        On the unit circle, strictly counterclockwise, once around, the first at 1.
    extend : callable
        Extends boundary values harmonically to all of the surface.
    BoundaryMethod
        Asking for the next map means that this one was rejected.
    """
    rejected: list[str] = []

    f_B = (_whitened_geodesic_map if whitened else geodesic_map)(trace)
    if objection := _objection(f_B):
        rejected.append(f"geodesic: {objection}")
    else:
        f_B = f_B / f_B[0]
        extend = partial(harmonic_extension, mesh, L, factor)
        yield f_B / abs(f_B), extend, BoundaryMethod("geodesic")
        rejected.append("geodesic: no certificate")

    delaunay = intrinsic_delaunay_laplacian(mesh)
    delaunay_factor = Factor(mesh, delaunay)
    extend = partial(harmonic_extension, mesh, delaunay, delaunay_factor)
    method = partial(BoundaryMethod, laplacian="intrinsic Delaunay")

    steps = harmonic_shares(mesh, delaunay, delaunay_factor, face)
    if not np.isfinite(steps).all():
        rejected.append("harmonic measure: no interior vertex at the central face")
    elif crowded := crowding_reason(mesh, steps):
        rejected.append(f"harmonic measure: {crowded}")
    else:
        steps = np.maximum(steps, LEAST * arc_length_shares(mesh))
        yield around(steps), extend, method("harmonic measure", tuple(rejected))
        rejected.append("harmonic measure: no certificate")

    yield by_arc_length(mesh), extend, method("arc length", tuple(rejected))


def _whitened_geodesic_map(trace: Complex) -> Complex:
    """Run the geodesic algorithm on the trace as a round polygon with enough points.

    The algorithm follows circular arcs from point to point; on a short boundary, points
    along the edges of the trace keep it to the harmonic map, which is linear there.
    """
    z = whiten_trace(trace)
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
    return around(arc_length_shares(mesh))
