"""The working memory of BLAS, taken while it can still be said that there is too little."""

from __future__ import annotations

from mmap import mmap

import numpy as np
from scipy.sparse import identity

from .solvers import Solver

__all__ = ["take_buffers"]

# OpenBLAS takes its buffer with the first call that needs one, 128 MB below CHOLMOD and 32 MB
# below NumPy. Where there is no address space for it, it tries for ever, or ends the process.
ROOM = 192 << 20  # bytes

_taken: set[str] = set()  # packages whose buffers are there


def take_buffers(solver: Solver) -> None:
    """Let the BLAS of a solver and that of NumPy take their buffers, once.

    Raises
    ------
    MemoryError
        If there is too little address space for them.
    """
    if solver.PACKAGE in _taken:
        return
    try:
        mmap(-1, ROOM).close()
    except OSError as error:
        needed = f"{ROOM >> 20} MB of address space for the buffers of BLAS are not to be had"
        raise MemoryError(needed) from error
    solver.Factorization(identity(1, format="csc"), True)
    np.linalg.lstsq(np.eye(1), np.ones(1), rcond=None)
    _taken.add(solver.PACKAGE)
