"""SuperLU by SciPy, which is always there: the only file that knows it.

References
----------
J. W. Demmel, S. C. Eisenstat, J. R. Gilbert, X. S. Li, J. W. H. Liu. A supernodal approach to
sparse partial pivoting. SIAM J. Matrix Anal. Appl. 20(3), 1999.
"""

from __future__ import annotations

import numpy as np
import scipy
from scipy.sparse import csc_matrix, tril
from scipy.sparse.linalg import splu

from ..arrays import Floats, Indices
from .cholesky import Cholesky


class Factorization(Cholesky):
    """In a minimum degree order of its own, which it finds within the factorization only."""

    LIBRARY = "SuperLU"
    PACKAGE = f"scipy {scipy.__version__}"
    ERRORS = (RuntimeError, np.linalg.LinAlgError, MemoryError)
    ORDERS = False

    @staticmethod
    def _converted(A: csc_matrix) -> csc_matrix:
        lower = tril(A, format="csc")
        full = (lower + tril(A, -1, format="csc").T).tocsc()
        full.sort_indices()
        if full.nnz > np.iinfo(np.intc).max:
            raise MemoryError("SuperLU has no larger indices than of 32 bits")
        full.indices, full.indptr = (i.astype(np.intc) for i in (full.indices, full.indptr))
        return full

    def _analyze(self, A: csc_matrix, natural: bool) -> None:
        """SuperLU has no analysis that could be kept."""

    def _factorize(self, A: csc_matrix) -> None:
        # Pivots on the diagonal only: of a symmetric matrix, all are positive if and only if
        # it is positive definite.
        self._factor = splu(
            A,
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True, "Equil": False},
        )
        if not (self._factor.U.diagonal() > 0).all():
            raise np.linalg.LinAlgError("the matrix is not positive definite")
        self.permutation = np.argsort(self._factor.perm_c)

    def _solve(self, b: Floats) -> Floats:
        return self._factor.solve(b)

    @staticmethod
    def _order(A: csc_matrix) -> Indices:
        return np.arange(A.shape[0])
