"""Executors of others: concurrent.futures, Dask, and what looks like them."""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import BrokenExecutor, Future, as_completed
from typing import Any, Protocol, runtime_checkable

from ..pool import ATTEMPTS, Answer, Job, Unwritten

SUSPECTED = "a worker of the executor died while it mapped this surface, or another beside it"


@runtime_checkable
class Executor(Protocol):
    """What takes tasks as those of concurrent.futures and Dask's Client do."""

    def submit(self, fn: Callable[..., Any], /, *args: Any) -> Any:
        """Let a worker call a function, and return a future."""


def run_on(executor: Any, tasks: Sequence[Job[Answer]]) -> Generator[Answer]:
    """Yield the answer of each job as it is done; Unwritten if a result cannot be written.

    BrokenExecutor if the executor, or Dask's Client, takes no more tasks because a worker of it
    has died. What was being mapped then has got a record, of failure.
    """
    pool = executor.get_executor(pure=False) if hasattr(executor, "get_executor") else executor
    futures: dict[Future[Answer], Job[Answer]] = {}
    left, broken = len(tasks), False
    try:
        try:
            for task in tasks:
                futures[pool.submit(_attempt, task)] = task
        except BrokenExecutor:
            broken = True
        for future in as_completed(futures):
            task = futures[future]
            try:
                record = future.result()
            except Unwritten:
                raise
            except BrokenExecutor:
                broken = True
                if not os.path.exists(_count_of_attempts(task)):  # it had not begun
                    continue
                record = task.failed("Crash", SUSPECTED)
            except Exception as error:  # Dask's KilledWorker, and what cannot be pickled
                record = task.failed(type(error).__name__, str(error))
                if os.path.exists(_count_of_attempts(task)):
                    times = os.path.getsize(_count_of_attempts(task))
                    record = task.failed("Crash", f"the worker died ({times} times)")
            left -= 1
            yield record
        if broken:
            raise BrokenExecutor(
                f"a worker of the executor has died; {left} surfaces are left for another run"
            )
    finally:
        for future in futures:
            future.cancel()


def _attempt(task: Job[Answer]) -> Answer:
    """Map a surface, unless it has cost too many workers already.

    A file counts the attempts: Dask tries again by itself where a worker has died, as often as it
    was told to by others.
    """
    with open(_count_of_attempts(task), "ab") as file:
        file.write(b".")
        attempts = file.tell()
    if attempts > ATTEMPTS:
        return task.failed("Crash", f"the worker died ({ATTEMPTS} times)")
    record = task.run()
    os.unlink(_count_of_attempts(task))
    return record


def _count_of_attempts(task: Job[Any]) -> str:
    return f"{task.draft}.attempts"
