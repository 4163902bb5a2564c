"""Makes the workers of a batch misbehave, by the name of the result, up to its underscore.

Python imports a module of this name when it starts, where it finds one.
"""

import os
import signal
import sys
import time
from pathlib import Path

import numpy as np

from cdcp_igl.scale.batching.work import Task

real = Task.run


def run(task):
    name = task.name.partition("_")[0]
    if name == "kill":
        os.kill(os.getpid(), signal.SIGKILL)
    if name == "once":
        mark = Path(task.target).with_suffix(".seen")
        if not mark.exists():
            mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
    if name == "words":
        print("last words", file=sys.stderr)
        os._exit(3)
    if name == "hang":
        time.sleep(600)
    if name == "hog":
        hoard = []
        while True:
            hoard.append(np.ones(1 << 20))
            time.sleep(0.002)
    if name == "chatty":
        print("on standard output", flush=True)
    return real(task)


Task.run = run
