"""Tasks of a map in parts, run here, by processes, or by an executor: the same files by each."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import BrokenExecutor
from contextlib import closing
from dataclasses import dataclass
from typing import Any

from ...solve.memory import require
from ...solve.solvers import SolverName, using
from ..batching.executors import run_on
from ..batching.work import MIB_OF_PYTHON
from ..pool import Pool
from .part import Arrays, Folder, named

TIMES_ITS_FILE = 28  # the memory that a part takes while it is condensed


@dataclass(frozen=True)
class Task:
    """Something to compute of a part or of a cut, and to write: a pure function of files.

    `what` takes the folder, the number of the part or the cut, and what is `given`, numbers and
    names; it returns arrays, and may need so many MiB of `memory`.
    """

    folder: Folder
    solver: SolverName | None
    what: Callable[..., Arrays]
    of: int
    given: tuple[Any, ...]
    memory: float

    @property
    def name(self) -> str:
        """Of the result, in the folder."""
        return named(self.what, self.of, *self.given)

    @property
    def draft(self) -> str:
        """Beside this, attempts are counted."""
        return str(self.folder.work / self.name)

    def run(self) -> str | Exception:
        """Compute and write it, unless it is there; return its name, or what went wrong."""
        try:
            if not self.folder.has(self.name):
                require(self.memory * 2**20, self.name, "Part the surface into more parts")
                with using(self.solver):
                    arrays = self.what(self.folder, self.of, *self.given)
                    self.folder.write(self.name, **arrays)
        except Exception as error:
            return error
        return self.name

    def failed(self, error: str, message: str) -> Exception:
        """Return what went wrong where nothing was returned."""
        return BrokenExecutor(f"{self.name}: {error}: {message}")


class Engine:
    """What runs tasks: this process, so many others, or an executor."""

    def __init__(self, folder: Folder, executor: Any, solver: SolverName | None) -> None:
        self.folder, self._solver, self._executor = folder, solver, executor
        self._pool = Pool(executor) if isinstance(executor, int) else None
        largest = max(folder.file(f"part-{p}").stat().st_size for p in folder.parts)
        self.memory = TIMES_ITS_FILE * largest / 2**20

    def run(
        self,
        what: Callable[..., Arrays],
        *given: Any,
        of: Iterable[int] | None = None,
        memory: float | None = None,
        advance: Callable[[float], None] = lambda done: None,
    ) -> dict[int, str]:
        """Run a task for all parts, or for some parts or cuts: the names of their results.

        The first thing that goes wrong is raised. What is there already is not computed again.
        """
        need = MIB_OF_PYTHON + (self.memory if memory is None else memory)
        numbers = self.folder.parts if of is None else of
        tasks = [Task(self.folder, self._solver, what, k, given, need) for k in numbers]
        left = [task for task in tasks if not self.folder.has(task.name)]
        with closing(self._answers(left)) as answers:
            for done, answer in enumerate(answers, 1):
                if isinstance(answer, Exception):
                    raise answer
                advance(done / len(left))
        return {task.of: task.name for task in tasks}

    def _answers(self, tasks: Sequence[Task]) -> Any:
        if self._pool is not None:
            return self._pool.run(tasks)
        if self._executor is not None:
            return run_on(self._executor, tasks)
        return (task.run() for task in tasks)

    def close(self) -> None:
        """End the processes."""
        if self._pool is not None:
            self._pool.close()
