"""Laplacians of intrinsic Delaunay triangulations; some faces may stay as they are."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix

from .. import libigl
from ..arrays import Bools, Floats, Ints
from ..surface.mesh import DiskMesh
from .laplacian import Laplacian

# The least weight of an edge, for cotangents that are negative: that of an edge opposite two
# angles of 89.4 degrees. With less, kept faces come nearer to collapse than doubles can hold.
LEAST_WEIGHT = 0.01
# Of such an angle, in radians, the lengths of the sides know nothing: its square is below their
# last digit. Edges would be flipped to and fro for ever.
THINNEST = 5e-8


def constrained_delaunay_laplacian(mesh: DiskMesh, kept: Bools) -> Laplacian:
    """Compute a Laplacian with positive weights on a triangulation that has given faces.

    Edges between the other faces are flipped until they are intrinsically Delaunay. With
    positive weights and a convex boundary, harmonic maps turn over no face of the triangulation
    that the weights are of (Tutte; Floater), so no face that was kept. Where cotangents of kept
    faces are negative, the weights are small positive numbers instead, which is not
    conformal.

    Parameters
    ----------
    mesh : DiskMesh
    kept : (m,) bool
        Faces that stay, besides those that are too thin.

    Returns
    -------
    Laplacian
        All its weights are positive.

    References
    ----------
    W. T. Tutte. How to draw a graph. Proc. London Math. Soc. 13, 1963.

    M. S. Floater. One-to-one piecewise linear mappings over triangulations. Math. Comp.
    72(242), 2003.
    """
    kept = kept | _too_thin(mesh)
    weights = _half_cotangents(mesh, np.flatnonzero(kept))
    others = mesh.F[~kept]
    if len(others):
        weights = weights + _delaunay_weights(mesh.V, others)
    edges = weights.tocsr()
    edges.sort_indices()
    edges = edges.tocoo()
    positive = np.maximum(edges.data, LEAST_WEIGHT)
    return Laplacian.of(edges.row, edges.col, positive, len(mesh.V))


def _too_thin(mesh: DiskMesh) -> Bools:
    """(m,) faces that are too thin for their edges to be flipped by their lengths."""
    return np.asarray(mesh.angles.min(axis=1) < THINNEST)


def _half_cotangents(mesh: DiskMesh, faces: Ints) -> csr_matrix:
    """(n, n) what faces give to the weights of their edges, above the diagonal."""
    F = mesh.F[faces]
    rows, columns = F[:, [1, 2, 0]].ravel(), F[:, [2, 0, 1]].ravel()
    entries = mesh.cotangents[faces].ravel() / 2
    return _above(rows, columns, entries, len(mesh.V))


def _delaunay_weights(V: Floats, F: Ints) -> csr_matrix:
    """(n, n) weights of the intrinsic Delaunay triangulation of some faces."""
    vertices, corners = np.unique(F, return_inverse=True)
    L = libigl.intrinsic_delaunay_cotangent_matrix(V[vertices], corners.reshape(-1, 3)).tocoo()
    above = L.row < L.col
    return _above(vertices[L.row[above]], vertices[L.col[above]], L.data[above], len(V))


def _above(rows: Ints, columns: Ints, entries: Floats, n: int) -> csr_matrix:
    low, high = np.minimum(rows, columns), np.maximum(rows, columns)
    return coo_matrix((entries, (low, high)), (n, n)).tocsr()
