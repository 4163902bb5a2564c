"""The cotangent Laplacian, eq. (8), of a mesh and of its intrinsic Delaunay triangulation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csc_matrix, csr_matrix

from ..arrays import Floats, Indices, Ints, Numbers
from ..surface.delaunay import intrinsic_delaunay
from ..surface.mesh import Mesh
from ..surface.topology import Edges


@dataclass(frozen=True, eq=False)
class Laplacian:
    """A symmetric matrix by its edges and its diagonal; of a Laplacian, rows sum to zero.

    It takes half the memory of the matrix, and its rows are permuted before they are assembled.
    Cotangents that cancel are entries like all others: orders that reduce fill, and analyses,
    hold wherever the vertices are.

    """

    low: Indices  # (e,) ends of each edge, low < high; sorted by the first, then by the second
    high: Indices
    weights: Floats  # (e,) minus the entries off the diagonal
    diagonal: Floats  # (n,) of a Laplacian, the sums of the weights at each vertex

    @classmethod
    def of(cls, low: Indices, high: Indices, weights: Floats, n: int) -> Laplacian:
        """Make a Laplacian of n rows: sum up its diagonal."""
        diagonal = np.bincount(low, weights, n)
        diagonal += np.bincount(high, weights, n)
        return cls(low, high, weights, diagonal.astype(float, copy=False))

    def times(self, x: Numbers) -> Numbers:
        """Multiply by x (n,), from the differences of neighbours: rows must sum to zero."""
        n, flow = len(x), self.weights * (x[self.low] - x[self.high])
        parts = flow[:, None].view(np.float64).T  # real and imaginary
        sums = [np.bincount(self.low, part, n) - np.bincount(self.high, part, n) for part in parts]
        return np.column_stack(sums).view(x.dtype)[:, 0]

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


def cotangent_laplacian(mesh: Mesh, cotangents: Floats | None = None) -> Laplacian:
    """Compute the positive semidefinite cotangent Laplacian, eq. (8).

    L_ij = -(cot a_ij + cot b_ij) / 2 on edges, rows sum to zero; the negative of
    ``igl.cotmatrix(V, F)``, by the edges that the check has found. The `cotangents` (m, 3) may be
    those of another metric.
    """
    edges = mesh.edges
    weights = sum_opposite(edges, mesh.cotangents if cotangents is None else cotangents) / 2
    return Laplacian.of(edges.low, edges.high, weights, len(mesh.scaled))


def sum_opposite(edges: Edges, x: Floats) -> Floats:
    """(e,) sums of the values x (m, 3) at the corners opposite each edge."""
    # Half-edge k m + f leaves corner k of face f, so it lies opposite corner k - 1, where
    # that of the first is the last: counted from the end, as negative indices are.
    return np.add.reduceat(x.T.ravel()[edges.sides - len(x)], edges.start)


def intrinsic_delaunay_laplacian(mesh: Mesh) -> Laplacian:
    """Compute the cotangent Laplacian of the intrinsic Delaunay triangulation.

    It has no negative weight inside.
    """
    F, cotangents = intrinsic_delaunay(mesh)
    n, weights = len(mesh.scaled), cotangents.ravel() / 2
    tails, heads = F[:, [1, 2, 0]].ravel(), F[:, [2, 0, 1]].ravel()
    low, high = np.minimum(tails, heads), np.maximum(tails, heads)
    proper = low < high  # edges of a triangulation that is not the mesh's may be loops
    above = coo_matrix((weights[proper], (low[proper], high[proper])), (n, n)).tocsr().tocoo()
    return Laplacian.of(above.row, above.col, above.data, n)


LAPLACIANS: dict[str, Callable[[Mesh], Laplacian]] = {
    "cotangent": cotangent_laplacian,
    "intrinsic Delaunay": intrinsic_delaunay_laplacian,
}
