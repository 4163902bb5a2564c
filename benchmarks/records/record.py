"""What was measured of one case."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np

from cdcp_igl.arrays import Floats
from cdcp_igl.printing import finite
from cdcp_igl.reference.case import OK, Case

OPENED, CLOSED = "-opened", "-closed"
LIMITS = {"time_limit", "memory_limit"}
EDGES: Floats = np.arange(201) / 20  # of the histogram, degrees: bins of 0.05 up to 10


@dataclass(frozen=True)
class Record:
    """One method, once, on one model.

    Attributes
    ----------
    section : str
        ``"tables"``, ``"speed"``, ``"growth"`` or ``"ablation"``.
    model : str
        Name; `benchmarks.measure.models.find` has the surface.
    mesh : str
        Digest of V and F; empty if the model is not to be had. If that was opened to a disk, it
        ends with `OPENED`, and the sizes are those of the disk; mapped onto the sphere, `CLOSED`.
    vertices, faces, boundary_vertices : int
        Sizes; 0 if the model is not to be had.
    repeat : int
        From 0.
    case : Case
        What the method made; its outcome also says so if there is no such model.
    histogram : list of int
        Corners by angular distortion, between `EDGES`; one more for all beyond.
    source : str
        Digest of the file of a method of one's own.
    threads : int
        Of BLAS and OpenMP.
    solver : str
        Which factored, with its version; empty in old results.
    time_limit, memory_limit : float
        Seconds and MiB that the case had.
    """

    section: str
    model: str
    mesh: str
    vertices: int
    faces: int
    boundary_vertices: int
    repeat: int
    case: Case
    histogram: Sequence[int] = ()
    source: str = ""
    threads: int = 1
    solver: str = ""
    time_limit: float = np.inf
    memory_limit: float = np.inf

    @property
    def ok(self) -> bool:
        """Whether there is a result."""
        return self.case.outcome == OK

    @property
    def key(self) -> tuple[str | int, ...]:
        """What makes this case the same as one of another run."""
        case = self.section, self.model, self.mesh, self.case.method, self.source, self.repeat
        return *case, self.threads, self.solver

    @property
    def digest(self) -> str:
        """The key, short enough for the name of a file."""
        return hashlib.sha256(repr(self.key).encode()).hexdigest()[:12]

    def row(self) -> dict[str, Any]:
        """Return all fields, those of the case beside the others."""
        own = asdict(self)
        return own | own.pop("case")

    def as_json(self) -> dict[str, Any]:
        """Return `row` as JSON types, None for NaN and infinity."""
        return finite(self.row())

    def line(self) -> str:
        """Return it as one line of JSON."""
        return json.dumps(self.as_json(), ensure_ascii=False, allow_nan=False) + "\n"

    @classmethod
    def of_json(cls, row: Mapping[str, Any]) -> Record:
        """Undo `as_json`."""
        floats = {f.name for f in fields(Case) if f.type == "float"}
        made: dict[str, Any] = {f.name: row[f.name] for f in fields(Case) if f.name in row}
        made |= {name: np.nan for name in floats & made.keys() if made[name] is None}
        own = {f.name: row[f.name] for f in fields(cls) if f.name in row}
        own |= {name: np.inf for name in LIMITS & own.keys() if own[name] is None}
        return cls(**own, case=Case(**made))
