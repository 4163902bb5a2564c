"""CDCP with one step left out or replaced, and without a mechanism of its rescue."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, contextmanager
from functools import partial
from typing import Any, Literal

import numpy as np
from scipy.sparse import identity

from cdcp_igl import DiskMap, disk_map
from cdcp_igl.algorithm import Steps, algorithm_1
from cdcp_igl.arrays import Complex, Floats, Ints
from cdcp_igl.descent.collapsed_faces import open_collapsed_faces
from cdcp_igl.descent.repair import repair_locally, repaired
from cdcp_igl.errors import MapError
from cdcp_igl.maps import rules
from cdcp_igl.records import Repair, Straightening
from cdcp_igl.reference.certified import certified_disk_map
from cdcp_igl.solve.factored import FactoredSurface
from cdcp_igl.solve.solvers import factorize
from cdcp_igl.starts.boundary import FALLBACKS, STARTS, _balanced
from cdcp_igl.starts.recentring import recentered
from cdcp_igl.starts.straightening import straighten
from cdcp_igl.steps.center import Center, central_face
from cdcp_igl.steps.circle import Rejected, onto_circle, whiten_trace
from cdcp_igl.steps.zipper import geodesic_map
from cdcp_igl.surface.mesh import DiskMesh
from cdcp_igl.surface.triangles import flipped_faces

from .candidate import Candidate


def _most_central(surface: FactoredSurface, *, method: Literal["torsion", "centroid"]) -> Center:
    """Find the most central face, well shaped or not."""
    return central_face(surface, method, well_shaped=False)


def _coldest(surface: FactoredSurface, *, t: float) -> Center:
    """Eqs. (14), (15) with any t."""
    mesh = surface.mesh
    initial = mesh.on_boundary.astype(float)
    heat = factorize(identity(len(mesh.scaled)) + t * surface.laplacian.matrix()).solve(initial)
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
        f = algorithm_1(surface, steps)
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

ABLATIONS = {
    name: Candidate(partial(_map, steps=steps), "disk", "CDCP with a step changed")
    for name, steps in _VARIANTS.items()
}


# -- the rescue ------------------------------------------------------------------------

# Without a mechanism, what does its work does nothing. The library has no switch for this;
# here, and only here, its functions are replaced.

ALL, NONE = "all mechanisms", "no mechanism"
Without = Callable[[], AbstractContextManager[Any]]


def _patched(owner: object, attribute: str, by: object) -> AbstractContextManager[Any]:
    from unittest import mock  # 2 MB, which would be in the memory of every method

    return mock.patch.object(owner, attribute, by)


@contextmanager
def _replaced(function: Callable[..., Any], by: Callable[..., Any]) -> Iterator[None]:
    """Replace a function of the library wherever it has been imported."""
    with ExitStack() as stack:
        for name, module in list(sys.modules.items()):
            if name.startswith("cdcp_igl."):
                for attribute in [key for key, value in vars(module).items() if value is function]:
                    stack.enter_context(_patched(module, attribute, by))
        yield


@contextmanager
def _without_boundary(name: str) -> Iterator[None]:
    from unittest import mock

    with ExitStack() as stack:
        for boundaries in (FALLBACKS, STARTS):
            left = {key: boundary for key, boundary in boundaries.items() if key != name}
            stack.enter_context(mock.patch.dict(boundaries, left, clear=True))
        yield


def _without_starts() -> AbstractContextManager[Any]:
    from unittest import mock

    return mock.patch.dict(STARTS, clear=True)


def _not_balanced(surface: object, shares: Floats) -> Floats:
    return shares


def _not_repaired(mesh: DiskMesh, f: Complex, most: float = np.inf) -> tuple[Complex, Repair]:
    return f, Repair(len(flipped_faces(f, mesh.F)[0]))


def _not_straightened(mesh: DiskMesh, f: Complex, extend: object) -> tuple[Complex, Straightening]:
    return f, Straightening()


def _not_moved(mesh: DiskMesh, f: Complex, *others: object) -> tuple[Complex, int]:
    return f, 0


MECHANISMS: Mapping[str, Without] = {
    "harmonic measure": partial(_without_boundary, "harmonic measure"),
    "balance of harmonic measure": partial(_replaced, _balanced, _not_balanced),
    "arc length": partial(_without_boundary, "arc length"),
    "local repair": partial(_replaced, repair_locally, _not_repaired),
    "Tutte embeddings": _without_starts,
    "straightening": partial(_replaced, straighten, _not_straightened),
    "recentering": partial(_replaced, recentered, _not_moved),
    "opening of collapsed faces": partial(_replaced, open_collapsed_faces, _not_moved),
    "refinement by default": partial(_patched, rules, "default_steps", lambda *_: 0),
}


def _mapped(V: Floats, F: Ints, *, without: tuple[str, ...] = ()) -> DiskMap:
    with ExitStack() as stack:
        for name in without:
            stack.enter_context(MECHANISMS[name]())
        try:
            return disk_map(V, F)
        except (
            Rejected
        ) as reason:  # which the library never comes to: arc length is always possible
            raise MapError(f"No boundary is left, rejected {reason}") from reason


RESCUES: Mapping[str, Candidate] = {
    name: Candidate(partial(_mapped, without=without), "disk", "CDCP with a part of its rescue")
    for name, without in {
        ALL: (),
        **{f"without {name}": (name,) for name in MECHANISMS},
        NONE: tuple(MECHANISMS),
    }.items()
}
