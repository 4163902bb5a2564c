"""Memory of processes in MiB, and how they ended, as far as the system tells."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np

PROC = Path("/proc/self")


def resident(pid: int) -> float:
    """Resident memory of a process, 0 once it has ended or where the system does not tell."""
    try:
        if PROC.exists():
            pages = PROC.with_name(str(pid)).joinpath("statm").read_text().split()[1]
            return int(pages) * os.sysconf("SC_PAGE_SIZE") / 2**20
        shown = subprocess.run(["ps", "-o", "rss=", "-p", str(pid)], capture_output=True, text=True)
        return int(shown.stdout) / 2**10
    except (OSError, ValueError, IndexError):
        return 0


def peak_memory() -> float:
    """Peak resident memory of this process, NaN where the system does not tell."""
    if PROC.exists():  # on Linux ru_maxrss includes that of the process that started this one
        lines = PROC.joinpath("status").read_text().splitlines()
        return next((int(x.split()[1]) / 2**10 for x in lines if x.startswith("VmHWM:")), np.nan)
    try:
        import resource
    except ModuleNotFoundError:  # Windows
        return np.nan
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 2**20 if sys.platform == "darwin" else peak / 2**10


def forget_peak_memory() -> None:
    """Let `peak_memory` count from now; on Linux only, elsewhere it stays that of all the time."""
    try:
        PROC.joinpath("clear_refs").write_text("5")
    except OSError:  # another system, or one that forbids it
        return


def cause_of_death(returncode: int, errors: str) -> str:
    """Say why a process ended that should not have: its signal, or its last words."""
    if returncode < 0:
        names = {int(number): number.name for number in signal.Signals}
        return f"crashed: {names.get(-returncode, f'signal {-returncode}')}"
    return f"failed: {(errors.strip().splitlines() or ['no message'])[-1]}"
