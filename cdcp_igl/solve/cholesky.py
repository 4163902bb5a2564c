"""Sparse Cholesky factorization: what the solvers have in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar, Literal, Self

import numpy as np
from scipy.sparse import csc_matrix, spmatrix

from ..arrays import Floats, Indices, Numbers
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
    ERRORS: ClassVar[tuple[type[Exception], ...]]  # A is not positive definite, or too large
    ORDERS: ClassVar[bool]  # whether it factors in the order that it is given

    permutation: Indices  # row i of Q A Q^T is row permutation[i] of A
    _factor: Any = None

    @classmethod
    def described(cls, ordering: str) -> str:
        """Say which solver this is, and in which order it eliminates."""
        return f"{cls.LIBRARY} ({cls.PACKAGE}, {ordering})"

    def __init__(self, A: spmatrix, ordering: Ordering = "amd") -> None:
        self._guarded(self._begin, A.tocsc(), ordering == "natural")

    def refactor(self, A: spmatrix) -> None:
        """Factor another matrix with the same pattern of nonzeros, in the same order."""
        self._guarded(lambda A: self._factorize(self._converted(A)), A.tocsc())

    def __copy__(self) -> Self:
        """Copy the analysis, so that another matrix can be factored like this one; no factor."""
        other = object.__new__(type(self))
        other.__dict__.update(vars(self), _factor=None)
        return other

    def solve(self, b: Numbers) -> Numbers:
        """Solve A x = b; b is real, one or several columns, or one complex vector."""
        if not np.iscomplexobj(b):
            return self._guarded(self._solve, b)
        x = np.empty(len(b), dtype=complex)
        x[:, None].view(float)[:] = self._guarded(self._solve, b[:, None].view(float))
        return x

    def schur_complement(self, A: csc_matrix, k: int) -> Floats:
        """(k, k) what is left of the last k rows of A, which was factored, without the others.

        Where nothing gives the factor itself, from solutions: it is the inverse of the last block
        of the inverse.
        """
        return self._guarded(self._schur_complement, A, k)

    def _schur_complement(self, A: csc_matrix, k: int) -> Floats:
        n = len(self.permutation)
        inverse = np.empty((k, k))
        for start in range(0, k, COLUMNS):
            some = np.arange(start, min(start + COLUMNS, k))
            unit = np.zeros((n, len(some)))
            unit[n - k + some, some - start] = 1
            inverse[:, some] = self._solve(unit)[n - k :]
        return np.asarray(np.linalg.inv((inverse + inverse.T) / 2), np.float64)

    @classmethod
    def fill_reducing_order(cls, A: spmatrix) -> Indices:
        """(k,) order of the rows of A in which its factor stays sparse.

        A is symmetric, and only the pattern of its lower triangle is read. Of a solver whose
        `ORDERS` is false, the order as given.
        """
        return cls._guarded(lambda A: cls._order(cls._converted(A)), A.tocsc())

    def _begin(self, A: csc_matrix, natural: bool) -> None:
        converted = self._converted(A)
        self._analyze(converted, natural)
        self._factorize(converted)

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
    def _guarded(cls, step: Callable[..., Any], A: Any, *more: Any) -> Any:
        """Take a step, which begins with a matrix or columns A, on one thread; translate errors."""
        try:
            with one_thread():
                return step(A, *more)
        except cls.ERRORS as error:
            raise SolverError(
                f"{cls.LIBRARY} ({cls.PACKAGE}) failed on a Laplacian of size {A.shape[0]:,}: "
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
