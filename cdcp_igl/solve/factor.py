"""The factorization of L_II, which serves every step of the algorithm."""

from __future__ import annotations

from copy import copy

import numpy as np

from ..surface.mesh import DiskMesh
from .cholesky import Cholesky, Numbers
from .laplacian import Laplacian
from .ordering import elimination_order

__all__ = ["Factor"]


class Factor:
    """The Cholesky factor of the interior block of a Laplacian.

    Parameters
    ----------
    mesh : DiskMesh
    L : Laplacian
        L_II positive definite.

    Attributes
    ----------
    order : (nI,) ndarray of int
        The interior vertices in the order of elimination.
    solver : str
        Solver, version, ordering and mode.

    Raises
    ------
    SolverError
        If L_II is numerically not positive definite.
    """

    def __init__(self, mesh: DiskMesh, L: Laplacian) -> None:
        self._rows, ordering, name = elimination_order(L, mesh.V, ~mesh.on_boundary)
        self._cholesky = Cholesky(L.block(self._rows), ordering)
        self.order = self._rows[self._cholesky.permutation]
        used = self._cholesky.solver
        self.solver = f"{used.LIBRARY} ({used.PACKAGE}, {name} ordering, {used.MODE} mode)"

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
        other._cholesky = self._cholesky.refactored(L.block(self._rows))
        return other

    def release(self) -> None:
        """Give back the memory, which is most of what a map takes. Nothing can be solved then."""
        self.__dict__.pop("_cholesky", None)

    def solve(self, b: Numbers) -> Numbers:
        """Solve L_II x_I = b_I.

        Parameters
        ----------
        b : (n,) complex128 or float64
            By the vertices; not looked at on the boundary.

        Returns
        -------
        (n,) of the same type
            Zero on the boundary.
        """
        x = np.zeros_like(b)
        x[self._rows] = self._cholesky.solve(b[self._rows])
        return x
