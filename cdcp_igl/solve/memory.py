"""How much memory a factorization takes, and how much there is: asked before the work."""

from __future__ import annotations

from math import inf, log2
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
# The files of control groups, of version 2 and of version 1: the limit, what is in use, and the
# account with the name of what could be given back.
CONTAINERS = (
    ("memory.max", "memory.current", "memory.stat", "inactive_file"),
    (
        "memory/memory.limit_in_bytes",
        "memory/memory.usage_in_bytes",
        "memory/memory.stat",
        "total_inactive_file",
    ),
)


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
    cgroup = root / "sys/fs/cgroup"
    free = [1024 * x for x in _numbers(root / "proc/meminfo", "MemAvailable:")]
    for limit, use, account, inactive in CONTAINERS:
        for most, used in zip(_numbers(cgroup / limit), _numbers(cgroup / use), strict=False):
            free.append(most - used + sum(_numbers(cgroup / account, inactive)))
    return min(free, default=inf)


def _address_space() -> float:
    """Bytes that this process may still ask for (``ulimit -v``)."""
    try:
        import resource
    except ModuleNotFoundError:  # Windows
        return inf
    most = resource.getrlimit(resource.RLIMIT_AS)[0]
    used = sum(_numbers(Path("/proc/self/status"), "VmSize:"))
    return inf if most == resource.RLIM_INFINITY else most - 1024 * used


def _numbers(file: Path, name: str = "") -> list[int]:
    """Read the number, or the one in the line that begins with a name; none if there is none."""
    try:
        lines = file.read_text().splitlines()
        return [int(line[len(name) :].split()[0]) for line in lines if line.startswith(name)]
    except (OSError, ValueError, IndexError):  # "max" is no number
        return []
