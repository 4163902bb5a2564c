"""One method on one mesh, in a process of its own: what comparisons are made of.

Run as ``python -m cdcp_igl.reference.case TABLE METHOD MESH.npz RESULT.npz`` it is that process.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic, perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, Ints
from ..certificate import Certificate, SphereCertificate, certify, certify_sphere
from ..distortion import AngleDistortion, angle_distortion, area_distortion
from ..errors import MapError, SolverError
from ..io.output import whole_file
from ..printing import finite
from ..processes import cause_of_death, peak_memory, resident
from ..result.base import Result
from ..sphere import SphereMap
from ..surface.mesh import DiskMesh, SphereMesh

OK = "ok"
TOO_LONG, TOO_LARGE = "no result within", "more than"  # begin the outcomes of the two limits
POLL = 0.05  # seconds between two looks at the memory of the process


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
    area: float = np.nan  # mean |log of the ratio of areas|, infinite if a face is flipped
    flips: float = np.nan  # faces that are not positively oriented
    boundary_error: float = np.nan  # farthest from the unit circle, or the unit sphere
    seconds: float = np.nan  # from arrays to map
    memory: float = np.nan  # peak in MiB, of a fresh process
    details: Mapping[str, Any] = field(default_factory=dict)

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

    The process is killed beyond limits of seconds and resident MiB. (Address space, which the
    system could limit by itself, says little: libraries reserve much that they never use.)

    The table is ``"module:name"`` of a mapping from names to `reference.Method`. A function in it
    may also return a result such as a `DiskMap`, or a `Timed` with boundary ``"none"``. If the
    method has a ``prepare``, that is called first and does not count. OSError if no file can be
    written.
    """
    boundary = _table(table)[method].boundary
    with TemporaryDirectory(prefix="cdcp_igl-") as folder:
        mesh, result, errors = (Path(folder, name) for name in ("mesh.npz", "result.npz", "errors"))
        with whole_file(mesh) as unfinished:  # whose errors have its name
            np.savez(unfinished, V=V, F=F)
        # -P: what lies in the folder where the user works is no module.
        command = [sys.executable, "-P", "-m", "cdcp_igl.reference.case"]
        command += [table, method, str(mesh), str(result)]
        # It has to find the same modules as this process.
        path = os.pathsep.join(entry for entry in sys.path if entry)
        with errors.open("wb") as stderr:
            process = subprocess.Popen(
                command,
                stdout=subprocess.DEVNULL,
                stderr=stderr,
                env=os.environ | {"PYTHONPATH": path},
            )
            try:
                excess = _watch(process, time_limit, memory_limit)
            finally:
                process.kill()
                process.wait()
        if excess:
            return Case(method, boundary, excess), None
        if process.returncode or not result.exists():
            cause = cause_of_death(process.returncode, errors.read_text())
            return Case(method, boundary, cause), None
        with np.load(result) as saved:
            measured = json.loads(str(saved["measured"]))
            uv = saved.get("uv")
    return Case(method, boundary, **measured), uv


def _table(name: str) -> Mapping[str, Any]:
    module, _, attribute = name.partition(":")
    return getattr(import_module(module), attribute)


def _watch(process: subprocess.Popen[bytes], time_limit: float, memory_limit: float) -> str:
    """Wait for a process to end; say which limit it passed, if one, leaving it running."""
    end = monotonic() + time_limit
    while True:
        try:
            process.wait(max(min(POLL, end - monotonic()), 0))
            return ""
        except subprocess.TimeoutExpired:
            if monotonic() >= end:
                return f"{TOO_LONG} {time_limit:g} s"
        if np.isfinite(memory_limit) and resident(process.pid) > memory_limit:
            return f"{TOO_LARGE} {memory_limit:,.0f} MiB of memory"


def measure(method: Any, mesh: str | Path) -> tuple[dict[str, Any], Floats | None]:
    """Run a method on the surface in a file, in this process; return what a `Case` has of it."""
    if prepare := getattr(method, "prepare", None):
        prepare()
    given = _surface(mesh)
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
    V, F = _surface(mesh)  # the method may have changed what it was given
    columns = 3 if method.boundary == "sphere" else 2
    if returned := _other_than_map(uv, len(V), columns):
        must = f"must return (n, {columns}) numbers, and returned {returned}"
        return {"outcome": f"failed: {must}"}, None
    uv = np.asarray(uv, dtype=np.float64)
    certificate, off = _certified(method.boundary, V, F, uv)
    if not (certificate.finite if method.boundary == "free" else certificate.valid):
        return {"outcome": f"not valid: {certificate}"}, None
    distortion = AngleDistortion.of(angle_distortion(V, F, uv))
    if not np.isfinite([distortion.mean, distortion.sd, distortion.max]).all():
        return {"outcome": f"not valid: angular distortion {distortion}"}, None
    return {
        "outcome": OK,
        **asdict(distortion),
        "area": float(abs(area_distortion(V, F, uv)).mean()),
        "flips": len(certificate.flipped),
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


def _surface(mesh: str | Path) -> tuple[Floats, Ints]:
    with np.load(mesh) as saved:
        return saved["V"], saved["F"]


def _main(table: str, method: str, mesh: str, result: str) -> None:
    measured, uv = measure(_table(table)[method], mesh)
    arrays: dict[str, Any] = {} if uv is None else {"uv": uv}
    np.savez(result, measured=json.dumps(measured), **arrays)


if __name__ == "__main__":
    from cdcp_igl.reference import case  # which tables of methods import, not a copy of it

    case._main(*sys.argv[1:])
