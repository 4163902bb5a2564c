"""A surface with its Laplacian and the factor of that: what Algorithm 1 starts from."""

from __future__ import annotations

from copy import copy

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Bools, Complex, Indices, Numbers
from ..cached import cached_property
from ..surface.mesh import Mesh
from .cholesky import Cholesky
from .laplacian import Laplacian, cotangent_laplacian, intrinsic_delaunay_laplacian
from .memory import require_memory
from .ordering import elimination_order
from .solvers import solver


class FactoredSurface:
    """A surface, its Laplacian, eq. (8), and the Cholesky factor of L_II.

    I are the `free` vertices, the unknowns; those inside, if not told. On the others values are
    given. If an `order` of them is known, it is taken.

    Its `order` (k,) is that of elimination, of its `rows`, in which the solver gets them; `solver`
    says solver, version and ordering.
    SolverError if the block is numerically not positive definite, or cannot fit into memory.
    """

    def __init__(
        self,
        mesh: Mesh,
        laplacian: Laplacian,
        free: Bools | None = None,
        order: Indices | None = None,
    ) -> None:
        require_memory(len(mesh.scaled))
        factorization = solver()
        if order is None:
            free = ~mesh.on_boundary if free is None else free
            rows, ordering, name = elimination_order(laplacian, mesh.scaled, free, factorization)
        else:
            rows, ordering, name = order, "natural", "given"
        block = laplacian.block(rows)
        self.solver = factorization.described(f"{name} ordering")
        cholesky = factorization(block, ordering)
        self.mesh, self.laplacian = mesh, laplacian
        self.rows, self._cholesky = rows, cholesky
        self.order = rows[cholesky.permutation]

    @classmethod
    def of(cls, mesh: Mesh) -> FactoredSurface:
        """Factor the cotangent Laplacian of a mesh."""
        return cls(mesh, cotangent_laplacian(mesh))

    def moved(self, V: ArrayLike) -> FactoredSurface:
        """Take the same faces with moved vertices; the analysis of the factor is kept."""
        other = object.__new__(FactoredSurface)
        other.mesh = self.mesh.moved(V)
        other.laplacian = cotangent_laplacian(other.mesh)
        other.rows, other.order, other.solver = self.rows, self.order, self.solver
        other._cholesky = self.analysis
        other._cholesky.refactor(other.laplacian.block(self.rows))
        return other

    def solve(self, b: Numbers) -> Numbers:
        """Solve L_II x_I = b_I, I the free vertices, for b (n,); x (n,) is zero elsewhere."""
        x = np.zeros_like(b)
        x[self.rows] = self._cholesky.solve(b[self.rows])
        return x

    @cached_property
    def coupling(self) -> Laplacian:
        """The edges between inside and boundary: L_IB on what is 0 inside, L_BI on what is not."""
        L, on_boundary = self.laplacian, self.mesh.on_boundary
        between = np.flatnonzero(on_boundary[L.low] != on_boundary[L.high])
        return Laplacian(L.low[between], L.high[between], L.weights[between], L.diagonal)

    @cached_property
    def delaunay(self) -> FactoredSurface:
        """The same surface with the Laplacian of its intrinsic Delaunay triangulation."""
        return FactoredSurface(self.mesh, intrinsic_delaunay_laplacian(self.mesh))

    @property
    def analysis(self) -> Cholesky:
        """What refactors the block `rows` of any matrix with these edges; it solves nothing yet."""
        return copy(self._cholesky)

    def release(self) -> None:
        """Give back the memory of the factors, most of what a map takes: no solve after that."""
        self._cholesky = self.analysis
        if "delaunay" in self.__dict__:
            self.delaunay.release()


def harmonic_extension(surface: FactoredSurface, f_B: Complex) -> Complex:
    """Extend boundary values (nB,) harmonically: L_II f_I = -L_IB f_B, eq. (10)."""
    f = np.zeros(len(surface.mesh.scaled), dtype=np.complex128)
    f[surface.mesh.loop] = f_B
    return f - surface.solve(surface.coupling.times(f))


def extended_again(surface: FactoredSurface, f: Complex) -> Complex:
    """Make the interior of a map (n,) harmonic again, by the differences of neighbours.

    Where these are much smaller than f itself, and f is small, they have digits that a solution for
    the boundary values has not. The boundary stays.
    """
    return f - surface.solve(surface.laplacian.times(f))
