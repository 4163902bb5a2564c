"""One thread for BLAS and OpenMP while the solver runs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from threading import Lock

from threadpoolctl import ThreadpoolController

__all__ = ["libraries_were_loaded", "one_thread"]

# The supernodes of a surface's Laplacian are small: BLAS threads never gain much on them,
# and lose a factor of 2 to 20 when the cores are shared. The same goes for the OpenMP loops of
# CHOLMOD, which in SuiteSparse 5 ask for four threads whatever the number allowed.
_POOLS = ThreadpoolController()
_OPENMP = [pool.dynlib for pool in _POOLS.select(user_api="openmp").lib_controllers]


def libraries_were_loaded() -> None:
    """Look again which libraries of BLAS and OpenMP there are."""
    global _POOLS, _OPENMP
    _POOLS = ThreadpoolController()
    _OPENMP = [pool.dynlib for pool in _POOLS.select(user_api="openmp").lib_controllers]


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
        self._lock, self._inside, self._limit = Lock(), 0, ExitStack()

    def __enter__(self) -> None:
        with self._lock:
            if self._inside == 0:
                self._limit.enter_context(_POOLS.limit(limits=1))
            self._inside += 1

    def __exit__(self, *exception: object) -> None:
        with self._lock:
            self._inside -= 1
            if self._inside == 0:
                self._limit.close()


_BLAS = _SerialBlas()


@contextmanager
def _serial_openmp() -> Iterator[None]:
    """Let no OpenMP loop of this thread be parallel, not even one that names its number."""
    levels = [runtime.omp_get_max_active_levels() for runtime in _OPENMP]
    try:
        for runtime in _OPENMP:
            runtime.omp_set_max_active_levels(0)
        yield
    finally:
        for runtime, level in zip(_OPENMP, levels, strict=True):
            runtime.omp_set_max_active_levels(level)
