"""Requests that may crash or hang without harm, and rows that a killed run goes on with."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, suppress
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Generic, TypeVar

import numpy as np
import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

from cdcp_igl.printing import finite
from cdcp_igl.scale.batching.journal import Journal, journal_lines
from cdcp_igl.scale.pool import Pool, same_modules

Jobs = Annotated[int, typer.Option(min=1, help="Cases side by side.")]
WorkFolder = Annotated[
    Path | None,
    typer.Option(metavar="FOLDER", help="Of what is measured already; else in build."),
]

WIDE = 160  # columns of a table that is printed to a file
Row = TypeVar("Row", bound=Any)


def wide_console() -> Console:
    """Return a console whose tables are not broken where they are printed to a file."""
    console = Console()
    if not console.is_terminal:
        console.width = WIDE
    return console


def answered(before: Any) -> Any:
    """Make a field of a row that is no part of the request, with its value before the answer."""
    return field(default=before, compare=False)


@dataclass(frozen=True)
class Asked(Generic[Row]):
    """A row to be filled, as a job of the workers of a batch. Warnings are errors to its answer."""

    answer: Callable[[Row], Row]
    row: Row
    draft: str = ""
    memory: float = 0.0

    @property
    def name(self) -> str:
        """By which messages know it."""
        return repr(self.row)

    def run(self) -> Row:
        """Return the row that is filled."""
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # a warning is no way to report anything
            return self.answer(self.row)

    def failed(self, error: str, message: str) -> Row:
        """Return the row if it is lost, as "hang" or as "crash"."""
        return replace(self.row, outcome="hang" if error == "TimeLimit" else "crash")


def kept_answers(
    answer: Callable[[Row], Row],
    requests: Sequence[Row],
    folder: Path,
    seconds: float,
    jobs: int,
    console: Console,
) -> list[Row]:
    """Return the answer to each request; those that a folder has are not asked for again.

    Parameters
    ----------
    answer : callable
        Fills a row, a dataclass that compares by what is asked for alone; can be pickled, as it.
    requests : sequence of row
        Before they are answered; another ``outcome`` says that one is lost.
    folder : Path
        Its journal gets a line for each row.
    seconds : float
        After which an answer is given up.
    jobs : int
        Requests that are answered side by side.
    console : Console
        For the progress bar.
    """
    folder.mkdir(parents=True, exist_ok=True)
    pool = Pool(jobs, seconds, attempts=1, environment=same_modules())
    columns = (BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with (
        Journal(folder) as journal,
        closing(pool),
        Progress(*columns, console=console, transient=True) as bar,
    ):
        rows = {row: row for kind in set(map(type, requests)) for row in _kept(folder, kind)}
        missing = [Asked(answer, row) for row in requests if row not in rows]
        for row in bar.track(pool.run(missing), total=len(missing)):
            rows[row] = row
            journal.append(json.dumps(finite(asdict(row)), ensure_ascii=False) + "\n")
    return [rows[row] for row in requests]


def _kept(folder: Path, kind: Callable[..., Row]) -> Iterator[Row]:
    """Yield all rows, NaN for null; a half-written line does not count."""
    for line in journal_lines(folder):
        with suppress(json.JSONDecodeError):
            yield kind(**{k: np.nan if x is None else x for k, x in json.loads(line).items()})
