"""CHOLMOD by CVXOPT, an extra with wheels for all systems: the only file that knows it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version

import numpy as np
from cvxopt import amd, cholmod, matrix, spmatrix
from scipy.sparse import csc_matrix

from ..arrays import Floats, Indices
from .cholesky import Cholesky, trailing_block
from .threads import held_while_forking

# CVXOPT keeps CHOLMOD's options for the whole process, where the caller may have set his own.
_OPTIONS = {"supernodal": 2, "nmethods": 1, "postorder": False, "dbound": 0.0, "print": 0}
_LOCK = held_while_forking()


class Factorization(Cholesky):
    """Exactly in the order that is given."""

    LIBRARY = "CHOLMOD"
    PACKAGE = f"cvxopt {version('cvxopt')}"
    ERRORS = (ArithmeticError, MemoryError)
    ORDERS = True

    @staticmethod
    def _converted(A: csc_matrix) -> spmatrix:
        np.empty(8 * A.nnz)  # what follows takes as much, and CVXOPT crashes where it gets none
        # From dense matrices of its own, as from lists it takes a minute.
        columns = np.repeat(np.arange(A.shape[1]), np.diff(A.indptr))
        rows, entries = A.indices.astype(np.int64), A.data.astype(np.float64)
        return spmatrix(matrix(entries), matrix(rows), matrix(columns), A.shape)

    def _analyze(self, A: spmatrix, natural: bool) -> None:
        self.permutation = np.arange(A.size[0]) if natural else self._order(A)

    def _factorize(self, A: spmatrix) -> None:
        with _our_options():
            if self._factor is None:  # nor can CVXOPT copy its symbolic analysis
                order = matrix(self.permutation.astype(np.int64))
                self._factor = cholmod.symbolic(A, order)
            cholmod.numeric(A, self._factor)

    def _solve(self, b: Floats) -> Floats:
        x = matrix(np.array(b, dtype=np.float64, order="F", ndmin=1))
        with _our_options():
            cholmod.solve(self._factor, x)
        return np.array(x).reshape(b.shape)

    def _schur_complement(self, A: csc_matrix, k: int) -> Floats:
        with _our_options():
            L = cholmod.getfactor(self._factor)  # which is symbolic then
        self._factorize(self._converted(A))
        starts, rows, entries = (np.array(x).ravel() for x in (*L.CCS[:2], L.CCS[2]))
        block = trailing_block(csc_matrix((entries, rows, starts), L.size), self.permutation, k)
        return block @ block.T

    @staticmethod
    def _order(A: spmatrix) -> Indices:
        with _LOCK:
            return np.array(amd.order(A)).ravel()


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
