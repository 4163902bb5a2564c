"""Sparse Cholesky factorization: the only file that knows scikit-sparse, both its versions."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from copy import copy
from importlib.metadata import version
from typing import Any, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix, spmatrix
from sksparse import cholmod

from ..arrays import Complex, Floats
from ..errors import SolverError
from .threads import one_thread

__all__ = ["VERSION", "Cholesky", "Numbers", "fill_reducing_order"]

VERSION = version("scikit-sparse")

Ordering = Literal["amd", "natural"]
Numbers = TypeVar("Numbers", Complex, Floats)

# scikit-sparse 0.5 replaced `analyze` and `Factor` by `CholeskyFactor`.
_MODERN = hasattr(cholmod, "CholeskyFactor")


class Cholesky:
    """Factorization Q A Q^T = L L^T of a sparse, symmetric, positive definite matrix.

    Parameters
    ----------
    A : (k, k) sparse matrix of float64
        Symmetric and positive definite, k at least 1; only the lower triangle is read.
    ordering : {"amd", "natural"}
        Fill-reducing permutation Q: approximate minimum degree; or (up to a postordering)
        the order as given, such as that of `elimination_order`.

    Attributes
    ----------
    permutation : (k,) ndarray of int
        Row i of Q A Q^T is row ``permutation[i]`` of A.
    ordering : str
    mode : str
        Always ``"supernodal"``: the fastest on all but the smallest meshes, and the one
        in which both versions notice a matrix that is not positive definite.

    Raises
    ------
    SolverError
        If A is not numerically positive definite or memory runs out.
    """

    mode = "supernodal"

    def __init__(self, A: spmatrix, ordering: Ordering = "amd") -> None:
        A = _writeable(A)
        self.ordering = ordering
        with _solver(A.shape[0]):
            if _MODERN:
                symbolic = cholmod.CholeskyFactor(A, supernodal_mode=self.mode, order=ordering)
            else:
                symbolic = cholmod.analyze(A, mode=self.mode, ordering_method=ordering)
        self._symbolic = symbolic
        self.refactor(A)
        self.permutation = symbolic.get_perm() if _MODERN else symbolic.P()

    def refactor(self, A: spmatrix) -> None:
        """Factor another matrix with the same pattern of nonzeros, without a new analysis."""
        A = _writeable(A)
        # From a copy of the symbolic analysis: scikit-sparse 0.5 leaves a simplicial factor
        # behind, and to factor in that takes 2.6 times as long as analysis and factorization
        # (216,000 vertices), in a copy 0.4 to 0.7 times. A solve takes 0.03 times as long in it.
        with _solver(A.shape[0]):
            self._factor = self._symbolic.copy()
            if _MODERN:
                self._factor.factorize(A)
            else:
                self._factor.cholesky_inplace(A)

    def refactored(self, A: spmatrix) -> Cholesky:
        """Factor another matrix like `refactor`, and keep this factorization as well."""
        other = copy(self)
        other.refactor(A)
        return other

    def solve(self, b: Numbers) -> Numbers:
        """Solve A x = b; b is real, one or several columns, or one complex vector."""
        return self._run(b, "A", lambda b: self._factor(b))

    def solve_lower(self, b: Numbers) -> Numbers:
        """Solve L x = b, rows of b in the permuted order; b as in `solve`."""
        return self._run(b, "L", lambda b: self._factor.solve_L(b, False))

    def solve_upper(self, b: Numbers) -> Numbers:
        """Solve L^T x = b, rows of b in the permuted order; b as in `solve`."""
        return self._run(b, "Lt", lambda b: self._factor.solve_Lt(b, False))

    def _run(self, b: Any, system: str, older: Callable[[Floats], Floats]) -> Any:
        """Solve with either version; a complex vector as its two parts, column by column."""
        if np.iscomplexobj(b):
            x = self._run(np.array([b.real, b.imag]).T, system, older)  # Fortran order
            return x[:, 0] + 1j * x[:, 1]
        with _solver(len(b)):
            return self._factor.solve(b, system=system) if _MODERN else older(b)


def fill_reducing_order(A: spmatrix) -> NDArray[np.int32]:
    """(k,) approximate minimum degree order of the rows of A, postordered.

    A is symmetric, and only the pattern of its lower triangle is read.
    """
    A = _writeable(A)
    # The permutation is that of the supernodal mode, whose analysis takes longer.
    with _solver(A.shape[0]):
        if _MODERN:
            return cholmod.CholeskyFactor(A, supernodal_mode="simplicial", order="amd").get_perm()
        return cholmod.analyze(A, mode="simplicial", ordering_method="amd").P()


def _writeable(A: spmatrix) -> csc_matrix:
    """Return A by columns, copied if it is read-only, which scikit-sparse 0.5 refuses."""
    A = csc_matrix(A)
    writeable = all(array.flags.writeable for array in (A.data, A.indices, A.indptr))
    return A if writeable else A.copy()


@contextmanager
def _solver(size: int) -> Iterator[None]:
    """Run CHOLMOD on one thread and translate its errors."""
    try:
        with one_thread():
            yield
    except (cholmod.CholmodError, MemoryError) as error:
        raise SolverError(
            f"CHOLMOD (scikit-sparse {VERSION}) failed on a Laplacian of size {size:,}: "
            f"{error or type(error).__name__}. If the mesh has slivers, remesh it; if memory "
            "ran out, decimate it."
        ) from error
