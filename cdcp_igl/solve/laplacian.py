"""The cotangent Laplacian, eq. (8)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csc_matrix, csr_matrix

from ..arrays import Floats, Indices, Ints
from ..surface.mesh import DiskMesh


@dataclass(frozen=True, eq=False)
class Laplacian:
    """A symmetric matrix by its edges and its diagonal; of a Laplacian, rows sum to zero.

    It takes half the memory of the matrix, and its rows are permuted before they are assembled.
    Cotangents that cancel are entries like all others: orders that reduce fill, and analyses,
    hold wherever the vertices are.

    Attributes
    ----------
    low, high : (e,) ndarray of int
        The ends of each edge, low < high; sorted by the first and then by the second.
    weights : (e,) float64
        Minus the entries off the diagonal.
    diagonal : (n,) float64
        Of a Laplacian, the sums of the weights at each vertex.
    """

    low: Indices
    high: Indices
    weights: Floats
    diagonal: Floats

    @classmethod
    def of(cls, low: Indices, high: Indices, weights: Floats, n: int) -> Laplacian:
        """Make a Laplacian of n rows: sum up its diagonal."""
        diagonal = np.bincount(low, weights, n)
        diagonal += np.bincount(high, weights, n)
        return cls(low, high, weights, diagonal.astype(float, copy=False))

    def matrix(self) -> csr_matrix:
        """(n, n) the matrix, symmetric to the last bit."""
        vertices = np.arange(len(self.diagonal), dtype=self.low.dtype)
        # In this order every row has its columns in ascending order, and nothing is left to sort.
        rows = np.concatenate([self.high, vertices, self.low])
        columns = np.concatenate([self.low, vertices, self.high])
        entries = np.concatenate([-self.weights, self.diagonal, -self.weights])
        return _without_duplicates(entries, rows, columns, len(vertices)).tocsr()

    def block(self, vertices: Ints | Indices) -> csc_matrix:
        """(k, k) lower triangle of the rows and columns of some vertices, in this order."""
        rank = np.full(len(self.diagonal), -1, dtype=self.low.dtype)
        rank[vertices] = diagonal = np.arange(len(vertices), dtype=self.low.dtype)
        one, other = rank[self.low], rank[self.high]
        rows, columns = np.maximum(one, other), np.minimum(one, other)
        inside = columns >= 0
        rows = np.concatenate([diagonal, rows[inside]])
        columns = np.concatenate([diagonal, columns[inside]])
        entries = np.concatenate([self.diagonal[vertices], -self.weights[inside]])
        return _without_duplicates(entries, rows, columns, len(vertices)).tocsc()


def _without_duplicates(entries: Floats, rows: Indices, columns: Indices, n: int) -> coo_matrix:
    matrix = coo_matrix((entries, (rows, columns)), (n, n))
    matrix.has_canonical_format = True  # saves scipy a search
    return matrix


def cotangent_laplacian(mesh: DiskMesh) -> Laplacian:
    """Compute the positive semidefinite cotangent Laplacian, eq. (8).

    L_ij = -(cot a_ij + cot b_ij) / 2 on edges, rows sum to zero; the negative of
    ``igl.cotmatrix(V, F)``, by the edges that the check has found.
    """
    edges = mesh.edges
    weights = edges.sum_opposite(mesh.cotangents) / 2
    return Laplacian.of(edges.low, edges.high, weights, len(mesh.V))
