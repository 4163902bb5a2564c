"""CDCP with one step left out or replaced, from the library's building blocks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Literal

import numpy as np
from scipy.sparse import identity

from cdcp_igl.arrays import Complex, Floats, Ints
from cdcp_igl.errors import MapError
from cdcp_igl.reference.certified import certified_disk_map
from cdcp_igl.solve.cholmod import Cholesky
from cdcp_igl.solve.factor import Factor
from cdcp_igl.solve.laplacian import Laplacian, cotangent_laplacian
from cdcp_igl.steps.center import central_face, centrality
from cdcp_igl.steps.circle.fallback import _whitened_geodesic_map
from cdcp_igl.steps.circle.geodesic import geodesic_map
from cdcp_igl.steps.circle.whiten import whiten
from cdcp_igl.steps.dipole import boundary_trace
from cdcp_igl.steps.extension import harmonic_extension
from cdcp_igl.steps.mobius import normalize
from cdcp_igl.steps.repair import unfold
from cdcp_igl.surface.mesh import DiskMesh

from .methods import Candidate

__all__ = ["ABLATIONS", "CENTERS", "TABLE"]

TABLE = f"{__name__}:ABLATIONS"

Circle = Callable[[Complex], Complex | None]
Center = Callable[[DiskMesh, Laplacian, Factor], int]


def _default_center(mesh: DiskMesh, L: Laplacian, factor: Factor) -> int:
    return central_face(mesh, L, factor, "torsion", well_shaped=True).face


def _most_central(
    mesh: DiskMesh, L: Laplacian, factor: Factor, *, method: Literal["torsion", "centroid"]
) -> int:
    """Find the most central face, well shaped or not."""
    return int(centrality(mesh, L, factor, method).argmax())


def _coldest(mesh: DiskMesh, L: Laplacian, factor: Factor, *, t: float) -> int:
    """Eqs. (14), (15) with any t."""
    initial = mesh.on_boundary.astype(float)
    heat = Cholesky(identity(len(mesh.V)) + t * L.matrix()).solve(initial)
    return int(heat[mesh.F].sum(axis=1).argmin())


def _interior(trace: Complex, *, whitened: bool) -> Complex:
    """Take the surface for the inside of the trace: the outside of its mirrored inverse."""
    z = whiten(trace) if whitened else trace - _centroid(trace)
    return geodesic_map(1 / z.conj())


def _centroid(z: Complex) -> complex:
    z0 = z.mean()
    a, b = z - z0, np.roll(z, -1) - z0
    cross = (a.conj() * b).imag
    return z0 + (cross * (a + b)).sum() / (3 * cross.sum())


def _map(
    V: Floats,
    F: Ints,
    *,
    center: Center = _default_center,
    circle: Circle = _whitened_geodesic_map,
    mobius: Literal["angle"] | None = "angle",
) -> Floats:
    """Algorithm 1 without fallbacks."""
    mesh = DiskMesh(V, F)
    L = cotangent_laplacian(mesh)
    factor = Factor(mesh, L)
    f_B = circle(boundary_trace(mesh, factor, center(mesh, L, factor)))
    if f_B is None or not np.isfinite(f_B).all():
        raise MapError("the trace gives no map of the circle")
    f_B = f_B / f_B[0]
    f = harmonic_extension(mesh, L, factor, f_B / abs(f_B))
    f, _ = normalize(mesh, f, mobius)
    f, _ = unfold(mesh, f)
    return certified_disk_map(mesh, f)


CENTERS: dict[str, Center] = {
    "torsion": partial(_most_central, method="torsion"),
    "heat t=1e3": partial(_coldest, t=1e3),
    "heat t=1e4": partial(_coldest, t=1e4),
    "heat t=1e5": partial(_coldest, t=1e5),
    "centroid": partial(_most_central, method="centroid"),
}

_VARIANTS = {
    "default": partial(_map),
    "without Möbius": partial(_map, mobius=None),
    **{f"center {name}": partial(_map, center=of) for name, of in CENTERS.items()},
    **{
        f"center {name} without Möbius": partial(_map, center=of, mobius=None)
        for name, of in CENTERS.items()
    },
    "not whitened": partial(_map, circle=geodesic_map),
    "interior trace": partial(_map, circle=partial(_interior, whitened=False)),
    "interior trace whitened": partial(_map, circle=partial(_interior, whitened=True)),
}

ABLATIONS: Mapping[str, Candidate] = {
    name: Candidate(function, "disk", "CDCP with a step changed")
    for name, function in _VARIANTS.items()
}
