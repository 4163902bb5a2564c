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
from threadpoolctl import ThreadpoolController

from ..arrays import Complex, Floats
from ..errors import SolverError

__all__ = ["VERSION", "Cholesky", "Numbers", "fill_reducing_order"]

VERSION = version("scikit-sparse")

Ordering = Literal["amd", "natural"]
Numbers = TypeVar("Numbers", Complex, Floats)

# scikit-sparse 0.5 replaced `analyze` and `Factor` by `CholeskyFactor`.
_MODERN = hasattr(cholmod, "CholeskyFactor")

# The supernodes of a surface's Laplacian are small: BLAS threads never gain much on them,
# and lose a factor of 2 to 20 when the cores are shared. The same goes for the OpenMP loops of
# CHOLMOD, which in SuiteSparse 5 ask for four threads whatever the number allowed: on two idle
# cores, the numeric factorization of 750,000 vertices takes 1.4 to 1.9 times as long with them.
# The caller's own settings are back when a call returns.
_POOLS = ThreadpoolController()
_OPENMP = [pool.dynlib for pool in _POOLS.select(user_api="openmp").lib_controllers]


class Cholesky:
    """Factorization Q A Q^T = L L^T of a sparse, symmetric, positive definite matrix.

    Parameters
    ----------
    A : (k, k) sparse matrix of float64
        Symmetric and positive definite, k at least 1; only the lower triangle is read.
    ordering : {"amd", "natural"}
        Fill-reducing permutation Q: approximate minimum degree, which beats nested
        dissection on surfaces; or (up to a postordering) the order as given.

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
        with _POOLS.limit(limits=1), _serial_openmp():
            yield
    except (cholmod.CholmodError, MemoryError) as error:
        raise SolverError(
            f"CHOLMOD (scikit-sparse {VERSION}) failed on a Laplacian of size {size:,}: "
            f"{error or type(error).__name__}. If the mesh has slivers, remesh it; if memory "
            "ran out, decimate it."
        ) from error


@contextmanager
def _serial_openmp() -> Iterator[None]:
    """Let no OpenMP loop be parallel, not even one that names its number of threads."""
    levels = [runtime.omp_get_max_active_levels() for runtime in _OPENMP]
    try:
        for runtime in _OPENMP:
            runtime.omp_set_max_active_levels(0)
        yield
    finally:
        for runtime, level in zip(_OPENMP, levels, strict=True):
            runtime.omp_set_max_active_levels(level)
