"""The doubly covered surface: the surface and its mirror image, glued along the boundary.

A closed surface of genus 0 with N2 = 2 nI + nB vertices: first those of the surface,
then the mirror images of the interior vertices in the order of ``mesh.interior``.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix

from ..arrays import Ints
from ..surface.mesh import DiskMesh

__all__ = ["doubled_faces", "doubled_laplacian", "mirror_images"]


def mirror_images(mesh: DiskMesh) -> Ints:
    """(n,) the mirror image of each vertex; a boundary vertex is its own."""
    image = np.arange(len(mesh.V))
    image[mesh.interior] = len(mesh.V) + np.arange(len(mesh.interior))
    return image


def doubled_faces(mesh: DiskMesh) -> Ints:
    """(2m, 3) the faces, then their mirror images with the corners in reverse order."""
    return np.vstack([mesh.F, mirror_images(mesh)[mesh.F[:, ::-1]]])


def doubled_laplacian(mesh: DiskMesh, L: csr_matrix) -> csr_matrix:
    """Assemble the Laplacian of the doubly covered surface, as in eq. (17).

    Both sheets have the same edge lengths, hence the same weights; they add up on the
    boundary.

    Parameters
    ----------
    mesh : DiskMesh
    L : (n, n) csr_matrix of float64
        Laplacian of the surface.

    Returns
    -------
    (N2, N2) csr_matrix of float64
    """
    sheet, image = L.tocoo(), mirror_images(mesh)
    rows = np.concatenate([sheet.row, image[sheet.row]])
    columns = np.concatenate([sheet.col, image[sheet.col]])
    size = len(mesh.V) + len(mesh.interior)
    return coo_matrix((np.tile(sheet.data, 2), (rows, columns)), (size, size)).tocsr()
