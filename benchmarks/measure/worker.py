"""Processes that may crash or hang without harm."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import ExitStack
from multiprocessing import get_context
from multiprocessing.connection import Connection
from queue import SimpleQueue
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

__all__ = ["Jobs", "Lost", "Worker", "answers"]

Jobs = Annotated[int, typer.Option(min=1, help="Cases side by side.")]


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


def answers(
    answer: Callable[[Any], Any],
    requests: Sequence[Any],
    seconds: float,
    jobs: int,
    console: Console,
) -> Iterator[tuple[Any, Any]]:
    """Yield each request with its answer, or with the `Lost` of it, as they are done.

    Parameters
    ----------
    answer : callable
        As of a `Worker`.
    requests : sequence
    seconds : float
        For each.
    jobs : int
        Workers, each with a request at a time.
    console : Console
        For the progress bar.
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
        for _ in range(jobs):
            idle.put(stack.enter_context(Worker(answer)))
        threads = ThreadPoolExecutor(jobs)
        stack.callback(threads.shutdown, cancel_futures=True)
        asked = {threads.submit(run, request): request for request in requests}
        for done in bar.track(as_completed(asked), total=len(asked)):
            yield asked[done], done.result()


def _serve(pipe: Connection, answer: Callable[[Any], Any]) -> None:
    warnings.simplefilter("error")  # a warning is no way to report anything
    while True:
        pipe.send(answer(pipe.recv()))
