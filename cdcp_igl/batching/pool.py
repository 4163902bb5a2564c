"""Processes on this machine that map surfaces, each within its limits."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from collections import Counter
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import BrokenExecutor
from contextlib import closing, suppress
from queue import Empty, SimpleQueue
from tempfile import TemporaryFile
from threading import Thread
from time import monotonic
from typing import Any

import numpy as np

from ..processes import cause_of_death, resident
from ..solve.memory import available_memory
from .memory import memory_needed
from .records import Record
from .work import Task

__all__ = ["Pool"]

POLL = 0.05  # seconds between two looks at time and memory
ATTEMPTS = 3  # with a surface that kills its worker

# One thread for each worker: the map uses no more, and numbers must not depend on the machine.
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


class Pool:
    """Workers that live on, and are replaced when a surface has cost one its life.

    Parameters
    ----------
    jobs : int
        Surfaces mapped at the same time; fewer where memory would not do.
    time_limit, memory_limit : float
        Seconds and resident MiB after which a surface is given up.
    """

    def __init__(self, jobs: int, time_limit: float = np.inf, memory_limit: float = np.inf) -> None:
        self.jobs, self.time_limit, self.memory_limit = jobs, time_limit, memory_limit

    def run(self, tasks: Sequence[Task]) -> Generator[Record]:
        """Yield the record of each task as it is done, the largest surfaces first.

        Raises
        ------
        Unwritten
            If a result could not be written.
        BrokenExecutor
            If no process can be started.
        """
        need = {task.name: memory_needed(task.source) for task in tasks}
        waiting = sorted(tasks, key=lambda task: need[task.name], reverse=True)
        memory = available_memory() / 2**20
        attempts: Counter[str] = Counter()
        inbox: SimpleQueue[tuple[_Worker, Any]] = SimpleQueue()
        idle: list[_Worker] = []
        busy: dict[_Worker, Task] = {}
        try:
            while waiting or busy:
                while waiting and len(busy) < self.jobs:
                    left = memory - sum(need[task.name] for task in busy.values())
                    fits = (i for i, task in enumerate(waiting) if need[task.name] <= left)
                    chosen = next(fits, None if busy else 0)
                    if chosen is None:
                        break
                    worker = idle.pop() if idle else _Worker(inbox)
                    busy[worker] = task = waiting.pop(chosen)
                    worker.begin(task)
                for worker, answer in _arrived(inbox):
                    if worker in idle:  # it died while it had nothing to do
                        idle.remove(worker)
                        worker.close()
                        continue
                    task = busy.pop(worker)
                    if answer is not _DIED:
                        idle.append(worker)
                        if isinstance(answer, BaseException):
                            raise answer
                        yield answer
                        continue
                    attempts[task.name] += 1
                    with closing(worker):
                        loss = worker.loss(task, attempts[task.name])
                    if loss:
                        yield loss
                    else:
                        waiting.insert(0, task)
                for worker in busy:
                    worker.enforce(self.time_limit, self.memory_limit)
        finally:
            for worker in (*busy, *idle):
                worker.close()


def _arrived(inbox: SimpleQueue[Any]) -> Iterator[Any]:
    with suppress(Empty):
        yield inbox.get(timeout=POLL)
        while True:
            yield inbox.get_nowait()


_DIED = object()


class _Worker:
    """A process, and the thread that waits for its answers."""

    def __init__(self, inbox: SimpleQueue[Any]) -> None:
        self._errors = TemporaryFile()  # noqa: SIM115 - closed by `close`
        self._process = subprocess.Popen(
            # -P: what lies in the folder where the user works is no module.
            [sys.executable, "-P", "-m", "cdcp_igl.batching.worker"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            env={**ONE_THREAD, **os.environ},
            start_new_session=True,  # Ctrl-C is for the one who started this
        )
        self._ready = False
        self._since = np.inf
        self.excess: tuple[str, str] | None = None
        self._listener = Thread(target=self._listen, args=(inbox,), daemon=True)
        self._listener.start()

    def begin(self, task: Task) -> None:
        """Hand over a surface."""
        self._since = monotonic() if self._ready else np.inf
        self._errors.seek(0)
        self._errors.truncate()
        assert self._process.stdin
        with suppress(OSError):  # it has just died, which the thread will tell
            pickle.dump(task, self._process.stdin)
            self._process.stdin.flush()

    def enforce(self, time_limit: float, memory_limit: float) -> None:
        """End the process if it has passed a limit."""
        if self.excess:
            return
        if monotonic() - self._since > time_limit:
            self.excess = "TimeLimit", f"no result within {time_limit:g} s"
        elif np.isfinite(memory_limit) and resident(self._process.pid) > memory_limit:
            self.excess = "MemoryLimit", f"more than {memory_limit:,.0f} MiB of memory"
        if self.excess:
            self._process.kill()

    def loss(self, task: Task, attempts: int) -> Record | None:
        """Record what the surface has cost; None if it is to be tried again.

        Raises
        ------
        BrokenExecutor
            If the worker had not come as far as the surface.
        """
        if self.excess:
            error, message = self.excess
            return task.failed(error, message)
        self._errors.seek(0)
        errors = self._errors.read().decode(errors="replace")
        cause = cause_of_death(self._process.wait(), errors)
        if not self._ready and self._process.wait() > 0:
            raise BrokenExecutor(f"no worker can be started: {cause}")
        if attempts < ATTEMPTS:
            return None
        return task.failed("Crash", f"{cause} ({attempts} times)")

    def close(self) -> None:
        """End the process, whatever it does."""
        self._process.kill()
        self._listener.join()
        assert self._process.stdin
        assert self._process.stdout
        with suppress(OSError):  # something was still to be said to it
            self._process.stdin.close()
        self._process.stdout.close()
        self._errors.close()

    def _listen(self, inbox: SimpleQueue[Any]) -> None:
        assert self._process.stdout
        try:
            while True:
                answer = pickle.load(self._process.stdout)
                if self._ready:
                    inbox.put((self, answer))
                else:
                    self._ready, self._since = True, monotonic()
        except Exception:  # the end of the stream, or half an answer
            self._process.wait()
            inbox.put((self, _DIED))
