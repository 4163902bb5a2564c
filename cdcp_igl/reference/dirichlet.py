"""The Dirichlet problem of a Laplacian."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix

from ..arrays import Complex, Floats, Ints
from ..solve.solvers import factorize


class Dirichlet:
    """Given the values on distinct vertices S (k,), k at least 1, solve L u = r at the others.

    L (n, n) is symmetric and positive semidefinite, and its rows sum to zero. A boundary vertex
    outside S keeps its row of L, which is the natural boundary condition.
    """

    def __init__(self, L: csr_matrix, S: Ints) -> None:
        free = np.ones(L.shape[0], dtype=bool)
        free[S] = False
        self._L, self._S, self._free = L, S, np.flatnonzero(free)
        if len(self._free):
            self._factor = factorize(L[self._free][:, self._free])

    def solve(self, c: Complex | Floats, r: Complex | Floats | float = 0) -> Complex:
        """(n,) the solution with values c (k,), in the order of S; r (n,) is not read on S."""
        u = np.zeros(self._L.shape[0], dtype=complex)
        u[self._S] = c
        if len(self._free):
            u[self._free] = self._factor.solve((r - self._L @ u)[self._free])
        return u
