"""CDCP with one step left out or replaced, from the library's building blocks."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Literal

import numpy as np
from scipy.sparse import identity

from cdcp_igl.algorithm import Steps, algorithm_1
from cdcp_igl.arrays import Complex, Floats, Ints
from cdcp_igl.errors import MapError
from cdcp_igl.reference.certified import certified_disk_map
from cdcp_igl.rescue.repair import repaired
from cdcp_igl.solve.factored import FactoredSurface
from cdcp_igl.solve.solvers import factorize
from cdcp_igl.steps.center import Center, central_face
from cdcp_igl.steps.circle import Rejected, onto_circle, whiten_trace
from cdcp_igl.steps.zipper import geodesic_map
from cdcp_igl.surface.mesh import DiskMesh

from .candidate import Candidate, Methods

TABLE = f"{__name__}:ABLATIONS"


def _most_central(surface: FactoredSurface, *, method: Literal["torsion", "centroid"]) -> Center:
    """Find the most central face, well shaped or not."""
    return central_face(surface, method, well_shaped=False)


def _coldest(surface: FactoredSurface, *, t: float) -> Center:
    """Eqs. (14), (15) with any t."""
    mesh = surface.mesh
    initial = mesh.on_boundary.astype(float)
    heat = factorize(identity(len(mesh.V)) + t * surface.laplacian.matrix()).solve(initial)
    return Center("heat", int(heat[mesh.F].sum(axis=1).argmin()))


def _interior(trace: Complex, *, whitened: bool) -> Complex:
    """Take the surface for the inside of the trace: the outside of its mirrored inverse."""
    z = whiten_trace(trace) if whitened else trace - _centroid(trace)
    return geodesic_map(1 / z.conj())


def _centroid(z: Complex) -> complex:
    z0 = z.mean()
    a, b = z - z0, np.roll(z, -1) - z0
    cross = (a.conj() * b).imag
    return z0 + (cross * (a + b)).sum() / (3 * cross.sum())


def _map(V: Floats, F: Ints, *, steps: Steps) -> Floats:
    """Algorithm 1 without fallbacks."""
    surface = FactoredSurface.of(DiskMesh(V, F))
    try:
        _, f, _ = algorithm_1(surface, steps)
    except Rejected as reason:
        raise MapError(str(reason)) from reason
    f, _ = repaired(surface.mesh, f)
    return certified_disk_map(surface.mesh, f)


CENTERS: dict[str, Callable[[FactoredSurface], Center]] = {
    "torsion": partial(_most_central, method="torsion"),
    "heat t=1e3": partial(_coldest, t=1e3),
    "heat t=1e4": partial(_coldest, t=1e4),
    "heat t=1e5": partial(_coldest, t=1e5),
    "centroid": partial(_most_central, method="centroid"),
}

ZIPPERS: dict[str, Callable[[Complex], Complex]] = {
    "not whitened": geodesic_map,
    "interior trace": partial(_interior, whitened=False),
    "interior trace whitened": partial(_interior, whitened=True),
}

_VARIANTS = {
    "default": Steps(),
    "without Möbius": Steps(mobius=None),
    **{f"center {name}": Steps(of) for name, of in CENTERS.items()},
    **{f"center {name} without Möbius": Steps(of, mobius=None) for name, of in CENTERS.items()},
    **{name: Steps(circle=partial(onto_circle, zipper=zipper)) for name, zipper in ZIPPERS.items()},
}

ABLATIONS = Methods(
    {
        name: Candidate(partial(_map, steps=steps), "disk", "CDCP with a step changed")
        for name, steps in _VARIANTS.items()
    }
)
