"""What a run ran on, and with."""

from __future__ import annotations

import os
import platform
import subprocess
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_info

import cdcp_igl

from ..records.store import PACKAGES, ROOT, code
from .peers import versions

MACHINE = f"{os.cpu_count()}-core-{platform.machine()}"  # a neutral name of this machine
# The last because CHOLMOD 3 asks OpenMP for four threads whatever the others say.
POOLS = (
    *("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"),
    "OMP_THREAD_LIMIT",
)


def pin_threads(threads: int) -> None:
    """Set the threads of BLAS and OpenMP in the processes that will be started."""
    os.environ.update({name: str(threads) for name in POOLS})


def memory_mib() -> float:
    """Physical memory in MiB."""
    return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") / 2**20


def describe(threads: int) -> dict[str, Any]:
    """Hardware, versions, date and commit, as JSON types."""
    blas = sorted(
        {
            f"{pool['internal_api']} {pool['version']}"
            for pool in threadpool_info()
            if pool["user_api"] == "blas"
        }
    )
    return {
        "cpu": _cpu(),
        "cores": os.cpu_count(),
        "memory_gib": round(memory_mib() / 1024, 1),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "cdcp_igl": cdcp_igl.__version__,
        "versions": {name: version(name) for name in PACKAGES} | versions(),
        "blas": blas,
        "blas_threads": threads,
        "date": datetime.now(UTC).date().isoformat(),
        "commit": _commit(),
        "code": code(),
    }


def _cpu() -> str:
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or "unknown"


def _commit() -> str:
    def git(*arguments: str) -> str:
        command = ["git", "-C", str(ROOT), *arguments]
        done = subprocess.run(command, capture_output=True, text=True)
        return done.stdout.strip()

    commit = git("rev-parse", "--short", "HEAD") or "unknown"
    changed = git("status", "--porcelain", "--untracked-files=no", "cdcp_igl", "benchmarks/**/*.py")
    return commit + (" with changes" if changed else "")
