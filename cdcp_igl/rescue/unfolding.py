"""Unfolding: a harmonic map that turns over none of the faces of the mesh."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from ..arrays import Bools
from ..certificate import flipped_faces
from ..solve.delaunay import constrained_delaunay_laplacian
from ..solve.factored import FactoredSurface
from ..steps.extension import harmonic_extension, settled_extension
from ..surface.mesh import DiskMesh
from .boundary import CircleMap
from .collapsed_faces import hold_open
from .harmonic_map import HarmonicMap

__all__ = ["keep_faces"]

# Most meshes need two or three. What is flipped after these, rounding has flipped.
ROUNDS = 6


def keep_faces(mesh: DiskMesh, harmonic: HarmonicMap, *, straightened: bool) -> HarmonicMap:
    """Extend the boundary of a map again, such that no face of the mesh is turned over.

    The harmonic map of the intrinsic Delaunay triangulation turns over none of its triangles,
    but may turn over faces of the mesh whose edges it has flipped. So the faces that come out
    turned over are kept, with those around them, and the edges are flipped again without
    them. Kept faces stay positively oriented, up to rounding; so each round needs new ones to
    go on, and at worst all are kept in the end. Where nothing is kept, the map remains
    harmonic with respect to the intrinsic Delaunay triangulation.

    Parameters
    ----------
    mesh : DiskMesh
    harmonic : HarmonicMap
        With flipped faces.
    straightened : bool
        Whether the common shear is taken out once more.

    Returns
    -------
    HarmonicMap
        Rounding may have flipped some faces.
    """
    first = harmonic.boundary
    kept = np.zeros(len(mesh.F), dtype=bool)
    for _ in range(ROUNDS):
        f, _ = hold_open(mesh, harmonic.placed(harmonic.f, 0j))
        flipped, _ = flipped_faces(f, mesh.F)
        if kept[flipped].all():
            break
        corners = np.zeros(len(mesh.V), dtype=bool)
        corners[mesh.F[flipped]] = True
        kept |= corners[mesh.F].any(axis=1)
        boundary = _extended(mesh, first, kept)
        harmonic = HarmonicMap.of(mesh, boundary, harmonic.center, straightened=straightened)
    return harmonic


def _extended(mesh: DiskMesh, boundary: CircleMap, kept: Bools) -> CircleMap:
    L = constrained_delaunay_laplacian(mesh, kept)
    surface = FactoredSurface(mesh, L)
    method = replace(boundary.method, laplacian="constrained Delaunay")
    return replace(
        boundary,
        extend=partial(harmonic_extension, surface),
        settle=partial(settled_extension, surface),
        method=method,
    )
