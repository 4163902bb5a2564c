"""One factorization, two solves: pinned, and interior."""

from __future__ import annotations

from copy import copy

import numpy as np

from ..arrays import Complex
from ..surface.mesh import DiskMesh
from .cholesky import Cholesky, Numbers
from .laplacian import Laplacian
from .ordering import elimination_order

__all__ = ["Factor"]

# With more boundary vertices than this times sqrt(n), two factorizations cost less than
# one in which the boundary comes last: it leaves a dense block, while a surface has
# separators of about sqrt(n) vertices. Measured on grids of 20,000 and 200,000 vertices
# with sides of ratio 1 to 16: at 4.0 one costs 0.7-0.8 times two, at 5.0 0.85-1.0, at 6.3
# 1.0-1.3, at 8.5 1.4 or more.
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
    L : Laplacian
        Positive semidefinite.

    Attributes
    ----------
    order : (nI,) ndarray of int
        The interior vertices in the fill-reducing order.
    solver : str
        Solver, version, ordering, mode and number of factorizations.

    Raises
    ------
    SolverError
        If L pinned is numerically not positive definite.
    """

    def __init__(self, mesh: DiskMesh, L: Laplacian) -> None:
        self._n, self._interior = len(mesh.V), mesh.interior
        nI = len(mesh.interior)
        # The order of all vertices serves both systems: restricted to the interior, it is as
        # good as the interior's own.
        order, name = elimination_order(L, mesh.V)
        self._inner_rows = order[~mesh.on_boundary[order]]
        self._rows = order[order != mesh.loop[0]]
        if len(mesh.loop) <= max(SHORT_BOUNDARY, LONG_BOUNDARY * np.sqrt(self._n)):
            self._rows = self._rows[np.argsort(mesh.on_boundary[self._rows], kind="stable")]
        self._pinned = Cholesky(L.block(self._rows), ordering="natural")
        # A postordering may have moved rows; the interior must still come first.
        self._inner: Cholesky | None = None
        first = self._rows[self._pinned.permutation[:nI]]
        if mesh.on_boundary[first].any() or not self._pinned.solver.TRIANGULAR:
            self._inner = Cholesky(L.block(self._inner_rows), ordering="natural")
            first = self._inner_rows[self._inner.permutation]
        self.order = first
        count = "two factorizations" if self._inner else "one factorization"
        used = self._pinned.solver
        self.solver = f"{used.LIBRARY} ({used.PACKAGE}, {name} ordering, {used.MODE} mode, {count})"

    def refactored(self, L: Laplacian) -> Factor:
        """Factor the Laplacian of the same connectivity elsewhere, without a new analysis.

        Parameters
        ----------
        L : Laplacian
            With the same edges.

        Returns
        -------
        Factor
        """
        other = copy(self)
        other._pinned = self._pinned.refactored(L.block(self._rows))
        if self._inner:
            other._inner = self._inner.refactored(L.block(self._inner_rows))
        return other

    def release(self) -> None:
        """Give back the memory, which is most of what a map takes. Nothing can be solved then."""
        self.__dict__.pop("_pinned", None)
        self.__dict__.pop("_inner", None)

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
        x = np.zeros(self._n, dtype=b.dtype)
        x[self._interior] = b
        if self._inner is not None:
            x[self._inner_rows] = self._inner.solve(x[self._inner_rows])
        else:
            # Forward with b in the leading block, backward with the boundary block zeroed:
            # exactly the two substitutions with the factor of L_II.
            vertex = self._rows[self._pinned.permutation]
            y = self._pinned.solve_lower(x[vertex])
            y[len(b) :] = 0
            x[vertex] = self._pinned.solve_upper(y)
        return x[self._interior]
