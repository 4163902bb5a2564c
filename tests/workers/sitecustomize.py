"""Makes the workers of a batch misbehave on some surfaces; found before the tests' Python starts.

What happens is in the name of the result: kill, segfault, once, hang, hog or words.
"""

import os
import signal
import sys
import time
from pathlib import Path

import numpy as np

from cdcp_igl.batching import work

real = work.disk_map
task = None


def map_file(given):
    global task
    task = given
    return real_map_file(given)


def disk_map(V, F, **options):
    name = task.name.partition("_")[0]
    if name == "kill":
        os.kill(os.getpid(), signal.SIGKILL)
    if name == "segfault":
        os.kill(os.getpid(), signal.SIGSEGV)
    if name == "once":
        mark = Path(task.target).with_suffix(".seen")
        if not mark.exists():
            mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
    if name == "words":
        print("on standard output", flush=True)
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
    return real(V, F, **options)


work.disk_map = disk_map
real_map_file, work.map_file = work.map_file, map_file
