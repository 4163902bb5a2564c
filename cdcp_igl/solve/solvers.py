"""Which solver factors matrices: the fastest that is installed, or the one that was asked for."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from importlib import import_module
from typing import Any, Literal, Protocol, cast

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix

from ..arrays import Floats
from ..extras import MissingExtra
from .threads import libraries_were_loaded

__all__ = ["SOLVERS", "Factorization", "Solver", "SolverName", "checked", "solver", "using"]

SolverName = Literal["scikit-sparse", "cvxopt", "scipy"]

# From the fastest to the slowest, with the module here that knows it.
SOLVERS: dict[SolverName, str] = {
    "scikit-sparse": "with_scikit_sparse",
    "cvxopt": "with_cvxopt",
    "scipy": "with_scipy",
}
VARIABLE = "CDCP_IGL_SOLVER"

_asked_for: ContextVar[str | None] = ContextVar("solver", default=None)


class Factorization(Protocol):
    """A factorization Q A Q^T = L L^T."""

    permutation: NDArray[np.signedinteger[Any]]

    def __init__(self, A: csc_matrix, natural: bool) -> None: ...

    def refactor(self, A: csc_matrix) -> None:
        """Factor a matrix with the same pattern; what was there before may go first."""

    def refactored(self, A: csc_matrix) -> Factorization:
        """Factor a matrix with the same pattern; this factorization stays as it is."""

    def solve(self, b: Floats) -> Floats:
        """Solve A x = b for one or several columns, which stay as they are."""


class Solver(Protocol):
    """What each of the modules offers."""

    LIBRARY: str
    PACKAGE: str  # by which Python has the library, with its version
    MODE: str  # of its methods, the one that is used
    ERRORS: tuple[type[Exception], ...]  # what it raises if A is not positive definite
    ORDERS: bool  # whether it factors in the order that it is given
    Factorization: type[Factorization]

    def order(self, A: csc_matrix) -> NDArray[np.signedinteger[Any]]:
        """(k,) order of the rows in which the factor stays sparse."""


def solver() -> Solver:
    """Return what is asked for by `using` or by the environment, or the fastest there is.

    Raises
    ------
    ValueError
        If no solver has that name.
    MissingExtra
        If it is not installed.
    """
    name = _asked_for.get() or os.environ.get(VARIABLE)
    return _load(checked(name)) if name else _fastest()


@contextmanager
def using(name: SolverName | None) -> Iterator[None]:
    """Let the body use a solver, one of `SOLVERS`; None asks for none.

    Other threads are not concerned, and what was factored stays with its solver.
    """
    token = _asked_for.set(_asked_for.get() if name is None else checked(name))
    try:
        yield
    finally:
        _asked_for.reset(token)


def checked(name: str) -> str:
    """Return the name; ValueError if no solver has it."""
    if name not in tuple(SOLVERS):  # whatever the name is
        known = ", ".join(f'"{solver}"' for solver in SOLVERS)
        raise ValueError(f"solver must be one of {known}, not {name!r}")
    return name


@cache
def _load(name: str) -> Solver:
    try:
        module = import_module(f".{SOLVERS[cast(SolverName, name)]}", __package__)
    except ImportError as error:
        raise MissingExtra(
            f"solver={name!r}: {error}. Install it: pip install {name}; "
            f"or take another: {', '.join(other for other in SOLVERS if other != name)}."
        ) from error
    libraries_were_loaded()
    return cast(Solver, module)


@cache
def _fastest() -> Solver:
    for name in SOLVERS:
        try:
            return _load(name)
        except ImportError:  # not installed, or without the libraries that it was built with
            pass
    raise AssertionError("SciPy is always there")
