"""Harmonic map with the boundary on the circle by arc length, by libigl."""

from __future__ import annotations

from numpy.typing import ArrayLike

from .. import libigl
from ..arrays import Floats, as_complex, coordinates
from ..io.given import takes_meshes
from ..rescue.boundary import arc_length_map
from ..surface.mesh import DiskMesh
from .certified import certified_disk_map


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
    >>> import numpy as np
    >>> import cdcp_igl
    >>> from cdcp_igl.reference import harmonic
    >>> V, F, _ = cdcp_igl.datasets.paraboloid(8)
    >>> uv = harmonic(V, F)
    >>> np.hypot(*uv.T).max().round(12)
    np.float64(1.0)
    """
    mesh = DiskMesh(V, F)
    f_B = coordinates(arc_length_map(mesh))
    uv = libigl.harmonic(mesh.V, mesh.F, mesh.loop, f_B)
    return certified_disk_map(mesh, as_complex(uv))
