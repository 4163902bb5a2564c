"""The commands that measure: tables, speed, ablation."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from cdcp_igl.io import whole_file
from cdcp_igl.reference import Method

from . import ablation as ablations
from . import methods as measured
from . import models as surfaces
from .machine import default_name, describe, memory_mib, pin_threads
from .methods import METHODS, maps
from .models import Model
from .report import markdown
from .runner import Limits, run
from .store import RESULTS, WORK, Work, code, write_results

__all__ = ["Session", "ablation", "speed", "tables"]

SPEED_METHODS = ("factor", "cdcp", "cdcp refine=1", "cdcp refine=5", "lscm", "harmonic")
SPEED_MODELS = (
    *("chinese_lion", "stanford_bunny_31593", "human_brain", "itokawa_93920", "gcanyon_216196"),
    *("nefertiti_750281", "gcanyon_996999"),
)
SMALL_MODEL, SMALL_METHODS = "nefertiti_299", ("cdcp warm", "import")
REPEATED = ("factor", "cdcp")  # the others run once on large models
LARGE = 800_000  # vertices
ABLATION_MODELS = (
    *("nefertiti_299", "camelhead_11381", "chinese_lion", "human_face", "stanford_bunny_31593"),
    *("human_brain", "left_hand"),
)
MACHINE = default_name()

Models = Annotated[
    str, typer.Option(metavar="NAME,...", help="Names, paths, or patterns of either.")
]
Methods = Annotated[str, typer.Option(metavar="NAME,...", help="Of the methods.")]
Quick = Annotated[
    bool, typer.Option("--quick", help="Three small models; results go to the work folder.")
]
Machine = Annotated[str, typer.Option(metavar="NAME", help="Name of the results' files.")]
Out = Annotated[
    Path | None,
    typer.Option(metavar="FOLDER", help="For the results. [default: benchmarks/results]"),
]
WorkFolder = Annotated[
    Path | None,
    typer.Option(
        "--work",
        metavar="FOLDER",
        help="Of what is measured already. [default: build/benchmarks/...]",
    ),
]
TimeLimit = Annotated[float, typer.Option(metavar="SECONDS", min=0, help="Of each case.")]
MemoryLimit = Annotated[
    float, typer.Option(metavar="MIB", min=0, help="Of each case; 0: 3/4 of the memory.")
]
Threads = Annotated[int, typer.Option(min=1, help="Of BLAS and OpenMP.")]
Repeats = Annotated[int, typer.Option(min=1, help="Runs of each case.")]


def tables(
    models: Models = "",
    methods: Methods = "",
    quick: Quick = False,
    repeats: Repeats = 1,
    machine: Machine = MACHINE,
    out: Out = None,
    work: WorkFolder = None,
    time_limit: TimeLimit = 300,
    memory_limit: MemoryLimit = 0,
    threads: Threads = 1,
) -> None:
    """Measure Tables 1 and 2: distortion and time of all methods on all models.

    What is there already is not measured again. To start over, delete the work folder.
    """
    session = Session(quick, machine, out, work, time_limit, memory_limit, threads)
    session.run(
        "tables",
        session.models(models, ()),
        _chosen(METHODS, methods, ["factor", *maps()]),
        measured.TABLE,
        lambda method, n: repeats,
    )
    session.write()


def speed(
    models: Models = "",
    methods: Methods = "",
    quick: Quick = False,
    repeats: Repeats = 5,
    machine: Machine = MACHINE,
    out: Out = None,
    work: WorkFolder = None,
    time_limit: TimeLimit = 300,
    memory_limit: MemoryLimit = 0,
    threads: Threads = 1,
) -> None:
    """Measure times as multiples of one factorization, memory, growth; methods take turns.

    Above 800,000 vertices all but CDCP and the factorization run once.

    What is there already is not measured again. To start over, delete the work folder.
    """
    session = Session(quick, machine, out, work, time_limit, memory_limit, threads)

    def runs(method: str, n: int) -> int:
        return 1 if n > LARGE and method not in REPEATED else repeats

    if not methods:
        small = session.models("", (SMALL_MODEL,))[:1]
        session.run("speed", small, _chosen(METHODS, "", SMALL_METHODS), measured.TABLE, runs)
    wanted = _chosen(METHODS, methods, SPEED_METHODS)
    session.run("speed", session.models(models, SPEED_MODELS), wanted, measured.TABLE, runs)
    session.write()


def ablation(
    models: Models = "",
    methods: Methods = "",
    quick: Quick = False,
    machine: Machine = MACHINE,
    out: Out = None,
    work: WorkFolder = None,
    time_limit: TimeLimit = 300,
    memory_limit: MemoryLimit = 0,
    threads: Threads = 1,
) -> None:
    """Measure CDCP with a step left out or replaced: Möbius, centre, trace, whitening, zipper.

    What is there already is not measured again. To start over, delete the work folder.
    """
    session = Session(quick, machine, out, work, time_limit, memory_limit, threads)
    session.run(
        "ablation",
        session.models(models, ABLATION_MODELS),
        _chosen(ablations.ABLATIONS, methods, tuple(ablations.ABLATIONS)),
        ablations.TABLE,
        lambda method, n: 1,
    )
    session.write()


def _split(text: str) -> list[str]:
    return [name for name in text.split(",") if name]


def _chosen(table: Mapping[str, Method], wanted: str, default: Sequence[str]) -> dict[str, Method]:
    names = _split(wanted) or default
    for name in names:
        if name not in table:
            raise typer.BadParameter(f"{name!r} is not one of {', '.join(table)}.")
    return {name: table[name] for name in names}


class Session:
    """Where to work, within which limits, and where the results go."""

    def __init__(
        self,
        quick: bool,
        machine: str,
        out: Path | None,
        work: Path | None,
        time_limit: float,
        memory_limit: float,
        threads: int,
    ) -> None:
        self._quick, self._threads = quick, threads
        self._work = Work(work or WORK / f"{'quick-' if quick else ''}{code()}")
        self._target = (out or (self._work.folder if quick else RESULTS)) / machine
        self._limits = Limits(time_limit, memory_limit or round(0.75 * memory_mib()))

    def models(self, wanted: str, default: Sequence[str]) -> list[Model]:
        """Find those wanted, or the default; of a quick run, three small ones."""
        if self._quick and not wanted:
            return surfaces.quick()
        return surfaces.find(_split(wanted) or default)

    def run(
        self,
        section: str,
        models: Sequence[Model],
        methods: Mapping[str, Method],
        table: str,
        repeats: Callable[[str, int], int],
    ) -> None:
        """Measure what is missing of a section."""
        pin_threads(self._threads)
        run(
            *(section, models, methods),
            table=table,
            limits=self._limits,
            work=self._work,
            repeats=repeats,
            console=Console(stderr=True),
        )

    def write(self) -> None:
        """Write all that the work folder has."""
        records = self._work.records()
        sections = dict.fromkeys(record.section for record in records)
        now = sys.argv[1:] if sys.argv[1:2] and sys.argv[1] in sections else []
        commands = [now if now[:1] == [section] else [section] for section in sections]
        command = " && ".join(shlex.join(["python", "-m", "benchmarks", *c]) for c in commands)
        machine = describe(self._threads, command) | {
            "time_limit": self._limits.seconds,
            "memory_limit": self._limits.mib,
        }
        write_results(self._target.with_name(self._target.name + ".json"), machine, records)
        page = self._target.with_name(self._target.name + ".md")
        with whole_file(page) as unfinished:
            unfinished.write_text(markdown(machine, records), encoding="utf-8")
        typer.echo(page)
