"""Processes on this machine that do jobs, such as to map a surface, each within its limits.

They are none of `multiprocessing`: its processes import the script of the user again, which must
then be written for it, and all surfaces of a pool fail when one of its processes dies.

Run as ``python -m cdcp_igl.scale.pool`` this is such a process: it takes pickled jobs from its
standard input and gives pickled answers on its standard output, and before all True, once it is
ready.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Generator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, ThreadPoolExecutor, wait
from contextlib import suppress
from queue import Empty, SimpleQueue
from tempfile import TemporaryFile
from threading import Lock, Thread
from time import monotonic
from typing import Any, Protocol, TypeVar

import numpy as np

from ..solve.memory import available_memory, resident_memory

Answer = TypeVar("Answer", covariant=True)

POLL = 0.05  # seconds between two looks at time and memory
SECONDS_TO_END = 10.0  # for a process that has closed its stream of answers
ATTEMPTS = 3  # with a job that kills its worker

# One thread for each worker: the map uses no more, and numbers must not depend on the machine.
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


def same_modules() -> dict[str, str]:
    """Return the environment of a process that finds the modules that this one does."""
    return os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}


class Unwritten(OSError):
    """A result could not be written, which is no fault of the job: the answer is this error."""


class Job(Protocol[Answer]):
    """What a worker does: a surface of a batch, or a step with a part of a surface."""

    @property
    def name(self) -> str:
        """What tells it from others."""

    @property
    def draft(self) -> str:
        """A path beside which attempts may be counted."""

    @property
    def memory(self) -> float:
        """MiB that it may need."""

    def run(self) -> Answer:
        """Do it."""

    def failed(self, error: str, message: str) -> Answer:
        """Answer for it, if it does not."""


class Pool:
    """Workers that live on, and are replaced when a job has cost one its life.

    `jobs` are done at the same time, fewer where memory would not do. The limits are seconds and
    resident MiB, after which a job is given up. (Address space, which the system could limit by
    itself, says little: libraries reserve much that they never use.) The environment is that of the
    processes.
    """

    def __init__(
        self,
        jobs: int,
        time_limit: float = np.inf,
        memory_limit: float = np.inf,
        *,
        attempts: int = ATTEMPTS,
        environment: Mapping[str, str] | None = None,
    ) -> None:
        self.jobs, self.time_limit, self.memory_limit = jobs, time_limit, memory_limit
        self._attempts, self._environment = attempts, environment or {**ONE_THREAD, **os.environ}
        self._workers: list[_Worker] = []
        self._idle: SimpleQueue[_Worker] = SimpleQueue()
        self._closed = False

    def run(self, tasks: Sequence[Job[Answer]]) -> Generator[Answer]:
        """Yield the answer of each job as it is done, the largest first.

        What a worker could not answer is raised; BrokenExecutor if no process can be started.
        """
        need = {task.name: task.memory for task in tasks}
        waiting = sorted(tasks, key=lambda task: need[task.name], reverse=True)
        memory = available_memory() / 2**20
        running: dict[Future[Answer], Job[Answer]] = {}
        threads = ThreadPoolExecutor(self.jobs)  # each waits for what one process answers
        try:
            while waiting or running:
                while waiting and len(running) < self.jobs:
                    left = memory - sum(need[task.name] for task in running.values())
                    fits = (i for i, task in enumerate(waiting) if need[task.name] <= left)
                    chosen = next(fits, None if running else 0)
                    if chosen is None:
                        break
                    task = waiting.pop(chosen)
                    running[threads.submit(self._map, task)] = task
                for future in wait(running, POLL, FIRST_COMPLETED).done:
                    del running[future]
                    yield future.result()
                for worker in tuple(self._workers):
                    worker.enforce(self.time_limit, self.memory_limit)
        finally:
            if running:  # given up
                self._kill()
            threads.shutdown()

    def close(self) -> None:
        """End all workers."""
        self._kill()
        for worker in self._workers:
            worker.close()

    def _kill(self) -> None:
        self._closed = True
        for worker in tuple(self._workers):
            worker.kill()

    def _map(self, task: Job[Answer]) -> Answer:
        """Let a process do a job, and another one if it dies."""
        cause = ""
        for _ in range(self._attempts):
            worker = self._take_worker()
            answer = worker.ask(task)
            if answer is not None and worker.excess is None:
                self._idle.put(worker)
            else:
                self._workers.remove(worker)
                cause = worker.close()
            if isinstance(answer, BaseException):
                raise answer
            if answer is not None:
                return answer
            if worker.excess:
                return task.failed(*worker.excess)
            if not (worker.ready or worker.was_killed):
                raise BrokenExecutor(f"no worker can be started: {cause}")
        times = f" ({self._attempts} times)" if self._attempts > 1 else ""
        return task.failed("Crash", cause + times)

    def _take_worker(self) -> _Worker:
        with suppress(Empty):
            return self._idle.get_nowait()
        worker = _Worker(self._environment)
        self._workers.append(worker)
        if self._closed:  # meanwhile
            worker.kill()
        return worker


class _Worker:
    """A process that does one job after the other."""

    def __init__(self, environment: Mapping[str, str]) -> None:
        self.ready = False
        self.excess: tuple[str, str] | None = None
        self._since: float | None = None  # the beginning of a job
        self._between = Lock()  # a process is ended while it works, not when it has just answered
        self._errors = TemporaryFile()  # noqa: SIM115 - closed by `close`
        self._process = subprocess.Popen(
            # -P: what lies in the folder where the user works is no module.
            [sys.executable, "-P", "-m", "cdcp_igl.scale.pool"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            env=environment,
            start_new_session=True,  # Ctrl-C is for the one who started this
        )

    def ask(self, task: Job[Any]) -> Any:
        """Hand over a job, wait, and return the answer; None if the process has died."""
        assert self._process.stdin
        assert self._process.stdout
        try:
            self.ready = self.ready or pickle.load(self._process.stdout)
            self._errors.seek(0)
            self._errors.truncate()
            with self._between:
                self._since = monotonic()
            pickle.dump(task, self._process.stdin)
            self._process.stdin.flush()
            return pickle.load(self._process.stdout)
        except Exception:  # the end of the stream, or half an answer
            return None
        finally:
            with self._between:
                self._since = None

    def enforce(self, time_limit: float, memory_limit: float) -> None:
        """End the process if it has passed a limit."""
        with self._between:
            if self._since is None or self.excess:
                return
            if monotonic() - self._since > time_limit:
                self.excess = "TimeLimit", f"no result within {time_limit:g} s"
            elif np.isfinite(memory_limit) and resident_memory(self._process.pid) > memory_limit:
                self.excess = "MemoryLimit", f"more than {memory_limit:,.0f} MiB of memory"
            if self.excess:
                self._process.kill()

    @property
    def was_killed(self) -> bool:
        """Whether a signal has ended the process."""
        return self._process.wait() < 0

    def kill(self) -> None:
        """End the process, whatever it does."""
        self._process.kill()

    def close(self) -> str:
        """Wait for the end of a process that has died or was killed; return the cause."""
        assert self._process.stdin
        assert self._process.stdout
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(SECONDS_TO_END)
        self._process.kill()  # whatever it still does
        returncode = self._process.wait()
        with suppress(OSError):  # something was still to be said to it
            self._process.stdin.close()
        self._process.stdout.close()
        with self._errors:
            self._errors.seek(0)
            return cause_of_death(returncode, self._errors.read().decode(errors="replace"))


def _main() -> None:
    # Libraries print on what is called standard output; they are not to print into the answers.
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    tasks: SimpleQueue[Job[object]] = SimpleQueue()
    Thread(target=_receive, args=(tasks,), daemon=True).start()
    answer: object = True
    while True:  # until `_receive` ends the process
        pickle.dump(answer, answers)
        answers.flush()
        task = tasks.get()
        try:
            answer = task.run()
        except Unwritten as error:
            answer = error


def _receive(tasks: SimpleQueue[Job[object]]) -> None:
    """End the process as soon as the one that started it has ended or closed the pipe."""
    try:
        while True:
            tasks.put(pickle.load(sys.stdin.buffer))
    finally:
        os._exit(0)


def cause_of_death(returncode: int, errors: str) -> str:
    """Say why a process ended that should not have: its signal, or its last words."""
    if returncode < 0:
        names = {int(number): number.name for number in signal.Signals}
        return f"crashed: {names.get(-returncode, f'signal {-returncode}')}"
    return f"failed: {(errors.strip().splitlines() or ['no message'])[-1]}"


if __name__ == "__main__":
    from cdcp_igl.scale import pool  # whose names jobs import, not those of a copy

    pool._main()
