"""The Dirichlet problem of a Laplacian, and the harmonic map by arc length."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_matrix

from .. import libigl
from ..arrays import Complex, Floats, Ints, as_complex, coordinates
from ..io.given import takes_meshes
from ..solve.solvers import factorize
from ..starts.boundary import arc_length_map
from ..surface.mesh import DiskMesh
from .certified import certified_disk_map


class Dirichlet:
    """Given the values on distinct vertices S (k,), k at least 1, solve L u = r at the others.

    L (n, n) is symmetric and positive semidefinite, and its rows sum to zero. A boundary vertex
    outside S keeps its row of L, which is the natural boundary condition.
    """

    def __init__(self, L: csr_matrix, S: Ints) -> None:
        free = np.ones(L.shape[0], dtype=bool)
        free[S] = False
        self._L, self._S, self._free = L, S, np.flatnonzero(free)
        if len(self._free):
            self._factor = factorize(L[self._free][:, self._free])

    def solve(self, c: Complex | Floats, r: Complex | Floats | float = 0) -> Complex:
        """(n,) the solution with values c (k,), in the order of S; r (n,) is not read on S."""
        u = np.zeros(self._L.shape[0], dtype=complex)
        u[self._S] = c
        if len(self._free):
            u[self._free] = self._factor.solve((r - self._L @ u)[self._free])
        return u


@takes_meshes
def harmonic(V: ArrayLike, F: ArrayLike) -> Floats:
    """Map a triangulated disk harmonically onto the unit disk, the boundary by arc length.

    Onto the disk, but not conformal: nothing makes the boundary fit the angles.

    Parameters
    ----------
    V : (n, 3) or (n, 2) array_like of real numbers
        Vertex positions, in any unit.
    F : (m, 3) array_like of integers
        Corners of the faces, counterclockwise seen from outside.

    Returns
    -------
    (n, 2) float64
        Rows as in V, faces counterclockwise, the boundary vertex of smallest index at
        (1, 0).

    Raises
    ------
    MeshError
        If the input is not a triangulated disk.
    SolverError
        If a Laplacian cannot be factored.
    MapError
        If the map is not a bijection onto the disk; its ``result`` is a `ReferenceMap`.

    References
    ----------
    M. Eck, T. DeRose, T. Duchamp, H. Hoppe, M. Lounsbery, W. Stuetzle. Multiresolution
    analysis of arbitrary meshes. SIGGRAPH 1995.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.paraboloid(8)
    >>> cdcp_igl.reference.harmonic(V, F).shape
    (217, 2)
    """
    mesh = DiskMesh(V, F)
    f_B = coordinates(arc_length_map(mesh))
    uv = libigl.harmonic(mesh.scaled, mesh.F, mesh.loop, f_B)
    return certified_disk_map(mesh, as_complex(uv))
