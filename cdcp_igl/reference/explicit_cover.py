"""CDCP by the system of the doubly covered surface, eq. (17), solved as it stands."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..algorithm import Steps, algorithm_1
from ..arrays import Complex, Floats
from ..errors import MapError
from ..rescue.repair import repaired
from ..solve.factored import FactoredSurface
from ..steps.circle import Rejected
from ..steps.trace import face_dipole
from ..surface.mesh import DiskMesh
from .certified import certified_disk_map
from .dirichlet import Dirichlet
from .doubled import doubled_laplacian

__all__ = ["double_cover", "double_cover_trace"]


def double_cover(V: ArrayLike, F: ArrayLike) -> Floats:
    """Map a triangulated disk as `cdcp` does, with the trace of eq. (17) instead of (18).

    By Theorem 1 the result is the same; it takes a system of nearly twice the size.

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
        _, f, _ = algorithm_1(surface, Steps(trace=double_cover_trace))
    except Rejected as error:
        raise MapError(f"The trace of the double cover gives no map: {error}") from error
    f, _ = repaired(surface.mesh, f)
    return certified_disk_map(surface.mesh, f)


def double_cover_trace(surface: FactoredSurface, face: int) -> Complex:
    """Boundary values of the harmonic map of the doubly covered surface, eq. (17).

    Parameters
    ----------
    surface : FactoredSurface
    face : int
        Central face, which carries the dipole on one of the two sheets.

    Returns
    -------
    (nB,) complex128
        In the order of ``mesh.loop``, 0 at the first; half of `trace.boundary_trace`.

    Examples
    --------
    Theorem 1: half of the solution of the pinned system of eq. (18).

    >>> import cdcp_igl
    >>> from cdcp_igl.steps.trace import boundary_trace
    >>> from cdcp_igl.solve.factored import FactoredSurface
    >>> from cdcp_igl.surface.mesh import DiskMesh
    >>> from cdcp_igl.reference import double_cover_trace
    >>> V, F, _ = cdcp_igl.datasets.paraboloid(8)
    >>> surface = FactoredSurface.of(DiskMesh(V, F))
    >>> explicit, reduced = double_cover_trace(surface, 0), boundary_trace(surface, 0)
    >>> bool(abs(2 * explicit - reduced).max() < 1e-12)
    True
    """
    mesh, L = surface.mesh, surface.laplacian.matrix()
    r = np.concatenate([face_dipole(mesh, face), np.zeros(len(mesh.interior))])
    pin = mesh.loop[:1]
    return Dirichlet(doubled_laplacian(mesh, L), pin).solve(np.zeros(1), r)[mesh.loop]
