"""Executors of others: concurrent.futures, Dask, and what looks like them."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Generator, Sequence
from concurrent.futures import BrokenExecutor, Future, as_completed
from pathlib import Path
from typing import Any

from .pool import ATTEMPTS
from .records import FAILED, Record
from .work import Task, Unwritten, map_file

__all__ = ["run_on"]


def run_on(executor: Any, tasks: Sequence[Task], marks: Path) -> Generator[Record]:
    """Yield the record of each task as it is done.

    Parameters
    ----------
    executor : concurrent.futures.Executor or dask.distributed.Client
        Its workers must see the files of the tasks, and `marks`.
    tasks : sequence of Task
    marks : Path
        Folder to be made, in which every attempt leaves a mark: Dask tries again by itself
        where a worker has died, as often as it was told to by others.

    Raises
    ------
    Unwritten
        If a result could not be written.
    BrokenExecutor
        If the executor takes no more tasks because a worker of it has died. What was being
        mapped then has got a record, of failure.
    """
    pool = executor.get_executor(pure=False) if hasattr(executor, "get_executor") else executor
    shutil.rmtree(marks, ignore_errors=True)  # of a run that was killed
    marks.mkdir()
    futures: dict[Future[Record], Task] = {}
    broken: list[Task] = []
    try:
        for task in tasks:
            futures[_submitted(pool, task, marks)] = task
        for future in as_completed(futures):
            task = futures[future]
            try:
                yield future.result()
            except Unwritten:
                raise
            except BrokenExecutor:
                broken.append(task)
            except Exception as error:  # Dask's KilledWorker, and what cannot be pickled
                yield task.record(FAILED, error=type(error).__name__, message=str(error))
        yield from (_suspected(task) for task in broken if _mark(marks, task).exists())
        left = sum(not _mark(marks, task).exists() for task in broken)
        if broken:
            raise BrokenExecutor(
                f"a worker of the executor has died; {left} surfaces are left for another run"
            )
    finally:
        for future in futures:
            future.cancel()
        shutil.rmtree(marks, ignore_errors=True)


def _submitted(pool: Any, task: Task, marks: Path) -> Future[Record]:
    try:
        return pool.submit(_attempt, task, str(marks))
    except BrokenExecutor as error:
        failed: Future[Record] = Future()
        failed.set_exception(error)
        return failed


def _attempt(task: Task, marks: str) -> Record:
    """Map a surface, unless it has cost too many workers already."""
    mark = _mark(Path(marks), task)
    with mark.open("ab") as file:
        file.write(b".")
        attempts = file.tell()
    if attempts > ATTEMPTS:
        message = f"the worker died ({ATTEMPTS} times)"
        return task.record(FAILED, error="Crash", message=message)
    record = map_file(task)
    mark.unlink(missing_ok=True)
    return record


def _mark(marks: Path, task: Task) -> Path:
    return marks / hashlib.sha256(task.name.encode(errors="surrogateescape")).hexdigest()


def _suspected(task: Task) -> Record:
    message = "a worker of the executor died while it mapped this surface, or another beside it"
    return task.record(FAILED, error="Crash", message=message)
