"""Requests that may crash or hang without harm, and rows that a killed run goes on with."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Hashable, Iterator, Mapping
from contextlib import closing, suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

from cdcp_igl.batching.journal import Journal, journal_lines
from cdcp_igl.pool import Pool, same_modules
from cdcp_igl.printing import finite

Jobs = Annotated[int, typer.Option(min=1, help="Cases side by side.")]
WorkFolder = Annotated[
    Path | None,
    typer.Option(metavar="FOLDER", help="Of what is measured already; else in build."),
]


@dataclass(frozen=True)
class Asked:
    """A request as a job of the workers of a batch. Warnings are errors to its answer."""

    answer: Callable[[Any], Any]
    request: Any
    row: Any
    name: str
    draft: str = ""
    memory: float = 0.0

    def run(self) -> Any:
        """Return the row that the request has then."""
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # a warning is no way to report anything
            return self.answer(self.request)

    def failed(self, error: str, message: str) -> Any:
        """Return the row of a request that is lost, as "hang" or as "crash"."""
        return replace(self.row, outcome="hang" if error == "TimeLimit" else "crash")


def kept_answers(
    answer: Callable[[Any], Any],
    requests: Mapping[Any, Any],
    key: Callable[[Any], Hashable],
    folder: Path,
    seconds: float,
    jobs: int,
    console: Console,
) -> list[Any]:
    """Return the row of each request; those that a folder has are not asked for again.

    Parameters
    ----------
    answer : callable
        Of a request, returns its row, a dataclass; can be pickled, as both of these.
    requests : mapping
        To the row that a request has before it is answered, and, with another ``outcome``, if it
        is lost.
    key : callable
        Of a row: by what it is known again.
    folder : Path
        Its journal gets a line for each row.
    seconds : float
        After which an answer is given up.
    jobs : int
        Requests that are answered side by side.
    console : Console
        For the progress bar.
    """
    kinds = {type(row) for row in requests.values()}
    folder.mkdir(parents=True, exist_ok=True)
    pool = Pool(jobs, seconds, attempts=1, environment=same_modules())
    columns = (BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with (
        Journal(folder) as journal,
        closing(pool),
        Progress(*columns, console=console, transient=True) as bar,
    ):
        rows = {key(row): row for kind in kinds for row in _kept(folder, kind)}
        missing = [
            Asked(answer, request, row, repr(key(row)))
            for request, row in requests.items()
            if key(row) not in rows
        ]
        for row in bar.track(pool.run(missing), total=len(missing)):
            rows[key(row)] = row
            journal.append(json.dumps(finite(asdict(row)), ensure_ascii=False) + "\n")
    return [rows[key(row)] for row in requests.values()]


def _kept(folder: Path, kind: Callable[..., Any]) -> Iterator[Any]:
    """Yield all rows, NaN for null; a half-written line does not count."""
    for line in journal_lines(folder):
        with suppress(json.JSONDecodeError):
            yield kind(**{k: np.nan if x is None else x for k, x in json.loads(line).items()})
