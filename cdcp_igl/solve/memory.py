"""How much memory a factorization takes, and how much there is: asked before the work."""

from __future__ import annotations

from math import inf, log2
from pathlib import Path

from ..errors import SolverError

__all__ = ["available_memory", "factor_entries", "require_memory"]

# The factor of a surface of n vertices has O(n log n) entries (George 1973): 4 to 5 n log2(n) on
# scans, terrains and grids from 50,000 to 10 million vertices, zeros of supernodes included. With
# it the steps of the map that come after the check take 45 to 60 bytes times n log2(n) in all.
# `python -m benchmarks speed` measures the memory of whole maps, which are 63 to 68 of these
# units; the least of each is taken here, so that nothing is refused that would fit.
ENTRIES = 4.0
BYTES = 45.0
UNQUESTIONED = 100_000  # vertices, which take 100 MB

GIB = 2**30
# Limit, use and what of it could be given back, in control groups of version 2 and 1.
CONTAINERS = (
    ("memory.max", "memory.current", "memory.stat", "inactive_file"),
    (
        *("memory/memory.limit_in_bytes", "memory/memory.usage_in_bytes"),
        *("memory/memory.stat", "total_inactive_file"),
    ),
)
PROC, CGROUP = Path("/proc"), Path("/sys/fs/cgroup")


def factor_entries(n: int) -> float:
    """Estimate how many entries the factor of a surface with n vertices has, at least."""
    return ENTRIES * n * log2(n + 1)


def require_memory(n: int) -> None:
    """Refuse a surface with n vertices if its map cannot fit into memory.

    Raises
    ------
    SolverError
        With the estimate, and with what is available. Never where the system does not tell.
    """
    if n < UNQUESTIONED:
        return
    needed = BYTES * n * log2(n)
    available = min(available_memory(), _address_space())
    if needed > available:
        raise SolverError(
            f"the map of {n:,} vertices takes at least {needed / GIB:.1f} GiB more, and "
            f"{available / GIB:.1f} GiB are available. Decimate the mesh, or take a machine with "
            "more memory."
        )


def available_memory() -> float:
    """Bytes that processes may still use, infinite where the system does not tell."""
    free = [1024 * x for x in _numbers(PROC / "meminfo", "MemAvailable:")]
    for limit, use, account, inactive in CONTAINERS:
        for most, used in zip(_numbers(CGROUP / limit), _numbers(CGROUP / use), strict=False):
            free.append(most - used + sum(_numbers(CGROUP / account, inactive)))
    return min(free, default=inf)


def _address_space() -> float:
    """Bytes that this process may still ask for (``ulimit -v``)."""
    try:
        import resource
    except ModuleNotFoundError:  # Windows
        return inf
    most = resource.getrlimit(resource.RLIMIT_AS)[0]
    used = sum(_numbers(PROC / "self" / "status", "VmSize:"))
    return inf if most == resource.RLIM_INFINITY else most - 1024 * used


def _numbers(file: Path, name: str = "") -> list[int]:
    """Read the number, or the one in the line that begins with a name; none if there is none."""
    try:
        lines = file.read_text().splitlines()
        return [int(line[len(name) :].split()[0]) for line in lines if line.startswith(name)]
    except (OSError, ValueError, IndexError):  # "max" is no number
        return []
