"""One method on one mesh, in a process of its own: what comparisons are made of."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import closing
from dataclasses import asdict, dataclass, field, fields
from importlib import import_module
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, Ints
from ..errors import MapError, SolverError
from ..printing import finite
from ..result.base import Result
from ..result.sphere_map import SphereMap
from ..scale.pool import Pool, same_modules
from ..solve.memory import peak_memory
from ..surface.mesh import DiskMesh, SphereMesh
from ..verdict.any_map import certify as certify_any
from ..verdict.certificate import Certificate, SphereCertificate, certify, certify_sphere

OK = "ok"
TOO_LONG, TOO_LARGE = "no result within", "more than"  # begin the outcomes of the two limits


@dataclass(frozen=True)
class Timed:
    """What a function returns that has its own clock and makes no map: its seconds, in parts."""

    seconds: float
    phases: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Case:
    """What one method made of one mesh; NaN, and no details, where there is no map.

    `details` is the report of a result such as a `DiskMap`, where one is returned.
    """

    method: str  # name in the table of methods
    boundary: str  # "disk" or "sphere"; "free", neither; or "none", a time and no map
    outcome: str  # "ok", or why there is no valid map: the error, the signal, a limit
    mean: float = np.nan  # of the angular distortion in degrees, as the next two
    sd: float = np.nan
    max: float = np.nan
    area_sd: float = np.nan  # of the log of the ratio of areas, infinite if a face is flipped
    texels: float = np.nan  # density, of 95 by that of 5 percent of the surface: `AreaDistortion`
    flips: float = np.nan  # faces that are not positively oriented
    overlaps: float = np.nan  # places where outlines cross, or one lies on another: `certify`
    boundary_error: float = np.nan  # farthest from the unit circle, or the unit sphere
    seconds: float = np.nan  # from arrays to map
    memory: float = np.nan  # peak in MiB, of a fresh process
    details: Mapping[str, Any] = field(default_factory=dict)

    @property
    def ok(self) -> bool:
        """Whether there is a map, or a time."""
        return self.outcome == OK

    @property
    def verdict(self) -> str:
        """Whether the map is valid, in a word."""
        if not self.ok:
            return "no map"
        if self.flips > 0:
            return f"{self.flips:,.0f} flips"
        return "overlaps" if self.overlaps > 0 else "yes"

    def as_json(self) -> dict[str, Any]:
        """Return all but the details as JSON types, None for what is not a finite number."""
        return finite({name: getattr(self, name) for name in FIELDS})


FIELDS = tuple(field.name for field in fields(Case) if field.name != "details")


def run_case(
    method: str,
    V: ArrayLike,
    F: ArrayLike,
    *,
    time_limit: float,
    memory_limit: float = np.inf,
    table: str = "cdcp_igl.reference:METHODS",
) -> tuple[Case, Floats | None]:
    """Run a method in a fresh process, which it may crash; return the map if it is valid.

    The limits are those of a `Pool`. The table is ``"module:name"`` of a mapping from names to
    `reference.Method`. A function in it may also return a result such as a `DiskMap`, or a `Timed`
    with boundary ``"none"``. If the method has a ``prepare``, that is called first and does not
    count.
    """
    pool = Pool(1, time_limit, memory_limit, attempts=1, environment=same_modules())
    with closing(pool):
        (answer,) = pool.run([_Run(method, np.asarray(V), np.asarray(F), table)])
    return answer


@dataclass(frozen=True)
class _Run:
    """A `Job`: a method, by its name in a table, on a surface."""

    name: str
    V: Floats
    F: Ints
    table: str
    draft: str = ""
    memory: float = 0

    @property
    def _method(self) -> Any:
        module, _, attribute = self.table.partition(":")
        return getattr(import_module(module), attribute)[self.name]

    def run(self) -> tuple[Case, Floats | None]:
        """Measure the method."""
        measured, uv = measure(self._method, self.V, self.F)
        return Case(self.name, self._method.boundary, **measured), uv

    def failed(self, error: str, message: str) -> tuple[Case, None]:
        """Answer where there was none: a limit, or a crash."""
        return Case(self.name, self._method.boundary, message), None


def measure(method: Any, V: Floats, F: Ints) -> tuple[dict[str, Any], Floats | None]:
    """Run a method in this process; return what a `Case` has of it, and the map."""
    if prepare := getattr(method, "prepare", None):
        prepare()
    given = V.copy(), F.copy()  # which the method may change
    start = perf_counter()
    try:
        made = method.function(*given)
    except Exception as error:
        typed = isinstance(error, (MapError, SolverError))
        return {"outcome": "failed: " * (not typed) + _first_line(error)}, None
    cost = {"seconds": perf_counter() - start, "memory": peak_memory()}
    if isinstance(made, Timed):
        details = {"seconds": dict(made.phases)}
        return {"outcome": OK, **cost, "seconds": made.seconds, "details": details}, None
    uv, details = made, {}
    if isinstance(made, Result):
        uv, details = made.points if isinstance(made, SphereMap) else made.uv, made.report()
    columns = 3 if method.boundary == "sphere" else 2
    if returned := _other_than_map(uv, len(V), columns):
        must = f"must return (n, {columns}) numbers, and returned {returned}"
        return {"outcome": f"failed: {must}"}, None
    uv = np.asarray(uv, dtype=np.float64)
    certificate, off = _certified(method.boundary, V, F, uv)
    if not (certificate.finite if method.boundary == "free" else certificate.valid):
        return {"outcome": f"not valid: {certificate}"}, None
    found = certify_any(V, F, uv)
    distortion = found.angles
    if not np.isfinite([distortion.mean, distortion.sd, distortion.max]).all():
        return {"outcome": f"not valid: angular distortion {distortion}"}, None
    return {
        "outcome": OK,
        **asdict(distortion),
        "area_sd": found.areas.sd,
        "texels": found.areas.texels,
        "flips": len(found.flipped),
        "overlaps": len(found.overlapping) + len(found.stacked),
        "boundary_error": off,
        **cost,
        "details": details,
    }, uv


def _certified(
    boundary: str, V: Floats, F: Ints, uv: Floats
) -> tuple[Certificate | SphereCertificate, float]:
    """Verify a map; and the largest deviation from the circle or the sphere."""
    if boundary == "sphere":
        sphere = certify_sphere(SphereMesh(V, F).F, uv)
        return sphere, sphere.radius_error
    disk = certify(DiskMesh(V, F), uv)
    return disk, disk.boundary_error


def _first_line(error: Exception) -> str:
    return f"{type(error).__name__}: {error}".splitlines()[0].removesuffix(": ")


def _other_than_map(made: object, n: int, columns: int) -> str:
    """Describe what is no map of n vertices; empty if it may be one."""
    if not isinstance(made, np.ndarray):
        return type(made).__name__
    is_map = made.shape == (n, columns) and made.dtype.kind in "fiu"
    return "" if is_map else f"{made.dtype} of shape {made.shape}, where n is {n:,}"
