"""One thread for BLAS and OpenMP while a map is made."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from ctypes import CDLL
from threading import RLock, get_ident

from threadpoolctl import LibController, ThreadpoolController

# The supernodes of a surface's Laplacian are small: BLAS threads never gain much on them,
# and lose a factor of 2 to 20 when the cores are shared. The same goes for the OpenMP loops of
# CHOLMOD, which in SuiteSparse 5 ask for four threads whatever the number allowed.
_BLAS: list[tuple[Callable[[int], None], LibController]] = []  # what sets it, and it
_OPENMP: list[CDLL] = []


def held_while_forking() -> RLock:
    """Make a lock that no process inherits locked: a fork waits until it is free."""
    lock = RLock()
    if hasattr(os, "register_at_fork"):  # not on Windows
        os.register_at_fork(
            before=lock.acquire, after_in_parent=lock.release, after_in_child=lock.release
        )
    return lock


_lock = held_while_forking()
_inside: list[int] = []  # the threads that are in a body of `one_thread`
_callers: list[tuple[Callable[[int], None], int]] = []  # how to set BLAS, and to what


def libraries_were_loaded() -> None:
    """Look again which libraries of BLAS and OpenMP there are."""
    global _BLAS, _OPENMP
    with _lock:  # as is that of the loader then
        pools = ThreadpoolController().lib_controllers
    blas = [pool for pool in pools if pool.user_api == "blas" and not _by_openmp(pool)]
    _BLAS = [(_setter(pool), pool) for pool in blas]
    _OPENMP = [pool.dynlib for pool in pools if pool.user_api == "openmp"]


@contextmanager
def one_thread() -> Iterator[None]:
    """Run the body on one thread; the caller's own settings are back at the end.

    Bodies may overlap, in threads of the caller; one inside another costs next to nothing.
    """
    if get_ident() in _inside:
        yield
        return
    with _serial_blas(), _serial_openmp():
        yield


@contextmanager
def _serial_blas() -> Iterator[None]:
    """Limit the threads of BLAS, whose number belongs to the process.

    Of bodies that overlap, the first sets the limit and the last restores the caller's own; if
    each one did both, the last to leave would restore the limit of another.
    """
    with _lock:
        if not _inside:
            _callers[:] = [(set_number, pool.num_threads) for set_number, pool in _BLAS]
            for set_number, _ in _callers:
                set_number(1)
        _inside.append(get_ident())
    try:
        yield
    finally:
        with _lock:
            _inside.remove(get_ident())
            _restore_blas()


def _restore_blas() -> None:
    if not _inside:
        for set_number, number in _callers:
            set_number(number)


def _setter(pool: LibController) -> Callable[[int], None]:
    """Return what sets the number of threads of a library, from any thread.

    Of OpenBLAS it is its own function: threadpoolctl from 3.7 on lets only one thread set it, and
    does nothing in the others.
    """
    for prefix in ("", "scipy_"):
        for suffix in ("", "64_", "_64"):
            name = f"{prefix}openblas_set_num_threads{suffix}"
            if hasattr(pool.dynlib, name):
                return getattr(pool.dynlib, name)
    return pool.set_num_threads


def _by_openmp(pool: LibController) -> bool:
    """Whether it is an OpenBLAS whose threads are those of OpenMP."""
    return pool.internal_api == "openblas" and pool.threading_layer == "openmp"


@contextmanager
def _serial_openmp() -> Iterator[None]:
    """Let no OpenMP loop of this thread be parallel, not even one that names its number.

    Both settings belong to the thread, in old libraries the levels to the process. What another
    thread has set there already, that thread will restore.
    """
    runtimes = _OPENMP  # another thread may load more of them meanwhile
    numbers = [runtime.omp_get_max_threads() for runtime in runtimes]
    levels = [runtime.omp_get_max_active_levels() for runtime in runtimes]
    try:
        for runtime in runtimes:
            runtime.omp_set_num_threads(1)
            runtime.omp_set_max_active_levels(0)
        yield
    finally:
        for runtime, number, level in zip(runtimes, numbers, levels, strict=True):
            if number > 1:
                runtime.omp_set_num_threads(number)
            if level:
                runtime.omp_set_max_active_levels(level)


def _only_this_thread() -> None:
    """In a process that was forked, the other threads are gone, from the bodies, too."""
    others_were_inside = any(thread != get_ident() for thread in _inside)
    _inside[:] = [thread for thread in _inside if thread == get_ident()]
    if others_were_inside:
        _restore_blas()


libraries_were_loaded()
# Of which a library starts so many when it is loaded, as the environment says or there are cores.
THREADS = max((pool.num_threads for _, pool in _BLAS), default=1)
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_only_this_thread)
