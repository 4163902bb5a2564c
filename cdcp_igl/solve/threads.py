"""One thread for BLAS and OpenMP while the solver runs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from ctypes import CDLL
from threading import Lock

from threadpoolctl import LibController, ThreadpoolController

__all__ = ["libraries_were_loaded", "one_thread"]

# The supernodes of a surface's Laplacian are small: BLAS threads never gain much on them,
# and lose a factor of 2 to 20 when the cores are shared. The same goes for the OpenMP loops of
# CHOLMOD, which in SuiteSparse 5 ask for four threads whatever the number allowed.
_POOLS: list[LibController] = []
_OPENMP: list[CDLL] = []


def libraries_were_loaded() -> None:
    """Look again which libraries of BLAS and OpenMP there are."""
    global _POOLS, _OPENMP
    _POOLS = ThreadpoolController().lib_controllers
    _OPENMP = [pool.dynlib for pool in _POOLS if pool.user_api == "openmp"]


libraries_were_loaded()


@contextmanager
def one_thread() -> Iterator[None]:
    """Run the body on one thread; the caller's own settings are back at the end.

    Bodies may overlap, in threads of the caller.
    """
    with _BLAS, _serial_openmp():
        yield


class _SerialBlas:
    """Limits the threads of BLAS, which belong to the process.

    Of bodies that overlap, the first sets the limit and the last restores the caller's own; if
    each one did both, the last to leave would restore the limit of another.
    """

    def __init__(self) -> None:
        self._lock, self._inside, self._own = Lock(), 0, list[tuple[LibController, int]]()

    def __enter__(self) -> None:
        with self._lock:
            if self._inside == 0:
                # Not by threadpoolctl's context, which asks every library for its version too.
                self._own = [(pool, pool.num_threads) for pool in _POOLS]
                for pool in _POOLS:
                    pool.set_num_threads(1)
            self._inside += 1

    def __exit__(self, *exception: object) -> None:
        with self._lock:
            self._inside -= 1
            if self._inside == 0:
                for pool, number in self._own:
                    pool.set_num_threads(number)


_BLAS = _SerialBlas()


@contextmanager
def _serial_openmp() -> Iterator[None]:
    """Let no OpenMP loop of this thread be parallel, not even one that names its number."""
    runtimes = _OPENMP  # another thread may load more of them meanwhile
    levels = [runtime.omp_get_max_active_levels() for runtime in runtimes]
    try:
        for runtime in runtimes:
            runtime.omp_set_max_active_levels(0)
        yield
    finally:
        for runtime, level in zip(runtimes, levels, strict=True):
            runtime.omp_set_max_active_levels(level)
