"""Least squares conformal map, by libigl."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .. import libigl
from ..arrays import Floats, Ints, as_complex
from ..surface.mesh import DiskMesh
from .certified import checked_free_map

__all__ = ["lscm"]


def lscm(V: ArrayLike, F: ArrayLike) -> Floats:
    """Map a triangulated disk to the plane, conformally in the least squares sense.

    Conformal, but onto no disk: the boundary is free but for two pins. The map may overlap
    itself and flip faces. To be compared on angles only.

    Parameters
    ----------
    V : (n, 3) or (n, 2) array_like of real numbers
        Vertex positions, in any unit.
    F : (m, 3) array_like of integers
        Corners of the faces, counterclockwise seen from outside.

    Returns
    -------
    (n, 2) float64
        Rows as in V, faces counterclockwise but for flips, the pins at (0, 0) and (1, 0).

    Raises
    ------
    MeshError
        If the input is not a triangulated disk.
    MapError
        If the map is not finite or has collapsed; its ``result`` is a `ReferenceMap`.

    References
    ----------
    B. Lévy, S. Petitjean, N. Ray, J. Maillot. Least squares conformal maps for automatic
    texture atlas generation. ACM Trans. Graph. 21(3), 2002.

    Examples
    --------
    A plane mesh keeps its angles:

    >>> import cdcp_igl
    >>> from cdcp_igl.reference import lscm
    >>> V, F, _ = cdcp_igl.datasets.square(4)
    >>> bool(cdcp_igl.angle_distortion(V, F, lscm(V, F)).max() < 1e-4)
    True
    """
    mesh = DiskMesh(V, F)
    uv = libigl.lscm(mesh.V, mesh.F, _two_far_vertices(mesh), np.eye(2)[::-1] * [1, 0])
    return checked_free_map(mesh, as_complex(uv))


def _two_far_vertices(mesh: DiskMesh) -> Ints:
    """Of the boundary: the farthest from its first vertex, and the farthest from that."""

    def farthest(vertex: int) -> int:
        return mesh.loop[np.linalg.norm(mesh.V[mesh.loop] - mesh.V[vertex], axis=1).argmax()]

    first = farthest(mesh.loop[0])
    return np.array([first, farthest(first)])
