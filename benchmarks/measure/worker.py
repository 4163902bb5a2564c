"""Processes that may crash or hang without harm, and rows that a killed run goes on with."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import ExitStack, suppress
from dataclasses import asdict, replace
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from queue import SimpleQueue
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

from cdcp_igl.batching.journal import Journal, journal_lines
from cdcp_igl.printing import finite

Jobs = Annotated[int, typer.Option(min=1, help="Cases side by side.")]
WorkFolder = Annotated[
    Path | None,
    typer.Option(metavar="FOLDER", help="Of what is measured already; else in build."),
]


class Lost(Exception):
    """There is no answer: its text is "crash" or "hang"."""


class Worker:
    """A process that answers one request after the other, and is replaced when it is lost.

    Parameters
    ----------
    answer : callable
        Function of a request; both can be pickled. Warnings are errors to it.
    """

    def __init__(self, answer: Callable[[Any], Any]) -> None:
        self._answer = answer
        self._start()

    def _start(self) -> None:
        context = get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs, self._answer), daemon=True)
        self._process.start()
        theirs.close()

    def run(self, request: Any, seconds: float) -> Any:
        """Return the answer; Lost if there is none in so many seconds."""
        try:
            self._pipe.send(request)
            if self._pipe.poll(seconds):
                return self._pipe.recv()
            lost = Lost("hang")
        except (EOFError, OSError):
            lost = Lost("crash")
        self._stop()
        self._start()
        raise lost

    def _stop(self) -> None:
        self._process.kill()
        self._process.join()
        self._pipe.close()

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *exception: object) -> None:
        self._stop()


def _serve(pipe: Connection, answer: Callable[[Any], Any]) -> None:
    warnings.simplefilter("error")  # a warning is no way to report anything
    while True:
        pipe.send(answer(pipe.recv()))


def answers(
    answer: Callable[[Any], Any],
    requests: Sequence[Any],
    seconds: float,
    jobs: int,
    console: Console,
) -> Iterator[tuple[Any, Any]]:
    """Yield each request with its answer, or with the `Lost` of it, as they are done.

    `seconds` is the limit of each; of so many `jobs`, each has a worker.
    """
    idle: SimpleQueue[Worker] = SimpleQueue()

    def run(request: Any) -> Any:
        worker = idle.get()
        try:
            return worker.run(request, seconds)
        except Lost as lost:
            return lost
        finally:
            idle.put(worker)

    columns = (BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with ExitStack() as stack:
        bar = stack.enter_context(Progress(*columns, console=console, transient=True))
        for _ in range(jobs if requests else 0):
            idle.put(stack.enter_context(Worker(answer)))
        threads = ThreadPoolExecutor(jobs)
        stack.callback(threads.shutdown, cancel_futures=True)
        asked = {threads.submit(run, request): request for request in requests}
        for done in bar.track(as_completed(asked), total=len(asked)):
            yield asked[done], done.result()


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
        Of a request, returns its row, a dataclass; as of a `Worker`.
    requests : mapping
        To the row that a request has before it is answered, and, with another ``outcome``, if it
        is lost.
    key : callable
        Of a row: by what it is known again.
    folder : Path
        Its journal gets a line for each row.
    seconds, jobs, console
        As of `answers`.
    """
    kinds = {type(row) for row in requests.values()}
    folder.mkdir(parents=True, exist_ok=True)
    with Journal(folder) as journal:
        rows = {key(row): row for kind in kinds for row in _kept(folder, kind)}
        missing = [request for request, row in requests.items() if key(row) not in rows]
        for request, row in answers(answer, missing, seconds, jobs, console):
            made = replace(requests[request], outcome=str(row)) if isinstance(row, Lost) else row
            rows[key(made)] = made
            journal.append(json.dumps(finite(asdict(made)), ensure_ascii=False) + "\n")
    return [rows[key(row)] for row in requests.values()]


def _kept(folder: Path, kind: Callable[..., Any]) -> Iterator[Any]:
    """Yield all rows, NaN for null; a half-written line does not count."""
    for line in journal_lines(folder):
        with suppress(json.JSONDecodeError):
            yield kind(**{k: np.nan if x is None else x for k, x in json.loads(line).items()})
