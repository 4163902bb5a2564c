"""Run what is missing of a section: each case is a job, and has a process of its own."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, replace

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from cdcp_igl import MapError, MeshError, SolverError, angle_distortion
from cdcp_igl.reference.case import OK, TOO_LARGE, TOO_LONG, Case, run_case
from cdcp_igl.scale.batching.names import Shard, shard_of
from cdcp_igl.solve.solvers import solver
from cdcp_igl.surface.mesh import DiskMesh

from ..records.record import EDGES, Record
from ..records.store import Work
from .candidate import Candidate
from .methods import COST
from .models import Model, as_disk, as_sphere

TABLE = "benchmarks.measure.methods:METHODS"  # where a process finds a method
STARTING = 50_000  # vertices on which CDCP takes as long as a process to start
NOT_THERE = (OSError, ValueError, ImportError, MeshError, SolverError, MapError)


@dataclass(frozen=True)
class Limits:
    """Of each case.

    Attributes
    ----------
    seconds : float
    mib : float
        Of resident memory.
    threads : int
        Of BLAS and OpenMP, which are to be pinned before.
    """

    seconds: float
    mib: float
    threads: int = 1

    def leave_more_to(self, record: Record) -> bool:
        """Whether a case that was ended by its limit may get further under this one."""
        outcome = record.case.outcome
        late = outcome.startswith(TOO_LONG) and self.seconds > record.time_limit
        return late or (outcome.startswith(TOO_LARGE) and self.mib > record.memory_limit)


@dataclass(frozen=True)
class Measurement:
    """A case to be measured.

    Attributes
    ----------
    record : Record
        Without the numbers.
    limits : Limits
    work : Work
        Has the surface; gets the map.
    """

    record: Record
    limits: Limits
    work: Work

    def run(self) -> Record:
        """Measure, in a process of its own."""
        surface = self.work.surface(self.record.mesh)
        if surface is None:
            return self.failed("FileNotFoundError", "the surface is not in the work folder")
        case, uv = run_case(
            self.record.case.method,
            *surface,
            time_limit=self.limits.seconds,
            memory_limit=self.limits.mib,
            table=TABLE,
        )
        histogram: list[int] = []
        if uv is not None:
            degrees = angle_distortion(*surface, uv).ravel()
            histogram = np.histogram(degrees, [*EDGES, np.inf])[0].tolist()
            shown = self.record.section == "tables" and case.boundary != "sphere"
            if shown and self.record.repeat == 0:
                self.work.keep_map(self.record, uv)
        return replace(self.record, case=case, histogram=histogram)

    def failed(self, error: str, message: str) -> Record:
        """Make the record of a case that did not come back."""
        of = self.record.case
        return replace(self.record, case=Case(of.method, of.boundary, f"{error}: {message}"))


def run(
    section: str,
    models: Sequence[Model],
    methods: Mapping[str, Candidate],
    *,
    limits: Limits,
    work: Work,
    repeats: Callable[[str, int], int] = lambda method, n: 1,
    jobs: int = 1,
    shard: Shard | None = None,
    console: Console | None = None,
) -> list[Record]:
    """Measure what the work folder does not have yet.

    The methods take turns, so that a machine that gets slower does not do so to one of them.

    Parameters
    ----------
    section : str
    models : sequence of Model
    methods : mapping of str to Candidate
        Those of `METHODS` that are wanted.
    limits : Limits
    work : Work
    repeats : callable
        Runs of a method on a model of n vertices; 0 for none.
    jobs : int
        Cases that are measured side by side.
    shard : (int, int), optional
        Part i of n of the models, from 1, whatever other machines do in the same folder.
    console : Console, optional
        For the progress bar.

    Returns
    -------
    list of Record
        Of all these cases, those that were there already too.

    Raises
    ------
    OSError
        If another run is writing to the work folder, or it cannot be written.
    """
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with (
        work.journal(shard) as journal,
        Progress(*columns, TimeRemainingColumn(), console=console, transient=True) as bar,
        ThreadPoolExecutor(jobs) as executor,
    ):
        done = {r.key: r for r in work.records() if not limits.leave_more_to(r)}
        plan: list[Record] = []
        for model in bar.track(shard_of(models, shard), description="reading the models"):
            for spheres in (False, True):
                of = {k: m for k, m in methods.items() if (m.boundary == "sphere") == spheres}
                plan += _cases(section, model, of, spheres, repeats, limits, work) if of else ()
        missing = [record for record in plan if record.key not in done]
        done |= {record.key: record for record in missing if not record.ok}
        to_run = [Measurement(record, limits, work) for record in missing if record.ok]
        task = bar.add_task("", total=sum(_weight(one.record) for one in to_run))
        measured = {executor.submit(one.run): one for one in to_run}
        try:
            for number, future in enumerate(as_completed(measured), 1):
                try:
                    record = future.result()
                except Exception as error:
                    record = measured[future].failed(type(error).__name__, str(error))
                journal.append(record.line())
                done[record.key] = record
                text = f"{number}/{len(to_run)} {record.model}: {record.case.method}"
                bar.update(task, advance=_weight(record), description=text)
        finally:
            executor.shutdown(cancel_futures=True)
    return [done[record.key] for record in plan]


def _cases(
    section: str,
    model: Model,
    methods: Mapping[str, Candidate],
    spheres: bool,
    repeats: Callable[[str, int], int],
    limits: Limits,
    work: Work,
) -> Iterator[Record]:
    """Yield the cases of a model in the order of measurement; not "ok" if something is missing.

    All methods map onto the sphere, which yields none of other models, or none does.
    """
    reason, mesh, sizes = "", "", (0, 0, 0)
    try:
        mesh, V, F = as_sphere(model, work) if spheres else as_disk(model, work)
        sizes = len(V), len(F), 0 if spheres else len(DiskMesh(V, F).loop)
    except NOT_THERE as error:
        if spheres:
            return
        reason = f"not to be had: {error}"
    reasons = {method: reason or one.missing() for method, one in methods.items()}
    rounds = {method: repeats(method, sizes[0]) for method in methods}
    for repeat in range(max(rounds.values(), default=0)):
        for method in methods:
            if repeat < rounds[method]:
                case = Case(method, methods[method].boundary, reasons[method] or OK)
                source = methods[method].source
                yield Record(
                    *(section, model.name, mesh, *sizes, repeat, case),
                    source=source,
                    threads=limits.threads,
                    solver=solver().PACKAGE,
                    time_limit=limits.seconds,
                    memory_limit=limits.mib,
                )


def _weight(record: Record) -> float:
    return STARTING + COST.get(record.case.method, 1) * record.vertices
