"""The Dirichlet problem of a Laplacian."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix

from ..arrays import Complex, Floats, Ints
from ..solve.solvers import factorize

__all__ = ["Dirichlet"]


class Dirichlet:
    """Given the values on a set S of vertices, solve L u = r at the others.

    A boundary vertex outside S keeps its row of L, which is the natural boundary
    condition.

    Parameters
    ----------
    L : (n, n) csr_matrix of float64
        A Laplacian of a connected surface: symmetric, positive semidefinite, rows sum to
        zero.
    S : (k,) int64
        Distinct vertices, at least one.

    Raises
    ------
    SolverError
        If L without the rows and columns of S is numerically not positive definite.

    Examples
    --------
    A linear function on a plane mesh is harmonic, so its boundary values give it back:

    >>> import numpy as np
    >>> import cdcp_igl
    >>> from cdcp_igl.solve.laplacian import cotangent_laplacian
    >>> from cdcp_igl.surface.mesh import DiskMesh
    >>> from cdcp_igl.reference import Dirichlet
    >>> V, F, _ = cdcp_igl.datasets.square(4)
    >>> mesh, x = DiskMesh(V, F), V[:, 0]
    >>> u = Dirichlet(cotangent_laplacian(mesh).matrix(), mesh.loop).solve(x[mesh.loop])
    >>> bool(abs(u - x).max() < 1e-12)
    True
    """

    def __init__(self, L: csr_matrix, S: Ints) -> None:
        free = np.ones(L.shape[0], dtype=bool)
        free[S] = False
        self._L, self._S, self._free = L, S, np.flatnonzero(free)
        if len(self._free):
            self._factor = factorize(L[self._free][:, self._free])

    def solve(self, c: Complex | Floats, r: Complex | Floats | float = 0) -> Complex:
        """Solve for one complex function, whose parts share the factorization.

        Parameters
        ----------
        c : (k,) complex128 or float64
            Values on S, in the order of S.
        r : (n,) complex128 or float64, optional
            Right-hand side; not read on S.

        Returns
        -------
        (n,) complex128
        """
        u = np.zeros(self._L.shape[0], dtype=complex)
        u[self._S] = c
        if len(self._free):
            u[self._free] = self._factor.solve((r - self._L @ u)[self._free])
        return u
