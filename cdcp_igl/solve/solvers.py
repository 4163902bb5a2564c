"""Which solver factors matrices: the fastest that is installed, or the one that was asked for."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from importlib import import_module
from typing import Literal, get_args

import numpy
import scipy.linalg
from scipy.sparse import csc_matrix, spmatrix

from ..extras import MissingExtra
from .cholesky import Cholesky, Ordering
from .memory import require_buffers
from .threads import THREADS, held_while_forking, libraries_were_loaded, one_thread

SolverName = Literal["scikit-sparse", "cvxopt", "scipy"]  # from the fastest to the slowest
SOLVERS: tuple[SolverName, ...] = get_args(SolverName)
VARIABLE = "CDCP_IGL_SOLVER"
UNIT = numpy.eye(2)

_importing = held_while_forking()  # as are Python's own locks of modules then
_asked_for: ContextVar[str | None] = ContextVar("solver", default=None)


def factorize(A: spmatrix, ordering: Ordering = "amd") -> Cholesky:
    """Factor a matrix by the solver that is in use; see `Cholesky`."""
    return solver()(A, ordering)


def solver() -> type[Cholesky]:
    """Return what is asked for by `using` or by the environment, or the fastest there is.

    ValueError if no solver has that name, MissingExtra if it cannot be imported.
    """
    name = _asked_for.get() or os.environ.get(VARIABLE)
    return _load(checked(name)) if name else _fastest()


@contextmanager
def using(name: SolverName | None) -> Iterator[None]:
    """Let the body use a solver, one of `SOLVERS`, on one thread; None asks for none.

    Other threads are not concerned, and what was factored stays with its solver.
    """
    token = _asked_for.set(_asked_for.get() if name is None else checked(name))
    try:
        solver()  # for libraries that are loaded in the body would keep their threads
        with one_thread():
            yield
    finally:
        _asked_for.reset(token)


def checked(name: str) -> str:
    """Return the name; ValueError if no solver has it."""
    if name not in SOLVERS:
        known = ", ".join(f'"{solver}"' for solver in SOLVERS)
        raise ValueError(f"solver must be one of {known}, not {name!r}")
    return name


@cache
def _load(name: str) -> type[Cholesky]:
    """Import a solver, and let BLAS take its buffers while there certainly is room for them."""
    require_buffers(THREADS)
    try:
        with _importing:
            module = import_module(f".with_{name.replace('-', '_')}", __package__)
    except Exception as error:  # one that was built for another NumPy raises what it likes
        raise MissingExtra(
            f"solver={name!r}: {error}. Install it: pip install {name}; "
            f"or take another: {', '.join(other for other in SOLVERS if other != name)}."
        ) from error
    libraries_were_loaded()
    loaded: type[Cholesky] = module.Factorization
    loaded(csc_matrix(UNIT))
    numpy.linalg.cholesky(UNIT)
    scipy.linalg.cholesky(UNIT)
    return loaded


@cache
def _fastest() -> type[Cholesky]:
    for name in SOLVERS:
        try:
            return _load(name)
        except MissingExtra:
            pass
    raise AssertionError("SciPy is always there")
