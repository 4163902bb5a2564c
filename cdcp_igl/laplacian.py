"""The cotangent Laplacian, eq. (8)."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix

from . import libigl
from .areas import corner_products
from .arrays import Floats, blocks
from .mesh import DiskMesh

__all__ = ["cotangent_laplacian", "intrinsic_delaunay_laplacian"]


def cotangent_laplacian(mesh: DiskMesh) -> csr_matrix:
    """Assemble the positive semidefinite cotangent Laplacian, eq. (8).

    L_ij = -(cot a_ij + cot b_ij) / 2 on edges, rows sum to zero; the negative of
    ``igl.cotmatrix(V, F)``, assembled in a tenth of its time.

    Parameters
    ----------
    mesh : DiskMesh

    Returns
    -------
    (n, n) csr_matrix of float64
        Symmetric to the last bit.
    """
    n = len(mesh.V)
    # Column k holds the cotangent of corner k, which belongs to the opposite edge. Every edge
    # is a half-edge of two faces, one for each direction; those outside the boundary weigh 0.
    # So the halves of the matrix have the same pattern, with entries for cotangents that
    # cancel, too: orders that reduce fill, and analyses, hold wherever the vertices are.
    start = mesh.F[:, [1, 2, 0]].ravel()
    end = mesh.F[:, [2, 0, 1]].ravel()
    weights = _half_cotangents(mesh).ravel()
    diagonal = np.bincount(start, weights, n) + np.bincount(end, weights, n)
    vertices = np.arange(n)
    rows = np.concatenate([start, np.roll(mesh.loop, -1), vertices])
    columns = np.concatenate([end, mesh.loop, vertices])
    halves = np.concatenate([-weights, np.zeros(len(mesh.loop)), diagonal / 2])
    L = csr_matrix((halves, (rows, columns)), (n, n))
    L.data += L.T.tocsr().data
    return L


def _half_cotangents(mesh: DiskMesh) -> Floats:
    """(m, 3) half the cotangent at each corner."""
    halves = np.empty(mesh.F.shape)
    for part in blocks(len(halves)):
        products, twice_area = corner_products(mesh.V, mesh.F[part])
        np.divide(products, 2 * twice_area[:, None], out=halves[part])
    return halves


def intrinsic_delaunay_laplacian(mesh: DiskMesh) -> csr_matrix:
    """Assemble the cotangent Laplacian of the intrinsic Delaunay triangulation.

    The same surface, vertices and boundary with edges flipped until no interior edge has
    a negative weight. For traces on meshes with slivers.

    Parameters
    ----------
    mesh : DiskMesh

    Returns
    -------
    (n, n) csr_matrix of float64
        Symmetric, positive semidefinite, not positive off the diagonal.

    References
    ----------
    M. Fisher, B. Springborn, A. Bobenko, P. Schröder. An algorithm for the construction
    of intrinsic Delaunay triangulations with applications to digital geometry
    processing. SIGGRAPH Courses, 2006.
    """
    return -libigl.intrinsic_delaunay_cotangent_matrix(mesh.V, mesh.F).tocsr()
