"""Maps on request: a script that runs on any commit of the library, with its seconds by phase.

Each line of its input is a request, the arguments of `measured`; of its output, the answer.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from time import perf_counter, process_time
from typing import Any

import numpy as np

from cdcp_igl import disk_map


def measured(path: str, options: dict[str, Any], times: int) -> dict[str, dict[str, float]]:
    """Map the surface of a file: seconds of CPU and of the clock in each phase, and in "all"."""
    with np.load(path) as file:
        V, F = file["V"], file["F"]
    clocks = {"CPU": process_time, "wall": perf_counter}
    seconds: dict[str, Counter[str]] = {name: Counter() for name in clocks}
    running, since = "", {name: clock() for name, clock in clocks.items()}

    def begins(phase: str, _: float = 0) -> None:
        nonlocal running
        for name, clock in clocks.items():
            now = clock()
            if running:
                seconds[name].update({running: now - since[name], "all": now - since[name]})
            since[name] = now
        running = phase

    for _ in range(times):
        begins("before")
        disk_map(V, F, **options, progress=begins)
        begins("")
    return {name: {k: s / times for k, s in of.items()} for name, of in seconds.items()}


if __name__ == "__main__":
    for line in sys.stdin:
        print(json.dumps(measured(**json.loads(line))), flush=True)  # noqa: T201
