"""The factorization for given values: that of L_II serves every step of the algorithm."""

from __future__ import annotations

from copy import copy

import numpy as np

from ..arrays import Bools
from ..surface.mesh import DiskMesh
from .cholesky import Cholesky, Numbers
from .laplacian import Laplacian
from .memory import require_memory
from .ordering import elimination_order

__all__ = ["Factor"]


class Factor:
    """The Cholesky factor of a block of a Laplacian: L_II, or that of other free vertices.

    Parameters
    ----------
    mesh : DiskMesh
    L : Laplacian
        The block positive definite.
    free : (n,) bool, optional
        The vertices that are unknowns, elsewhere values are given; those inside, if not told.

    Attributes
    ----------
    order : (k,) ndarray of int
        The free vertices in the order of elimination.
    solver : str
        Solver, version, ordering and mode.

    Raises
    ------
    SolverError
        If the block is numerically not positive definite, or cannot fit into memory.
    """

    def __init__(self, mesh: DiskMesh, L: Laplacian, free: Bools | None = None) -> None:
        require_memory(len(mesh.V))
        free = ~mesh.on_boundary if free is None else free
        self._rows, ordering, name = elimination_order(L, mesh.V, free)
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
        """Solve L_II x_I = b_I, I the free vertices.

        Parameters
        ----------
        b : (n,) complex128 or float64
            By the vertices; looked at where they are free.

        Returns
        -------
        (n,) of the same type
            Zero elsewhere.
        """
        x = np.zeros_like(b)
        x[self._rows] = self._cholesky.solve(b[self._rows])
        return x
