"""CHOLMOD by CVXOPT, which comes with it for all systems: the only file that knows it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from copy import copy
from importlib.metadata import version
from threading import Lock
from typing import Any

import numpy as np
from cvxopt import amd, cholmod, matrix, spmatrix
from numpy.typing import NDArray
from scipy.sparse import csc_matrix

from ..arrays import Floats

__all__ = ["ERRORS", "LIBRARY", "MODE", "ORDERS", "PACKAGE", "Factorization", "order"]

LIBRARY = "CHOLMOD"
PACKAGE = f"cvxopt {version('cvxopt')}"
MODE = "supernodal"
ERRORS: tuple[type[Exception], ...] = (ArithmeticError,)
ORDERS = True

# CVXOPT keeps CHOLMOD's options for the whole process, where the caller may have set his own.
_OPTIONS = {"supernodal": 2, "nmethods": 1, "postorder": False, "dbound": 0.0, "print": 0}
_LOCK = Lock()


class Factorization:
    """See `solvers.Factorization`; exactly in the order that is given."""

    def __init__(self, A: csc_matrix, natural: bool) -> None:
        self.permutation = np.arange(A.shape[0]) if natural else order(A)
        self._analyze(A)

    def _analyze(self, A: csc_matrix) -> None:
        converted = _converted(A)
        with _our_options():
            self._factor = cholmod.symbolic(converted, matrix(self.permutation.astype(np.int64)))
            cholmod.numeric(converted, self._factor)

    def refactor(self, A: csc_matrix) -> None:
        """Factor from the same symbolic analysis."""
        converted = _converted(A)
        with _our_options():
            cholmod.numeric(converted, self._factor)

    def refactored(self, A: csc_matrix) -> Factorization:
        """Factor in the same order; CVXOPT cannot copy its symbolic analysis."""
        other = copy(self)
        other._analyze(A)
        return other

    def solve(self, b: Floats) -> Floats:
        """Solve A x = b."""
        x = matrix(np.array(b, dtype=np.float64, order="F", ndmin=1))
        with _our_options():
            cholmod.solve(self._factor, x)
        return np.array(x).reshape(b.shape)


def order(A: csc_matrix) -> NDArray[np.signedinteger[Any]]:
    """(k,) approximate minimum degree order, postordered."""
    converted = _converted(A)
    with _LOCK:
        return np.array(amd.order(converted)).ravel()


def _converted(A: csc_matrix) -> spmatrix:
    """Make a matrix of CVXOPT; from its own dense ones, as from lists it takes a minute."""
    columns = np.repeat(np.arange(A.shape[1]), np.diff(A.indptr))
    rows = A.indices.astype(np.int64)
    return spmatrix(matrix(A.data.astype(np.float64)), matrix(rows), matrix(columns), A.shape)


@contextmanager
def _our_options() -> Iterator[None]:
    with _LOCK:
        callers = dict(cholmod.options)
        cholmod.options.clear()
        cholmod.options.update(_OPTIONS)
        try:
            yield
        finally:
            cholmod.options.clear()
            cholmod.options.update(callers)
