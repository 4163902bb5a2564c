"""Sparse Cholesky factorization, by whichever solver is installed or asked for."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from copy import copy
from typing import Any, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix, spmatrix

from ..arrays import Complex, Floats, as_complex
from ..errors import SolverError
from .buffers import take_buffers
from .solvers import Solver, solver
from .threads import one_thread

__all__ = ["Cholesky", "Numbers", "Ordering", "fill_reducing_order"]

Ordering = Literal["amd", "natural"]
Numbers = TypeVar("Numbers", Complex, Floats)


class Cholesky:
    """Factorization Q A Q^T = L L^T of a sparse, symmetric, positive definite matrix.

    Parameters
    ----------
    A : (k, k) sparse matrix of float64
        Symmetric and positive definite, k at least 1; only the lower triangle is read.
    ordering : {"amd", "natural"}
        Fill-reducing permutation Q: approximate minimum degree, which beats nested
        dissection on surfaces; or (up to a postordering) the order as given. A solver whose
        `ORDERS` is false takes an order of its own in either case.

    Attributes
    ----------
    permutation : (k,) ndarray of int
        Row i of Q A Q^T is row ``permutation[i]`` of A.
    solver : Solver
        The module that does the work.

    Raises
    ------
    SolverError
        If A is not numerically positive definite or memory runs out.
    """

    def __init__(self, A: spmatrix, ordering: Ordering = "amd") -> None:
        self.solver = solver()
        A = _writeable(A)
        with _errors(self.solver, A.shape[0]):
            self._factor = self.solver.Factorization(A, ordering == "natural")
        self.permutation = self._factor.permutation

    def refactor(self, A: spmatrix) -> None:
        """Factor another matrix with the same pattern of nonzeros, in the same order."""
        A = _writeable(A)
        with _errors(self.solver, A.shape[0]):
            self._factor.refactor(A)

    def refactored(self, A: spmatrix) -> Cholesky:
        """Factor another matrix like `refactor`, and keep this factorization as well."""
        other, A = copy(self), _writeable(A)
        with _errors(self.solver, A.shape[0]):
            other._factor = self._factor.refactored(A)
        return other

    def solve(self, b: Numbers) -> Numbers:
        """Solve A x = b; b is real, one or several columns, or one complex vector."""
        if np.iscomplexobj(b):
            x: Any = as_complex(self._solve(np.array([b.real, b.imag]).T))  # Fortran order
            return x
        return self._solve(b)

    def _solve(self, b: Any) -> Any:
        with _errors(self.solver, len(b)):
            return self._factor.solve(b)


def fill_reducing_order(A: spmatrix) -> NDArray[np.signedinteger[Any]]:
    """(k,) order of the rows of A in which its factor stays sparse.

    A is symmetric, and only the pattern of its lower triangle is read. Of a solver whose
    `ORDERS` is false, the order as given.
    """
    A, chosen = _writeable(A), solver()
    with _errors(chosen, A.shape[0]):
        return chosen.order(A)


def _writeable(A: spmatrix) -> csc_matrix:
    """Return A by columns, copied if it is read-only, which scikit-sparse 0.5 refuses."""
    A = csc_matrix(A)
    writeable = all(array.flags.writeable for array in (A.data, A.indices, A.indptr))
    return A if writeable else A.copy()


@contextmanager
def _errors(used: Solver, size: int) -> Iterator[None]:
    """Run a solver on one thread and translate its errors."""
    try:
        with one_thread():
            take_buffers(used)
            yield
    except Exception as error:
        if not isinstance(error, (MemoryError, *used.ERRORS)):
            raise
        raise SolverError(
            f"{used.LIBRARY} ({used.PACKAGE}) failed on a Laplacian of size {size:,}: "
            f"{str(error) or type(error).__name__}. If the mesh has slivers, remesh it; if memory "
            "ran out, decimate it."
        ) from error
