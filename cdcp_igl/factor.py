"""One factorization, two solves: pinned, and interior."""

from __future__ import annotations

from copy import copy

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix

from . import cholmod
from .arrays import Complex, Ints
from .cholmod import Cholesky, Numbers
from .mesh import DiskMesh

__all__ = ["Factor"]

# With more boundary vertices than this times sqrt(n), two factorizations cost less than
# one in which the boundary comes last: it leaves a dense block, while a surface has
# separators of about sqrt(n) vertices. Measured on grids of 20,000 and 200,000 vertices
# with sides of ratio 1 to 16: at 4.0 one costs 0.78 times two, at 5.0 0.9-1.2, at 6.3 1.3
# or more.
LONG_BOUNDARY = 5
# Up to this many the block takes a tenth of a second at most. One factor is then preferred
# for its accuracy: on long surfaces the trace is 1e-12 times the interior values of h, and
# elimination towards the boundary does not mix the two.
SHORT_BOUNDARY = 1_500


class Factor:
    """The Cholesky factor of the Laplacian, interior first and boundary last.

    Remove the row and column of one boundary vertex b_1 (the pin) and put the interior,
    in a fill-reducing order, before the rest of the boundary. The leading block of the
    Cholesky factor is then the factor of L_II, so that one factorization serves both

    - the pinned system of eq. (18), L h = r with h = 0 at b_1, and
    - the interior systems of eq. (10), L_II x = b.

    Parameters
    ----------
    mesh : DiskMesh
    L : (n, n) csr_matrix of float64
        A Laplacian of the mesh: symmetric, positive semidefinite, rows sum to zero.

    Attributes
    ----------
    order : (nI,) int64
        The interior vertices in the fill-reducing order.
    solver : str
        Solver, version, ordering, mode and number of factorizations.

    Raises
    ------
    SolverError
        If L pinned is numerically not positive definite.
    """

    def __init__(self, mesh: DiskMesh, L: csr_matrix) -> None:
        interior, nI = mesh.interior, len(mesh.interior)
        self._n, self._interior = len(mesh.V), interior
        self._inner: Cholesky | None = None
        if nI and len(mesh.loop) <= max(SHORT_BOUNDARY, LONG_BOUNDARY * np.sqrt(self._n)):
            first = interior[cholmod.fill_reducing_order(_block(L, interior))]
            self._rows = np.concatenate([first, mesh.loop[1:]])
            self._pinned = Cholesky(_block(L, self._rows), ordering="natural")
        else:
            self._rows = np.concatenate([interior, mesh.loop[1:]])
            self._pinned = Cholesky(_block(L, self._rows), ordering="amd")
        # A postordering may have moved rows; the interior must still come first.
        if nI and (self._pinned.permutation[:nI] >= nI).any():
            self._inner = Cholesky(_block(L, interior), ordering="amd")
        if self._inner:
            self.order = interior[self._inner.permutation]
        else:
            self.order = self._rows[self._pinned.permutation[:nI]]
        count = "two factorizations" if self._inner else "one factorization"
        self.solver = (
            f"CHOLMOD (scikit-sparse {cholmod.VERSION}, AMD ordering, "
            f"{Cholesky.mode} mode, {count})"
        )

    def refactored(self, L: csr_matrix) -> Factor:
        """Factor the Laplacian of the same connectivity elsewhere, without a new analysis.

        Parameters
        ----------
        L : (n, n) csr_matrix of float64
            With the same pattern of nonzeros.

        Returns
        -------
        Factor
        """
        other = copy(self)
        other._pinned = self._pinned.refactored(_block(L, self._rows))
        if self._inner:
            other._inner = self._inner.refactored(_block(L, self._interior))
        return other

    def solve_pinned(self, r: Complex) -> Complex:
        """Solve L h = r with h = 0 at the first boundary vertex.

        Parameters
        ----------
        r : (n,) complex128
            Sums to zero; the entry at the pin follows from the others and is not read.

        Returns
        -------
        (n,) complex128
        """
        h = np.zeros(self._n, dtype=complex)
        h[self._rows] = self._pinned.solve(r[self._rows])
        return h

    def solve_interior(self, b: Numbers) -> Numbers:
        """Solve L_II x = b.

        Parameters
        ----------
        b : (nI,) complex128 or float64
            In the order of ``mesh.interior``.

        Returns
        -------
        (nI,) of the same type
        """
        if self._inner is not None:
            return self._inner.solve(b)
        nI = len(self._interior)
        if nI == 0:
            return b.copy()
        # Forward with b in the leading block, backward with the boundary block zeroed:
        # exactly the two substitutions with the factor of L_II.
        vertex = self._rows[self._pinned.permutation]
        x = np.zeros(self._n, dtype=b.dtype)
        x[self._interior] = b
        y = self._pinned.solve_lower(x[vertex])
        y[nI:] = 0
        x[vertex] = self._pinned.solve_upper(y)
        return x[self._interior]


def _block(L: csr_matrix, rows: Ints) -> csc_matrix:
    return L[rows][:, rows].T  # symmetric: the transpose only renames CSR to CSC
