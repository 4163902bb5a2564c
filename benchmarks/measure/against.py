"""Two commits of the library in turn: which is faster, on one machine at one time."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from io import BytesIO
from itertools import chain, product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from zipfile import ZipFile

import numpy as np
import typer

from cdcp_igl import disk_map
from cdcp_igl.arrays import Floats

from ..records.store import ROOT
from ..write.table import Cell, entitled, name, number, word
from .methods import METHODS
from .models import Model

ENOUGH = 0.1  # seconds of a turn, in which small surfaces are mapped again and again
SHOWN = 0.02  # the share in the time of a map from which on a phase has a row
Answer = dict[str, dict[str, float]]


@contextmanager
def code_of(commit: str) -> Iterator[Path]:
    """Write the library as it was at a commit to a folder."""
    command = ["git", "-C", str(ROOT), "archive", "--format=zip", commit, "cdcp_igl"]
    archive = subprocess.run(command, capture_output=True)
    if archive.returncode:
        raise typer.BadParameter(archive.stderr.decode().strip(), param_hint="--against")
    with TemporaryDirectory() as folder:
        ZipFile(BytesIO(archive.stdout)).extractall(folder)
        yield Path(folder)


@contextmanager
def mapping_by(code: Path) -> Iterator[subprocess.Popen[str]]:
    """Start a process that maps by the library in a folder."""
    environment = os.environ | {"PYTHONPATH": str(code)}
    script = [sys.executable, str(Path(__file__).with_name("turn.py"))]
    pipes: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen(script, env=environment, **pipes) as process:
        yield process


def _ask(process: subprocess.Popen[str], **request: Any) -> Answer:
    assert process.stdin
    assert process.stdout
    process.stdin.write(json.dumps(request) + "\n")
    process.stdin.flush()
    if not (line := process.stdout.readline()):
        raise typer.Exit(1)  # it has told why
    answer: Answer = json.loads(line)
    return answer


def _options(method: str) -> dict[str, Any]:
    """Options of `disk_map` that the name of a method stands for."""
    function = METHODS[method].function
    if getattr(function, "func", function) is not disk_map:
        raise typer.BadParameter(f"{method!r} is not cdcp, with options", param_hint="--methods")
    return getattr(function, "keywords", {})


@entitled("against")
def against(
    commit: str, models: Sequence[Model], methods: Sequence[str], rounds: int
) -> tuple[Sequence[str], list[list[Cell]]]:
    """Two commits of the library in turn.

    Seconds of this code by those of the other: median and quartiles of the ratios of all rounds.
    CPU ms are the median of the other code, and of this. T / F is one map by one factorization,
    the fastest of each, by this code.
    """
    rows = list[list[Cell]]()
    with code_of(commit) as there, mapping_by(there) as other, mapping_by(ROOT) as this:
        for model, method in product(models, methods):
            V, F = model.load()
            path = str(there / "surface.npz")
            np.savez(path, V=V, F=F)
            request: dict[str, Any] = {"path": path, "options": _options(method)}
            _, first = (_ask(process, **request, times=1) for process in (other, this))
            request["times"] = 1 + int(ENOUGH / first["wall"]["all"])
            turns, unit = list[tuple[Answer, Answer]](), []
            for turn in range(rounds):
                now = _ask(this, **request) if turn % 2 else None
                before = _ask(other, **request)
                turns.append((before, now or _ask(this, **request)))
                unit.append(METHODS["factor"].function(V, F).seconds)
            rows += _rows(f"{model.name} {method}", turns, min(unit))
    return ("surface", "phase", "CPU ms", "CPU ratio", "wall ratio", "T / F"), rows


def _rows(title: str, turns: Sequence[tuple[Answer, Answer]], unit: float) -> Iterator[list[Cell]]:
    """Yield the row of the whole map, then those of its phases."""
    whole = _seconds(turns, "CPU", "all").max()
    fastest = _seconds(turns, "wall", "all")[:, 1].min()
    for phase in dict.fromkeys(chain(["all"], *(each["wall"] for pair in turns for each in pair))):
        before, now = np.median(_seconds(turns, "CPU", phase), axis=0)
        if max(before, now) < SHOWN * whole:
            continue
        yield [
            *(name(title if phase == "all" else ""), word(phase)),
            word(f"{1e3 * before:.3g} to {1e3 * now:.3g}"),
            *(word(_spread(turns, clock, phase)) for clock in ("CPU", "wall")),
            number(fastest / unit if phase == "all" else np.nan, ".2f"),
        ]


def _seconds(turns: Sequence[tuple[Answer, Answer]], clock: str, phase: str) -> Floats:
    """Seconds (rounds, 2) of a phase, by the other code and by this; 0 where it does not run."""
    return np.array([[each[clock].get(phase, 0.0) for each in pair] for pair in turns])


def _spread(turns: Sequence[tuple[Answer, Answer]], clock: str, phase: str) -> str:
    """Write the median of the ratios, and their quartiles."""
    before, now = _seconds(turns, clock, phase).T
    if not (before.all() and now.all()):
        return "new" if now.any() else "gone"
    low, middle, high = np.percentile(now / before, [25, 50, 75])
    return f"{middle:.2f} ({low:.2f} to {high:.2f})"
