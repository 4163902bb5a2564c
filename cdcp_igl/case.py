"""One method on one mesh, in a process of its own: what comparisons are made of.

Run as ``python -m cdcp_igl.case METHOD MESH.npz RESULT.npz`` it is that process.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .arrays import Floats, Ints
from .distortion import AngleDistortion, angle_distortion, area_distortion
from .errors import MapError, SolverError
from .injectivity import certify
from .mesh import DiskMesh

__all__ = ["Case", "run_case"]

OK = "ok"


@dataclass(frozen=True)
class Case:
    """What one method made of one mesh.

    Attributes
    ----------
    method : str
        Name in `reference.METHODS`.
    boundary : str
        ``"disk"`` or ``"free"``; a map with free boundary is no disk.
    outcome : str
        ``"ok"``, or why there is no map: the error, the signal, the time limit.
    mean, sd, max : float
        Angular distortion in degrees; NaN, as everything below, where there is no map.
    area : float
        Area distortion: mean |log of the ratio of areas| of the faces, both areas as shares
        of their totals; infinite if a face has collapsed or flipped.
    flips : float
        Number of faces that are not positively oriented.
    boundary_error : float
        Largest deviation of a boundary vertex from the unit circle.
    seconds : float
        Wall time of the method, from arrays to map, in a fresh process.
    memory : float
        Peak memory of that process in MiB, Python and the mesh included.
    """

    method: str
    boundary: str
    outcome: str
    mean: float = np.nan
    sd: float = np.nan
    max: float = np.nan
    area: float = np.nan
    flips: float = np.nan
    boundary_error: float = np.nan
    seconds: float = np.nan
    memory: float = np.nan

    def as_json(self) -> dict[str, Any]:
        """Return the attributes as JSON types, None for what is not a finite number."""
        return {
            name: None if isinstance(value, float) and not np.isfinite(value) else value
            for name, value in asdict(self).items()
        }


def run_case(
    method: str, V: ArrayLike, F: ArrayLike, *, time_limit: float
) -> tuple[Case, Floats | None]:
    """Run a method in a fresh process, which it may crash.

    Parameters
    ----------
    method : str
        Name in `reference.METHODS`.
    V : (n, 3) array_like
        Vertex positions.
    F : (m, 3) array_like of integers
        Corners of the faces.
    time_limit : float
        Seconds after which the process is killed.

    Returns
    -------
    Case
    uv : (n, 2) float64 or None
        The map, if there is one.
    """
    from .reference import METHODS

    boundary = METHODS[method].boundary
    with TemporaryDirectory(prefix="cdcp_igl-") as folder:
        mesh, result = Path(folder, "mesh.npz"), Path(folder, "result.npz")
        np.savez(mesh, V=V, F=F)
        command = [sys.executable, "-m", "cdcp_igl.case", method, str(mesh), str(result)]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=time_limit)
        except subprocess.TimeoutExpired:
            return Case(method, boundary, f"no result within {time_limit:g} s"), None
        if done.returncode or not result.exists():
            return Case(method, boundary, _why(done)), None
        with np.load(result) as saved:
            measured = json.loads(str(saved["measured"]))
            uv = saved.get("uv")
    return Case(method, boundary, **measured), uv


def _why(done: subprocess.CompletedProcess[str]) -> str:
    if done.returncode < 0:
        return f"crashed: {signal.Signals(-done.returncode).name}"
    return f"failed: {(done.stderr.strip().splitlines() or ['no message'])[-1]}"


def _measure(method: str, V: Floats, F: Ints) -> tuple[dict[str, Any], Floats | None]:
    from .reference import METHODS

    start = perf_counter()
    try:
        uv = METHODS[method].function(V, F)
    except (MapError, SolverError) as error:
        return {"outcome": f"{type(error).__name__}: {error}"}, None
    seconds = perf_counter() - start
    memory = _peak_memory()
    certificate = certify(DiskMesh(V, F), uv)
    return {
        "outcome": OK,
        **asdict(AngleDistortion.of(angle_distortion(V, F, uv))),
        "area": float(abs(area_distortion(V, F, uv)).mean()),
        "flips": len(certificate.flipped),
        "boundary_error": certificate.boundary_error,
        "seconds": seconds,
        "memory": memory,
    }, uv


def _peak_memory() -> float:
    import resource  # not on every system, and needed only here

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 2**20 if sys.platform == "darwin" else peak / 2**10


def _main(method: str, mesh: str, result: str) -> None:
    with np.load(mesh) as saved:
        V, F = saved["V"], saved["F"]
    measured, uv = _measure(method, V, F)
    arrays: dict[str, Any] = {} if uv is None else {"uv": uv}
    np.savez(result, measured=json.dumps(measured), **arrays)


FIELDS = tuple(field.name for field in fields(Case))

if __name__ == "__main__":
    _main(*sys.argv[1:])
