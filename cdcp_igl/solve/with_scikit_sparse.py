"""CHOLMOD by scikit-sparse: the only file that knows it, both its versions.

References
----------
Y. Chen, T. A. Davis, W. W. Hager, S. Rajamanickam. Algorithm 887: CHOLMOD, supernodal sparse
Cholesky factorization and update/downdate. ACM Trans. Math. Softw. 35(3), 2008.
"""

from __future__ import annotations

from importlib.metadata import version
from math import log2
from typing import Any

import numpy as np
from scipy.sparse import csc_matrix
from sksparse import cholmod

from ..arrays import Floats, Indices
from .cholesky import Cholesky, Ordering, trailing_block

# The factor of a surface of n vertices has 4 to 5 n log2(n) entries on scans, terrains and grids
# from 50,000 to 10 million vertices, zeros of supernodes included. The least is taken here.
ENTRIES = 4.0
# CHOLMOD's own indices are those of the matrix. With 32 bits it ends at 2^31 entries of the factor;
# half as many leave room for the estimate, and 64 bits cost little.
ENTRIES_OF_32_BITS = 2**30

# From so many rows on supernodes are worth their zeros, on planar graphs, which disks, rings and
# spheres are. At 3,000 a simplicial factor with three solves takes 0.4 to 0.7 times as long, at
# 11,000 in the midst of a map 1.3 times.
SUPERNODAL = 6_000

# scikit-sparse 0.5 replaced `analyze` and `Factor` by `CholeskyFactor`.
_MODERN = hasattr(cholmod, "CholeskyFactor")


class Factorization(Cholesky):
    """In the order as given up to a postordering."""

    LIBRARY = "CHOLMOD"
    PACKAGE = f"scikit-sparse {version('scikit-sparse')}"
    ERRORS = (cholmod.CholmodError, np.linalg.LinAlgError, MemoryError)
    ORDERS = True

    @staticmethod
    def _converted(A: csc_matrix) -> csc_matrix:
        if not all(array.flags.writeable for array in (A.data, A.indices, A.indptr)):
            A = A.copy()  # scikit-sparse 0.5 refuses it
        if factor_entries(A.shape[0]) > ENTRIES_OF_32_BITS:
            A = csc_matrix(A)  # the same entries
            A.indices, A.indptr = (i.astype(np.int64) for i in (A.indices, A.indptr))
        return A

    def _analyze(self, A: csc_matrix, natural: bool) -> None:
        ordering: Ordering = "natural" if natural else "amd"
        mode = "simplicial" if A.shape[0] < SUPERNODAL else "supernodal"
        self._symbolic, self.permutation = _analysis(A, mode, ordering)

    def _factorize(self, A: csc_matrix) -> None:
        # In a copy of the symbolic analysis: scikit-sparse 0.5 leaves a simplicial factor
        # behind, and to factor in that takes 2.6 times as long as analysis and factorization
        # (216,000 vertices), in a copy 0.4 to 0.7 times. A solve takes 0.03 times as long in it.
        self._factor = self._symbolic.copy()
        if _MODERN:
            self._factor.factorize(A)
        else:
            self._factor.cholesky_inplace(A)
            # Its simplicial factors are L D L^T, of any matrix without a zero on the way.
            if A.shape[0] < SUPERNODAL and not (self._factor.D() > 0).all():
                raise np.linalg.LinAlgError("the matrix is not positive definite")

    def _solve(self, b: Floats) -> Floats:
        return self._factor.solve(b) if _MODERN else self._factor(b)

    def _schur_complement(self, A: csc_matrix, k: int) -> Floats:
        L = self._factor.get_factor("LL", lower=True) if _MODERN else self._factor.L()
        block = trailing_block(L, self.permutation, k)
        return block @ block.T

    @staticmethod
    def _order(A: csc_matrix) -> Indices:
        # The permutation is that of the supernodal mode, whose analysis takes longer.
        return _analysis(A, "simplicial", "amd")[1]


def factor_entries(n: int) -> float:
    """Estimate how many entries the factor of a surface with n vertices has, at least."""
    return ENTRIES * n * log2(n + 1)


def _analysis(A: csc_matrix, mode: str, ordering: Ordering) -> tuple[Any, Indices]:
    """Analyse the pattern of a matrix, and return its permutation, too."""
    if _MODERN:
        symbolic = cholmod.CholeskyFactor(A, supernodal_mode=mode, order=ordering)
        return symbolic, symbolic.get_perm()
    symbolic = cholmod.analyze(A, mode=mode, ordering_method=ordering)
    return symbolic, symbolic.P()
