"""The process that does one job after the other, for `pool`.

Run as ``python -m cdcp_igl.batching.worker`` it takes pickled jobs from its standard input and
gives pickled answers on its standard output, and before all True, once it is ready.
"""

from __future__ import annotations

import os
import pickle
import sys
from queue import SimpleQueue
from threading import Thread

from .pool import Job
from .work import Unwritten


def _main() -> None:
    # Libraries print on what is called standard output; they are not to print into the answers.
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    tasks: SimpleQueue[Job[object]] = SimpleQueue()
    Thread(target=_receive, args=(tasks,), daemon=True).start()
    answer: object = True
    while True:
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


if __name__ == "__main__":
    _main()
