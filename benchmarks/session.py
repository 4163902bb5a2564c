"""What the measuring commands share: their options, and where the results go."""

from __future__ import annotations

import inspect
import shlex
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from tempfile import TemporaryFile
from typing import Annotated, Any, get_type_hints

import typer
from rich.console import Console

from cdcp_igl.io.output import write_text
from cdcp_igl.scale.batching.names import read_shard
from cdcp_igl.solve.solvers import solver

from .measure import models as surfaces
from .measure.cases import Limits, run
from .measure.machine import MACHINE, describe, memory_mib, pin_threads
from .measure.methods import METHODS
from .measure.models import TIERS, Model
from .measure.worker import WorkFolder
from .records.record import Record
from .records.results import Measured
from .records.store import Work, code, read_results, write_results, write_rows
from .write.report import as_markdown

Models = Annotated[
    str, typer.Option(metavar="NAME,...", help="Names, paths, or patterns of either.")
]
Machine = Annotated[str, typer.Option(metavar="NAME", help="Name of the results' files.")]
Out = Annotated[
    Path | None, typer.Option(metavar="FOLDER", help="For the results; else the work folder.")
]


@dataclass
class Session:
    """Options of a command that measures; where to work, and where the results go."""

    models: Models = ""
    methods: Annotated[
        str, typer.Option(metavar="NAME,...", help="Of the methods, or all; with options behind.")
    ] = ""
    method: Annotated[
        list[str] | None,
        typer.Option(metavar="MODULE:FUNCTION", help="One more, as in --methods."),
    ] = None
    tier: Annotated[
        str, typer.Option(metavar="|".join(TIERS), help="Of CDCP-bench: 8, 60 or 300 surfaces.")
    ] = ""
    machine: Machine = MACHINE
    out: Out = None
    work: WorkFolder = None
    time_limit: Annotated[float, typer.Option(metavar="SECONDS", min=0, help="Of each case.")] = 300
    memory_limit: Annotated[
        float, typer.Option(metavar="MIB", min=0, help="Of each case; 0: 3/4 of all by the jobs.")
    ] = 0
    threads: Annotated[int, typer.Option(min=1, help="Of BLAS and OpenMP.")] = 1
    jobs: Annotated[
        int, typer.Option(min=1, help="Cases side by side; their seconds are a hint.")
    ] = 1
    shard: Annotated[
        str, typer.Option(metavar="I/N", help="Measure part I of N only: for several machines.")
    ] = ""

    def __post_init__(self) -> None:
        self.kept = Work(self.work)
        share = round(0.75 * memory_mib() / self.jobs)
        self.limits = Limits(self.time_limit, self.memory_limit or share, self.threads)
        try:
            self.part = read_shard(self.shard) if self.shard else None
        except ValueError as error:
            raise typer.BadParameter(str(error), param_hint="--shard") from error
        if self.tier and (self.tier not in TIERS or self.models):
            text = f"one of {', '.join(TIERS)}, without --models"
            raise typer.BadParameter(text, param_hint="--tier")

    @property
    def results(self) -> Path:
        """The file of results."""
        name = f"{self.machine}-{self.tier}" if self.tier else self.machine
        return (self.out or self.kept.folder) / f"{name}.json"

    def wanted_models(self, default: Sequence[str] = ()) -> list[Model]:
        """Find those wanted, a tier, the default, or all."""
        if self.tier:
            return surfaces.tier(self.tier)
        if self.models:
            try:
                return surfaces.find(_split(self.models))
            except ValueError as error:
                raise typer.BadParameter(str(error), param_hint="--models") from error
        return surfaces.by_name(default) if default else surfaces.find()

    def wanted_methods(self, default: Sequence[str]) -> list[str]:
        """Choose the methods wanted, or the default."""
        names = default if self.methods in ("", "all") else _split(self.methods)
        names = [*names, *(self.method or ())]
        try:
            return [name for name in names if METHODS[name]]
        except ValueError as error:
            text = f"{error}. There are {', '.join(METHODS)}, and MODULE:FUNCTION."
            raise typer.BadParameter(text, param_hint="--methods") from error

    def run(
        self,
        section: str,
        models: Sequence[Model],
        methods: Sequence[str],
        repeats: Callable[[str, int], int] = lambda *_: 1,
    ) -> list[Record]:
        """Measure what is missing of a section."""
        self._check()
        pin_threads(self.threads)
        with _no_os_error("--work"):
            return run(
                *(section, models, {name: METHODS[name] for name in methods}),
                limits=self.limits,
                work=self.kept,
                repeats=repeats,
                jobs=self.jobs,
                shard=self.part,
                console=Console(stderr=True),
            )

    def _check(self) -> None:
        """Find out before all is measured that it could not be, or not be written."""
        try:
            solver()
        except (ValueError, ImportError) as error:
            raise typer.BadParameter(str(error), param_hint="CDCP_IGL_SOLVER") from error
        if self.part is None:
            self.earlier()
            with _no_os_error("--out" if self.out else "--work"):
                self.results.parent.mkdir(parents=True, exist_ok=True)
                TemporaryFile(dir=self.results.parent).close()

    def earlier(self) -> tuple[dict[str, Any], list[Record]]:
        """Read the results that are there; nothing if there are none."""
        try:
            return read_results(self.results) if self.results.exists() else ({}, [])
        except ValueError as error:
            raise typer.BadParameter(str(error), param_hint="--out, --machine") from error

    def write(self, section: str, records: Sequence[Record]) -> Measured:
        """Write the results of a section; those of other sections stay if the code is the same.

        A part of a section is not written.
        """
        if self.part is not None:
            return Measured(records)
        command = shlex.join(["python", "-m", "benchmarks", *sys.argv[1:]])
        commands, others = {section: command}, []
        about, earlier = self.earlier()
        if about.get("code") == code():
            others = [record for record in earlier if record.section != section]
            commands = about["commands"] | commands
        machine = describe(self.threads) | {
            "time_limit": self.limits.seconds,
            "memory_limit": self.limits.mib,
            "commands": commands,
        }
        write_results(self.results, machine, [*others, *records])
        write_rows(self.results.with_suffix(".csv"), [*others, *records])
        measured = Measured([*others, *records])
        write_text(self.results.with_suffix(".md"), as_markdown(machine, measured))
        return measured


def with_session(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command that takes a `Session` the options of one instead."""
    own = list(inspect.signature(command, eval_str=True).parameters.values())[1:]
    hints = get_type_hints(Session, include_extras=True)
    shared = [
        p.replace(annotation=hints[p.name]) for p in inspect.signature(Session).parameters.values()
    ]

    @wraps(command)
    def with_options(**options: Any) -> None:
        session = Session(**{p.name: options.pop(p.name) for p in shared})
        command(session, **options)

    parameters = [p.replace(kind=p.KEYWORD_ONLY) for p in [*shared, *own]]
    with_options.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    with_options.__annotations__ = {p.name: p.annotation for p in parameters}
    del with_options.__wrapped__
    return with_options


@contextmanager
def _no_os_error(option: str) -> Iterator[None]:
    """Turn what the system refuses into a message about an option."""
    try:
        yield
    except OSError as error:
        reason = f"{error.filename}: {error.strerror}"
        raise typer.BadParameter(reason, param_hint=option) from error


def _split(text: str) -> list[str]:
    return [name for name in text.split(",") if name]
