"""CHOLMOD by scikit-sparse: the only file that knows it, both its versions.

References
----------
Y. Chen, T. A. Davis, W. W. Hager, S. Rajamanickam. Algorithm 887: CHOLMOD, supernodal sparse
Cholesky factorization and update/downdate. ACM Trans. Math. Softw. 35(3), 2008.
"""

from __future__ import annotations

from copy import copy
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix
from sksparse import cholmod

from ..arrays import Floats
from .memory import factor_entries

__all__ = ["ERRORS", "LIBRARY", "MODE", "ORDERS", "PACKAGE", "Factorization", "order"]

LIBRARY = "CHOLMOD"
PACKAGE = f"scikit-sparse {version('scikit-sparse')}"
# The fastest on all but the smallest meshes, and the one in which both versions notice a matrix
# that is not positive definite.
MODE = "supernodal"
ERRORS: tuple[type[Exception], ...] = (cholmod.CholmodError,)
ORDERS = True

# CHOLMOD's own indices are those of the matrix. With 32 bits it ends at 2^31 entries of the factor;
# half as many leave room for the estimate, and 64 bits cost little.
ENTRIES_OF_32_BITS = 2**30

# scikit-sparse 0.5 replaced `analyze` and `Factor` by `CholeskyFactor`.
_MODERN = hasattr(cholmod, "CholeskyFactor")


class Factorization:
    """See `solvers.Factorization`; the order as given up to a postordering."""

    def __init__(self, A: csc_matrix, natural: bool) -> None:
        ordering, A = "natural" if natural else "amd", _indexed(A)
        if _MODERN:
            self._symbolic = cholmod.CholeskyFactor(A, supernodal_mode=MODE, order=ordering)
            self.permutation = self._symbolic.get_perm()
        else:
            self._symbolic = cholmod.analyze(A, mode=MODE, ordering_method=ordering)
            self.permutation = self._symbolic.P()
        self.refactor(A)

    def refactor(self, A: csc_matrix) -> None:
        """Factor from the same symbolic analysis."""
        # From a copy of the symbolic analysis: scikit-sparse 0.5 leaves a simplicial factor
        # behind, and to factor in that takes 2.6 times as long as analysis and factorization
        # (216,000 vertices), in a copy 0.4 to 0.7 times. A solve takes 0.03 times as long in it.
        self._factor, A = self._symbolic.copy(), _indexed(A)
        if _MODERN:
            self._factor.factorize(A)
        else:
            self._factor.cholesky_inplace(A)

    def refactored(self, A: csc_matrix) -> Factorization:
        """Factor from the same symbolic analysis."""
        other = copy(self)
        other.refactor(A)
        return other

    def solve(self, b: Floats) -> Floats:
        """Solve A x = b."""
        return self._factor.solve(b) if _MODERN else self._factor(b)


def order(A: csc_matrix) -> NDArray[np.signedinteger[Any]]:
    """(k,) approximate minimum degree order, postordered."""
    # The permutation is that of the supernodal mode, whose analysis takes longer.
    if _MODERN:
        return cholmod.CholeskyFactor(A, supernodal_mode="simplicial", order="amd").get_perm()
    return cholmod.analyze(A, mode="simplicial", ordering_method="amd").P()


def _indexed(A: csc_matrix) -> csc_matrix:
    """Give a matrix 64-bit indices if its factor needs them."""
    if factor_entries(A.shape[0]) > ENTRIES_OF_32_BITS:
        A = csc_matrix(A)  # the same entries
        A.indices, A.indptr = (i.astype(np.int64) for i in (A.indices, A.indptr))
    return A
