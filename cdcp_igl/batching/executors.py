"""Executors of others: concurrent.futures, Dask, and what looks like them."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Generator, Sequence
from concurrent.futures import BrokenExecutor, Future, as_completed
from pathlib import Path
from typing import Any, Protocol, TypeVar

from .pool import ATTEMPTS
from .work import Unwritten

SUSPECTED = "a worker of the executor died while it mapped this surface, or another beside it"

Made = TypeVar("Made", covariant=True)


class Job(Protocol[Made]):
    """What can be run: the `Task` of a surface, or another that can be pickled."""

    @property
    def name(self) -> str:
        """Tells it from the others."""

    def run(self) -> Made:
        """Make its record, with whatever has gone wrong."""

    def failed(self, error: str, message: str) -> Made:
        """Make the record of one that did not come back."""


def run_on(executor: Any, jobs: Sequence[Job[Made]], marks: Path) -> Generator[Made]:
    """Yield the record of each job as it is done.

    Parameters
    ----------
    executor : concurrent.futures.Executor or dask.distributed.Client
        Its workers must see the files of the jobs, and `marks`.
    jobs : sequence of Job
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
    futures: dict[Future[Made], Job[Made]] = {}
    broken: list[Job[Made]] = []
    try:
        for job in jobs:
            futures[_submitted(pool, job, marks)] = job
        for future in as_completed(futures):
            job = futures[future]
            try:
                yield future.result()
            except Unwritten:
                raise
            except BrokenExecutor:
                broken.append(job)
            except Exception as error:  # Dask's KilledWorker, and what cannot be pickled
                yield job.failed(type(error).__name__, str(error))
        yield from (job.failed("Crash", SUSPECTED) for job in broken if _mark(marks, job).exists())
        left = sum(not _mark(marks, job).exists() for job in broken)
        if broken:
            raise BrokenExecutor(
                f"a worker of the executor has died; {left} surfaces are left for another run"
            )
    finally:
        for future in futures:
            future.cancel()
        shutil.rmtree(marks, ignore_errors=True)


def _submitted(pool: Any, job: Job[Made], marks: Path) -> Future[Made]:
    try:
        return pool.submit(_attempt, job, str(marks))
    except BrokenExecutor as error:
        failed: Future[Made] = Future()
        failed.set_exception(error)
        return failed


def _attempt(job: Job[Made], marks: str) -> Made:
    """Run a job, unless it has cost too many workers already."""
    mark = _mark(Path(marks), job)
    with mark.open("ab") as file:
        file.write(b".")
        attempts = file.tell()
    if attempts > ATTEMPTS:
        return job.failed("Crash", f"the worker died ({ATTEMPTS} times)")
    record = job.run()
    mark.unlink(missing_ok=True)
    return record


def _mark(marks: Path, job: Job[object]) -> Path:
    return marks / hashlib.sha256(job.name.encode(errors="surrogateescape")).hexdigest()
