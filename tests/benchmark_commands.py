"""The command line of the benchmarks, and records of them, for their tests."""

import os
import sys
from pathlib import Path
from unittest import mock

import meshes
import numpy as np
from typer.testing import CliRunner

from benchmarks.commands import app
from benchmarks.measure.cases import Limits, run
from benchmarks.measure.machine import describe
from benchmarks.measure.methods import METHODS
from benchmarks.measure.models import Model
from benchmarks.records.record import EDGES, Record
from benchmarks.records.store import Work
from cdcp_igl.phases import PHASES
from cdcp_igl.reference.case import OK, Case

ROOT = Path(__file__).parents[1]
GRID = Model("grid", lambda: meshes.grid(8, 9))
LIMITS = Limits(60, 4000)
MACHINE = describe(1) | {"time_limit": 60, "memory_limit": 4000, "commands": {"tables": "again"}}


def benchmarks(*arguments, path=()):
    """Run a command without meshes at hand; it sets the threads for the processes of its cases."""
    arguments = [str(argument) for argument in arguments]
    with (
        mock.patch.dict(os.environ),
        mock.patch.object(sys, "argv", ["benchmarks", *arguments]),
        mock.patch.object(sys, "path", [*map(str, path), *sys.path]),
    ):
        os.environ.pop("CDCP_IGL_DATA", None)
        return CliRunner().invoke(app, arguments)


def refused(*arguments):
    """Run a command that ends before it measures; return what it says, in one line."""
    done = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert done.exit_code == 2, done.output
    return in_one_line(done.output)


def in_one_line(told):
    """What a command says, without the frame and the lines that depend on the window."""
    return " ".join(told.replace("│", "").split())


def measure(folder, names, models=(GRID,), section="tables", limits=LIMITS, **options):
    """Measure methods, each in a process of its own."""
    methods = {name: METHODS[name] for name in names}
    return run(section, models, methods, limits=limits, work=Work(folder), **options)


def record(model, method, section="tables", *, outcome=OK, n=100, repeat=0, histogram=(), **made):
    """A record as if the method had made that of the model."""
    case = Case(method, made.pop("boundary", "disk"), outcome, **made)
    return Record(section, model, "digest", n, 2 * n, 18, repeat, case, histogram)


SECONDS = {"factor": 0.5, "cdcp": 1.0, "fdcp": 7.0, "ldcp": 2.0, "harmonic": 0.5}
MEANS = {"factor": np.nan, "cdcp": 1.2, "fdcp": 1.1, "ldcp": 1.3, "harmonic": 5.0}


def typical(model, method, section="tables", *, n=100, repeat=0):
    """A record with all its numbers, as if seconds grew like n^1.1."""
    seconds = SECONDS.get(method, 3.0) * (n / 20_000) ** 1.1
    counts = np.zeros(len(EDGES), dtype=int)
    counts[: 10 * (2 + len(method))] = 100
    of_map = {
        **{"mean": MEANS.get(method, 1.5), "sd": 2.0, "max": 50.0, "area_sd": 1.0, "flips": 0.0},
        **{"texels": 3.0},
        **{"boundary_error": 1e-16, "histogram": counts.tolist()},
    }
    phases = {"cdcp": PHASES, "factor": ("analyse", "factor")}.get(method, ())
    shares = dict.fromkeys(phases, seconds / max(len(phases), 1))
    return record(
        *(model, method, section),
        **{"n": n, "repeat": repeat, "seconds": seconds, "memory": 200.0},
        **({"boundary": "none"} if method == "factor" else of_map),
        details={"seconds": shares},
    )
