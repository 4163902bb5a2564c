"""Sparse Cholesky factorization: what the solvers have in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from copy import copy
from typing import Any, ClassVar, Literal, Self

import numpy as np
from scipy.sparse import csc_matrix, spmatrix

from ..arrays import Floats, Indices, Numbers, as_complex
from ..errors import SolverError
from .threads import one_thread

Ordering = Literal["amd", "natural"]
COLUMNS = 128  # solved for at the same time


class Cholesky(ABC):
    """Factorization Q A Q^T = L L^T of a sparse, symmetric, positive definite matrix.

    Each solver has its own subclass; `solvers.factorize` makes one of that which is in use. Of A
    (k, k), k at least 1, only the lower triangle is read. Q is the approximate minimum degree, or
    (up to a postordering) the order as given; a solver whose `ORDERS` is false has an order of its
    own. SolverError if A is not numerically positive definite or memory runs out.
    """

    LIBRARY: ClassVar[str]
    PACKAGE: ClassVar[str]  # by which Python has the library, with its version
    MODE: ClassVar[str]  # of its methods, the one that is used
    ERRORS: ClassVar[tuple[type[Exception], ...]]  # A is not positive definite, or too large
    ORDERS: ClassVar[bool]  # whether it factors in the order that it is given

    permutation: Indices  # row i of Q A Q^T is row permutation[i] of A
    _factor: Any = None

    @classmethod
    def described(cls, ordering: str) -> str:
        """Say which solver this is, and in which order it eliminates."""
        return f"{cls.LIBRARY} ({cls.PACKAGE}, {ordering}, {cls.MODE} mode)"

    def __init__(self, A: spmatrix, ordering: Ordering = "amd") -> None:
        with self._errors(A.shape[0]):
            converted = self._converted(_writeable(A))
            self._analyze(converted, ordering == "natural")
            self._factorize(converted)

    def refactor(self, A: spmatrix) -> None:
        """Factor another matrix with the same pattern of nonzeros, in the same order."""
        with self._errors(A.shape[0]):
            self._factorize(self._converted(_writeable(A)))

    def refactored(self, A: spmatrix) -> Cholesky:
        """Factor another matrix like `refactor`, and keep this factorization as well."""
        other = copy(self)
        other.refactor(A)
        return other

    def __copy__(self) -> Self:
        """Copy the analysis, so that another matrix can be factored like this one; no factor."""
        other = object.__new__(type(self))
        other.__dict__.update(vars(self), _factor=None)
        return other

    def solve(self, b: Numbers) -> Numbers:
        """Solve A x = b; b is real, one or several columns, or one complex vector."""
        with self._errors(len(b)):
            if np.iscomplexobj(b):
                x: Any = as_complex(self._solve(np.array([b.real, b.imag]).T))  # Fortran order
                return x
            return self._solve(b)

    def schur_complement(self, A: csc_matrix, k: int) -> Floats:
        """(k, k) what is left of the last k rows of A, which was factored, without the others.

        Where nothing gives the factor itself, from solutions: it is the inverse of the last block
        of the inverse.
        """
        n = len(self.permutation)
        inverse = np.empty((k, k))
        for start in range(0, k, COLUMNS):
            some = np.arange(start, min(start + COLUMNS, k))
            unit = np.zeros((n, len(some)))
            unit[n - k + some, some - start] = 1
            inverse[:, some] = self.solve(unit)[n - k :]
        return np.asarray(np.linalg.inv((inverse + inverse.T) / 2), np.float64)

    @classmethod
    def fill_reducing_order(cls, A: spmatrix) -> Indices:
        """(k,) order of the rows of A in which its factor stays sparse.

        A is symmetric, and only the pattern of its lower triangle is read. Of a solver whose
        `ORDERS` is false, the order as given.
        """
        with cls._errors(A.shape[0]):
            return cls._order(cls._converted(_writeable(A)))

    @staticmethod
    @abstractmethod
    def _converted(A: csc_matrix) -> Any:
        """Make of a matrix what the methods below take."""

    @abstractmethod
    def _analyze(self, A: Any, natural: bool) -> None:
        """Find the permutation and the pattern of the factor."""

    @abstractmethod
    def _factorize(self, A: Any) -> None:
        """Factor a matrix with the analysed pattern. A copy of this factorization stays."""

    @abstractmethod
    def _solve(self, b: Any) -> Any:
        """Solve A x = b for one or several columns, which stay as they are."""

    @staticmethod
    @abstractmethod
    def _order(A: Any) -> Indices:
        """See `fill_reducing_order`."""

    @classmethod
    @contextmanager
    def _errors(cls, size: int) -> Iterator[None]:
        """Run the solver on one thread and translate its errors."""
        try:
            with one_thread():
                yield
        except cls.ERRORS as error:
            raise SolverError(
                f"{cls.LIBRARY} ({cls.PACKAGE}) failed on a Laplacian of size {size:,}: "
                f"{str(error) or type(error).__name__}. If the mesh has slivers, remesh it; if "
                "memory ran out, decimate it."
            ) from error


def trailing_block(L: csc_matrix, permutation: Indices, k: int) -> Floats:
    """(k, k) L22 of a factor L = [L11 0; L21 L22], k the last rows of the matrix before Q.

    They are joined with one another, so that in no order do others that they are joined with come
    after them.
    """
    last = np.flatnonzero(permutation >= len(permutation) - k)
    block = np.zeros((k, k))
    rows = permutation[last] - (len(permutation) - k)
    block[np.ix_(rows, rows)] = L[:, last][last].toarray()
    return block


def _writeable(A: spmatrix) -> csc_matrix:
    """Return A by columns, copied if it is read-only, which scikit-sparse 0.5 refuses."""
    A = csc_matrix(A)
    writeable = all(array.flags.writeable for array in (A.data, A.indices, A.indptr))
    return A if writeable else A.copy()
