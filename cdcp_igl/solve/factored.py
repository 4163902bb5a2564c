"""A surface with its Laplacian and the factor of that: what Algorithm 1 starts from."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csc_matrix

from ..surface.mesh import DiskMesh
from .delaunay import intrinsic_delaunay_laplacian
from .factor import Factor
from .laplacian import Laplacian, cotangent_laplacian

__all__ = ["FactoredSurface"]


@dataclass(frozen=True, eq=False)
class FactoredSurface:
    """A surface, its Laplacian, eq. (8), and the factor of L_II.

    Attributes
    ----------
    mesh : DiskMesh
    laplacian : Laplacian
    factor : Factor
    """

    mesh: DiskMesh
    laplacian: Laplacian
    factor: Factor

    @classmethod
    def of(cls, mesh: DiskMesh) -> FactoredSurface:
        """Factor the cotangent Laplacian of a mesh."""
        L = cotangent_laplacian(mesh)
        return cls(mesh, L, Factor(mesh, L))

    @cached_property
    def coupling(self) -> csc_matrix:
        """(n, nB) L_IB, with empty rows for the boundary; columns in the order of the loop."""
        mesh, L = self.mesh, self.laplacian
        between = np.flatnonzero(mesh.on_boundary[L.low] != mesh.on_boundary[L.high])
        low, high = L.low[between], L.high[between]
        outwards = mesh.on_boundary[high]
        inner, outer = np.where(outwards, low, high), np.where(outwards, high, low)
        shape = len(mesh.V), len(mesh.loop)
        return csc_matrix((-L.weights[between], (inner, mesh.place[outer])), shape)

    @cached_property
    def delaunay(self) -> FactoredSurface:
        """The same surface with the Laplacian of its intrinsic Delaunay triangulation.

        It has no negative weights; made when it is first asked for.
        """
        L = intrinsic_delaunay_laplacian(self.mesh)
        return FactoredSurface(self.mesh, L, Factor(self.mesh, L))

    def moved(self, V: ArrayLike) -> FactoredSurface:
        """Take the same faces with moved vertices; the analysis of the factor is kept."""
        mesh = self.mesh.moved(V)
        L = cotangent_laplacian(mesh)
        return FactoredSurface(mesh, L, self.factor.refactored(L))

    def release(self) -> None:
        """Give back the memory of the factors. Nothing can be solved then."""
        self.factor.release()
        if "delaunay" in self.__dict__:
            self.delaunay.release()
