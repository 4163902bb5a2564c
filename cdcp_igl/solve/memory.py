"""How much memory a factorization takes, how much there is, and how much a process has taken."""

from __future__ import annotations

import subprocess
import sys
from contextlib import suppress
from math import inf, log2, nan
from mmap import mmap
from pathlib import Path

from ..errors import SolverError

# The steps of the map that come after the check take 45 to 60 bytes times n log2(n) in all, as the
# factor has O(n log n) entries (George 1973). `python -m benchmarks speed` measures the memory of
# whole maps, which are 63 to 68 of these units; the least is taken here, so that nothing is refused
# that would fit.
BYTES = 45.0
SMALLEST_CHECKED = 100_000  # vertices; fewer take less than 100 MB

# What OpenBLAS takes with each of its threads below CHOLMOD, and a quarter of that below NumPy.
# Where there is no address space for it, it tries for ever, or ends the process.
BUFFER = 128 << 20  # bytes

GIB = 2**30
PROC = Path("/proc/self")


def require_memory(n: int) -> None:
    """Refuse a surface with n vertices if its map cannot fit into memory: SolverError.

    Never where the system does not tell.
    """
    if n < SMALLEST_CHECKED:
        return
    remedy = "Map it in parts (cdcp_igl.partition, cdcp_igl.parts_map), decimate it"
    require(BYTES * n * log2(n), f"the map of {n:,} vertices", remedy)


def require(needed: float, what: str, remedy: str) -> None:
    """Refuse what takes more bytes than there are: SolverError."""
    available = min(available_memory(), _address_space())
    if needed > available:
        raise SolverError(
            f"{what} takes at least {needed / GIB:.1f} GiB more, and {available / GIB:.1f} GiB are "
            f"available. {remedy}, or take a machine with more memory."
        )


def require_buffers(threads: int) -> None:
    """Refuse a solver where there is no room for BLAS with so many threads: SolverError."""
    needed = (threads + 1) * BUFFER  # the main thread has one for each of the libraries
    try:
        mmap(-1, needed).close()
    except OSError as error:
        raise SolverError(
            f"BLAS takes {needed >> 20:,} MB of address space, which are not to be had "
            f"(OPENBLAS_NUM_THREADS is {threads}). Raise the limit (ulimit -v)."
        ) from error


def available_memory(root: Path = Path("/")) -> float:
    """Bytes that processes may still use, infinite where the system does not tell.

    The system has its files below `root`.
    """
    cgroup = root / "sys/fs/cgroup"  # of version 2
    free = [1024 * x for x in _numbers(root / "proc/meminfo", "MemAvailable:")]
    for most in _numbers(cgroup / "memory.max"):
        unused = _numbers(cgroup / "memory.stat", "inactive_file")
        free.append(most - sum(_numbers(cgroup / "memory.current")) + sum(unused))
    return min(free, default=inf)


def resident_memory(pid: int) -> float:
    """Resident memory of a process in MiB; 0 once it has ended, or where nobody tells."""
    if PROC.exists():
        return sum(_numbers(PROC.with_name(str(pid)) / "status", "VmRSS:")) / 2**10
    try:
        shown = subprocess.run(["ps", "-o", "rss=", "-p", str(pid)], capture_output=True, text=True)
        return int(shown.stdout) / 2**10
    except (OSError, ValueError):
        return 0


def peak_memory() -> float:
    """Peak resident memory of this process in MiB, NaN where the system does not tell."""
    if PROC.exists():  # on Linux ru_maxrss includes that of the process that started this one
        return next((most / 2**10 for most in _numbers(PROC / "status", "VmHWM:")), nan)
    try:
        import resource
    except ModuleNotFoundError:  # Windows
        return nan
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 2**20 if sys.platform == "darwin" else peak / 2**10


def forget_peak_memory() -> None:
    """Let `peak_memory` count from now; on Linux only, elsewhere it stays that of all the time."""
    with suppress(OSError):  # another system, or one that forbids it
        (PROC / "clear_refs").write_text("5")


def _address_space() -> float:
    """Bytes that this process may still ask for (``ulimit -v``)."""
    try:
        import resource
    except ModuleNotFoundError:  # Windows
        return inf
    most = resource.getrlimit(resource.RLIMIT_AS)[0]
    used = sum(_numbers(PROC / "status", "VmSize:"))
    return inf if most == resource.RLIM_INFINITY else most - 1024 * used


def _numbers(file: Path, name: str = "") -> list[int]:
    """Read the number, or the one in the line that begins with a name; none if there is none."""
    try:
        lines = file.read_text().splitlines()
        return [int(line[len(name) :].split()[0]) for line in lines if line.startswith(name)]
    except (OSError, ValueError, IndexError):  # "max" is no number
        return []
