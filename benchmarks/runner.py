"""Run what is missing of a section: each case in a process of its own."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from cdcp_igl import MeshError, angle_distortion
from cdcp_igl.arrays import Floats, Ints
from cdcp_igl.reference import Method
from cdcp_igl.reference.case import run_case
from cdcp_igl.surface.mesh import DiskMesh

from .methods import COST
from .models import Model, digest
from .store import EDGES, Record, Work

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
    methods: Mapping[str, Method],
    *,
    table: str,
    limits: Limits,
    work: Work,
    repeats: Callable[[str, int], int] = lambda method, n: 1,
    console: Console | None = None,
) -> None:
    """Measure what the work folder does not have yet.

    The methods take turns, so that a machine that gets slower does not do so to one of them.

    Parameters
    ----------
    section : str
    models : sequence of Model
    methods : mapping of str to Method
        Those of `table` that are wanted.
    table : str
        Where a process finds them, as in `run_case`.
    limits : Limits
    work : Work
    repeats : callable
        Runs of a method on a model of n vertices; 0 for none.
    console : Console, optional
        For the progress bar.
    """
    done = {record.key for record in work.records()}
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, TimeRemainingColumn(), console=console, transient=True) as bar:
        surfaces = bar.add_task("reading the models", total=len(models))
        plan = []
        for model in models:
            plan += [(model, case) for case in _cases(section, model, methods, repeats)]
            bar.advance(surfaces)
        bar.remove_task(surfaces)

        missing = [(model, case) for model, case in plan if case.key not in done]
        task = bar.add_task("", total=sum(_weight(case) for _, case in missing))
        loaded: str | None = None
        for number, (model, case) in enumerate(missing, 1):
            bar.update(task, description=f"{number}/{len(missing)} {case.model}: {case.method}")
            if case.ok:
                if loaded != model.name:
                    V, F = model.load()
                    loaded = model.name
                work.append(*_measure(case, V, F, table, limits))
            else:
                work.append(case)
            bar.advance(task, _weight(case))


def _cases(
    section: str,
    model: Model,
    methods: Mapping[str, Method],
    repeats: Callable[[str, int], int],
) -> list[Record]:
    """Cases of a model in the order of measurement; all not "ok" if it is not to be had."""
    outcome, mesh, sizes = "ok", "", (0, 0, 0)
    try:
        V, F = model.load()
    except (OSError, ValueError, ImportError, MeshError) as error:
        outcome = f"not to be had: {error}"
    else:
        mesh, sizes = digest(V, F), (len(V), len(F), _boundary_size(V, F))
    rounds = {method: repeats(method, sizes[0]) for method in methods}
    return [
        Record(section, model.name, mesh, *sizes, method, repeat, methods[method].boundary, outcome)
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
    case: Record, V: Floats, F: Ints, table: str, limits: Limits
) -> tuple[Record, Floats | None]:
    made, uv = run_case(
        case.method, V, F, time_limit=limits.seconds, memory_limit=limits.mib, table=table
    )
    histogram: list[int] = []
    if uv is not None:
        degrees = angle_distortion(V, F, uv).ravel()
        histogram = np.histogram(degrees, [*EDGES, np.inf])[0].tolist()
    known = {name: getattr(case, name) for name in Record.__dataclass_fields__}
    record = Record(**known | asdict(made) | {"histogram": histogram})
    return record, uv if case.section == "tables" and case.repeat == 0 else None


def _weight(case: Record) -> float:
    return STARTING + COST.get(case.method, 1) * case.vertices if case.ok else 1
