"""SuperLU by SciPy, which is always there: the only file that knows it.

References
----------
J. W. Demmel, S. C. Eisenstat, J. R. Gilbert, X. S. Li, J. W. H. Liu. A supernodal approach to
sparse partial pivoting. SIAM J. Matrix Anal. Appl. 20(3), 1999.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.sparse import csc_matrix, tril
from scipy.sparse.linalg import splu

from ..arrays import Floats

__all__ = ["ERRORS", "LIBRARY", "MODE", "ORDERS", "PACKAGE", "Factorization", "order"]

LIBRARY = "SuperLU"
PACKAGE = f"scipy {scipy.__version__}"
MODE = "symmetric"
ERRORS: tuple[type[Exception], ...] = (RuntimeError, np.linalg.LinAlgError)
ORDERS = False  # it finds one within the factorization only


class Factorization:
    """See `solvers.Factorization`; in a minimum degree order of its own."""

    def __init__(self, A: csc_matrix, natural: bool) -> None:
        self.refactor(A)

    def refactor(self, A: csc_matrix) -> None:
        """Factor from the beginning."""
        lower = tril(A, format="csc")
        full = (lower + tril(A, -1, format="csc").T).tocsc()
        full.sort_indices()
        most = np.iinfo(np.intc).max
        if full.nnz > most:
            raise MemoryError("SuperLU has no larger indices than of 32 bits")
        full.indices, full.indptr = (i.astype(np.intc) for i in (full.indices, full.indptr))
        # Pivots on the diagonal only: of a symmetric matrix, all are positive if and only if
        # it is positive definite.
        self._factor = splu(
            full,
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True, "Equil": False},
        )
        if not (self._factor.U.diagonal() > 0).all():
            raise np.linalg.LinAlgError("the matrix is not positive definite")
        self.permutation = np.argsort(self._factor.perm_c)

    def refactored(self, A: csc_matrix) -> Factorization:
        """Factor from the beginning."""
        return Factorization(A, False)

    def solve(self, b: Floats) -> Floats:
        """Solve A x = b."""
        return self._factor.solve(b)


def order(A: csc_matrix) -> NDArray[np.signedinteger[Any]]:
    """(k,) the order as given."""
    return np.arange(A.shape[0])
