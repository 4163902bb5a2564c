"""Run what is missing of a section: each case in a process of its own."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from cdcp_igl import MeshError, angle_distortion
from cdcp_igl.arrays import Floats, Ints
from cdcp_igl.reference.case import OK, Case, run_case
from cdcp_igl.surface.mesh import DiskMesh

from ..records.record import EDGES, Record
from ..records.store import Work
from .candidate import Candidate
from .methods import COST
from .models import Model, digest

__all__ = ["Limits", "run"]

STARTING = 50_000  # vertices on which CDCP takes as long as a process to start


@dataclass(frozen=True)
class Limits:
    """Of each case.

    Attributes
    ----------
    seconds : float
    mib : float
        Of resident memory.
    """

    seconds: float
    mib: float


def run(
    section: str,
    models: Sequence[Model],
    methods: Mapping[str, Candidate],
    *,
    table: str,
    limits: Limits,
    work: Work,
    repeats: Callable[[str, int], int] = lambda method, n: 1,
    console: Console | None = None,
) -> list[Record]:
    """Measure what the work folder does not have yet.

    The methods take turns, so that a machine that gets slower does not do so to one of them.

    Parameters
    ----------
    section : str
    models : sequence of Model
    methods : mapping of str to Candidate
        Those of `table` that are wanted.
    table : str
        Where a process finds them, as in `run_case`.
    limits : Limits
    work : Work
    repeats : callable
        Runs of a method on a model of n vertices; 0 for none.
    console : Console, optional
        For the progress bar.

    Returns
    -------
    list of Record
        Of all these cases, those that were there already too.
    """
    done = {record.key: record for record in work.records()}
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, TimeRemainingColumn(), console=console, transient=True) as bar:
        surfaces = bar.add_task("reading the models", total=len(models))
        plan = []
        for model in models:
            plan += [(model, case) for case in _cases(section, model, methods, repeats)]
            bar.advance(surfaces)
        bar.remove_task(surfaces)

        missing = [(model, record) for model, record in plan if record.key not in done]
        task = bar.add_task("", total=sum(_weight(record) for _, record in missing))
        loaded: str | None = None
        for number, (model, record) in enumerate(missing, 1):
            text = f"{number}/{len(missing)} {record.model}: {record.case.method}"
            bar.update(task, description=text)
            if record.ok:
                if loaded != model.name:
                    V, F = model.load()
                    loaded = model.name
                record, uv = _measure(record, V, F, table, limits)
                work.append(record, uv)
            done[record.key] = record
            bar.advance(task, _weight(record))
    return [done[record.key] for _, record in plan]


def _cases(
    section: str,
    model: Model,
    methods: Mapping[str, Candidate],
    repeats: Callable[[str, int], int],
) -> list[Record]:
    """Cases of a model in the order of measurement; not "ok" if it or the method is missing."""
    reason, mesh, sizes = "", "", (0, 0, 0)
    try:
        V, F = model.load()
    except (OSError, ValueError, ImportError, MeshError) as error:
        reason = f"not to be had: {error}"
    else:
        mesh, sizes = digest(V, F), (len(V), len(F), _boundary_size(V, F))
    reasons = {method: reason or one.missing() for method, one in methods.items()}
    rounds = {method: repeats(method, sizes[0]) for method in methods}
    return [
        Record(
            *(section, model.name, mesh, *sizes, repeat),
            Case(method, methods[method].boundary, reasons[method] or OK),
            source=methods[method].source,
        )
        for repeat in range(max(rounds.values(), default=0))
        for method in methods
        if repeat < rounds[method]
    ]


def _boundary_size(V: Floats, F: Ints) -> int:
    try:
        return len(DiskMesh(V, F).loop)
    except MeshError:
        return 0  # every method will say what is wrong


def _measure(
    record: Record, V: Floats, F: Ints, table: str, limits: Limits
) -> tuple[Record, Floats | None]:
    made, uv = run_case(
        record.case.method, V, F, time_limit=limits.seconds, memory_limit=limits.mib, table=table
    )
    histogram: list[int] = []
    if uv is not None:
        degrees = angle_distortion(V, F, uv).ravel()
        histogram = np.histogram(degrees, [*EDGES, np.inf])[0].tolist()
    kept = uv if record.section == "tables" and record.repeat == 0 else None
    return replace(record, case=made, histogram=histogram), kept


def _weight(record: Record) -> float:
    return STARTING + COST.get(record.case.method, 1) * record.vertices if record.vertices else 1
