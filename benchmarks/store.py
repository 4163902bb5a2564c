"""Records of measured cases, and the folder that keeps them while a run goes on.

The work folder is ``build/benchmarks/CODE/`` (not under version control), CODE a digest of the
sources of cdcp_igl and of the versions below it, so that numbers of different code never meet
in one table, whatever the commit is called::

    records.jsonl                one `Record` a line, in the order of measurement
    maps/MODEL--METHOD.npz       uv (n, 2) float64, of the section "tables"

A run that was killed goes on where it stopped: what has a line is not measured again. To start
over, delete the folder. The finished results, ``benchmarks/results/MACHINE.json``, hold the
same records together with the machine they are from.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

import cdcp_igl
from cdcp_igl.arrays import Floats
from cdcp_igl.io import whole_file

__all__ = ["EDGES", "OK", "RESULTS", "Record", "Work", "code", "read_results", "write_results"]

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "benchmarks" / "results"
WORK = ROOT / "build" / "benchmarks"
PACKAGES = ("libigl", "numpy", "scikit-sparse", "scipy")

OK = "ok"
EDGES: Floats = np.arange(201) / 20  # of the histogram, degrees: bins of 0.05 up to 10


@dataclass(frozen=True)
class Record:
    """One method, once, on one model; NaN or empty where there is no number.

    Attributes
    ----------
    section : str
        ``"tables"``, ``"speed"`` or ``"ablation"``.
    model : str
        Name; `benchmarks.models.find` has the surface.
    mesh : str
        Digest of V and F; empty if the model is not to be had.
    vertices, faces, boundary_vertices : int
        Sizes; 0 if the model is not to be had.
    method : str
        Key of `benchmarks.methods.METHODS`, or of ``ABLATIONS`` in the section "ablation".
    repeat : int
        From 0.
    boundary : str
        ``"disk"``; ``"free"``: compare on angles only; ``"none"``: a time and no map.
    outcome : str
        ``"ok"``, or why there is nothing: crash, time-out, memory, invalid map, no such model.
    mean, sd, max : float
        Angular distortion in degrees, of all corners.
    area : float
        Mean |log of the ratio of areas|.
    flips : float
        Faces that are not positively oriented; must be 0 on the disk.
    boundary_error : float
        Largest deviation of a boundary vertex from the unit circle.
    seconds : float
        Wall time of the method, from arrays to map, in a fresh process.
    memory : float
        Peak resident memory of that process in MiB.
    histogram : list of int
        Corners by angular distortion, between `EDGES`; one more for all beyond.
    details : dict
        `DiskMap.report()` of CDCP: ``details["seconds"]`` has the seconds per phase, and
        "boundary", "repair", "mobius", "center", "refinement", "solver" what was done. Of a
        "none": ``details["seconds"]`` only.
    """

    section: str
    model: str
    mesh: str
    vertices: int
    faces: int
    boundary_vertices: int
    method: str
    repeat: int
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
    histogram: Sequence[int] = ()
    details: Mapping[str, Any] = field(default_factory=dict)

    @property
    def ok(self) -> bool:
        """Whether there is a result."""
        return self.outcome == OK

    @property
    def key(self) -> tuple[str, str, str, str, int]:
        """What makes this case the same as one of another run."""
        return self.section, self.model, self.mesh, self.method, self.repeat

    def as_json(self) -> dict[str, Any]:
        """Return JSON types, None for NaN and infinity."""
        return {
            name: None if isinstance(value, float) and not np.isfinite(value) else value
            for name, value in asdict(self).items()
        }

    @classmethod
    def of_json(cls, row: Mapping[str, Any]) -> Record:
        """Undo `as_json`."""
        floats = {f.name for f in fields(cls) if f.type == "float"}
        return cls(**{k: np.nan if v is None and k in floats else v for k, v in row.items()})


class Work:
    """The folder with what has been measured so far.

    Parameters
    ----------
    folder : Path, optional
        By default that of the present code.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self.folder = folder or WORK / code()
        self._file = self.folder / "records.jsonl"

    def records(self) -> list[Record]:
        """All records, in the order of measurement; a half-written last line does not count."""
        return list(self._read())

    def _read(self) -> Iterator[Record]:
        if not self._file.exists():
            return
        for line in self._file.read_text(encoding="utf-8").splitlines(keepends=True):
            if line.endswith("\n"):
                yield Record.of_json(json.loads(line))

    def append(self, record: Record, uv: Floats | None = None) -> None:
        """Keep a record, and the map if there is one; once this returns, they are on disk."""
        self.folder.mkdir(parents=True, exist_ok=True)
        if uv is not None:
            path = self.map_path(record.model, record.method)
            path.parent.mkdir(exist_ok=True)
            with whole_file(path) as unfinished:
                np.savez(unfinished, uv=uv)
        with self._file.open("ab+") as file:
            end = file.seek(0, os.SEEK_END)
            if end:  # a line that a killed run left unfinished goes
                kept = self._file.read_bytes().rfind(b"\n") + 1
                file.truncate(kept)
            line = json.dumps(record.as_json(), ensure_ascii=False, allow_nan=False) + "\n"
            file.write(line.encode())
            file.flush()
            os.fsync(file.fileno())

    def map_path(self, model: str, method: str) -> Path:
        """Where the map of the section "tables" is kept, if it was valid."""
        name = f"{model}--{method}".replace("/", "_").replace(" ", "_")
        return self.folder / "maps" / f"{name}.npz"

    def map(self, model: str, method: str) -> Floats | None:
        """(n, 2) map of the section "tables", None where there is none."""
        path = self.map_path(model, method)
        if not path.exists():
            return None
        with np.load(path) as saved:
            return saved["uv"]


@cache
def code() -> str:
    """Digest of the sources of cdcp_igl and the versions of what is below it."""
    digest = hashlib.sha256()
    package = Path(cdcp_igl.__file__).parent
    for path in sorted(package.rglob("*.py")):
        digest.update(path.relative_to(package).as_posix().encode() + path.read_bytes())
    digest.update(repr([version(name) for name in PACKAGES]).encode())
    return digest.hexdigest()[:12]


def write_results(path: Path, machine: Mapping[str, Any], records: Sequence[Record]) -> None:
    """Write ``{"machine": ..., "records": [...]}``, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = [json.dumps(r.as_json(), ensure_ascii=False, allow_nan=False) for r in records]
    with whole_file(path) as unfinished:
        unfinished.write_text(
            '{"machine": '
            + json.dumps(machine, ensure_ascii=False, indent=1)
            + ',\n"records": [\n'
            + ",\n".join(rows)
            + "\n]}\n",
            encoding="utf-8",
        )


def read_results(path: Path) -> tuple[dict[str, Any], list[Record]]:
    """Read what `write_results` wrote."""
    content = json.loads(path.read_text(encoding="utf-8"))
    return content["machine"], [Record.of_json(row) for row in content["records"]]
