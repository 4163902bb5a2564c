"""The doubly covered surface, and CDCP by its system, eq. (17), solved as it stands.

The surface and its mirror image, glued along the boundary, are a closed surface of genus 0 with
2 nI + nB vertices: first those of the surface, then the mirror images of the interior vertices in
the order of ``mesh.interior``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import coo_matrix, csr_matrix

from ..algorithm import Steps, algorithm_1
from ..arrays import Complex, Floats, Ints
from ..descent.repair import repaired
from ..docstrings import like
from ..errors import MapError
from ..io.given import takes_meshes
from ..solve.factored import FactoredSurface
from ..steps.circle import Rejected
from ..steps.trace import face_dipole
from ..surface.mesh import DiskMesh, Mesh
from .certified import certified_disk_map
from .dirichlet import Dirichlet, harmonic


@takes_meshes
@like(harmonic)
def double_cover(V: ArrayLike, F: ArrayLike) -> Floats:
    """Map a triangulated disk as `cdcp` does, with the trace of eq. (17) instead of (18).

    By Theorem 1 the result is the same; it takes a system of nearly twice the size.

    References
    ----------
    M.-H. Yueh et al. A constructive algorithm for disk conformal parameterizations.

    Examples
    --------
    >>> import cdcp_igl
    >>> from cdcp_igl.reference import double_cover
    >>> V, F, _ = cdcp_igl.datasets.paraboloid(16)
    >>> bool(abs(double_cover(V, F) - cdcp_igl.cdcp(V, F)).max() < 1e-3)
    True
    """
    surface = FactoredSurface.of(DiskMesh(V, F))
    try:
        f = algorithm_1(surface, Steps(trace=double_cover_trace))
    except Rejected as error:
        raise MapError(f"The trace of the double cover gives no map: {error}") from error
    f, _ = repaired(surface.mesh, f)
    return certified_disk_map(surface.mesh, f)


def double_cover_trace(surface: FactoredSurface, face: int) -> Complex:
    """Boundary values of the harmonic map of the doubly covered surface, eq. (17).

    They are (nB,), in the order of ``mesh.loop``, 0 at the first. The dipole is on one of the two
    sheets, and by Theorem 1 they are half of `trace.boundary_trace`, eq. (18).
    """
    mesh, L = surface.mesh, surface.laplacian.matrix()
    r = np.concatenate([face_dipole(mesh, face), np.zeros(len(mesh.interior))])
    pin = mesh.loop[:1]
    return Dirichlet(doubled_laplacian(mesh, L), pin).solve(np.zeros(1), r)[mesh.loop]


def doubled_faces(mesh: Mesh) -> Ints:
    """(2m, 3) the faces, then their mirror images with the corners in reverse order."""
    return np.vstack([mesh.F, _mirror_images(mesh)[mesh.F[:, ::-1]]])


def doubled_laplacian(mesh: Mesh, L: csr_matrix) -> csr_matrix:
    """Assemble the Laplacian of the doubly covered surface from that of the surface.

    Both sheets have the same edge lengths, hence the same weights; they add up on the
    boundary.
    """
    sheet, image = L.tocoo(), _mirror_images(mesh)
    rows = np.concatenate([sheet.row, image[sheet.row]])
    columns = np.concatenate([sheet.col, image[sheet.col]])
    size = len(mesh.scaled) + len(mesh.interior)
    return coo_matrix((np.tile(sheet.data, 2), (rows, columns)), (size, size)).tocsr()


def _mirror_images(mesh: Mesh) -> Ints:
    """(n,) the mirror image of each vertex; a boundary vertex is its own."""
    image = np.arange(len(mesh.scaled))
    image[mesh.interior] = len(mesh.scaled) + np.arange(len(mesh.interior))
    return image
