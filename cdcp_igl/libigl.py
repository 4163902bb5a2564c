"""The only file that knows libigl's signatures.

Every function here expects what `DiskMesh` guarantees: C-ordered float64
coordinates, int64 faces, all indices in range. libigl 2.6 crashes the process on
some inputs that break this.
"""

from __future__ import annotations

from importlib.metadata import version

import igl
import igl.predicates
import numpy as np
from scipy.sparse import csc_matrix

from .arrays import Bools, Floats, Ints

__all__ = [
    "VERSION",
    "adjacency_matrix",
    "harmonic",
    "intrinsic_delaunay_cotangent_matrix",
    "is_counterclockwise",
    "lscm",
    "vector_area_matrix",
]

VERSION = version("libigl")


def adjacency_matrix(F: Ints) -> csc_matrix:
    """(n, n) matrix of int64 with 1 for each edge, symmetric."""
    return igl.adjacency_matrix(F)


def harmonic(V: Floats, F: Ints, S: Ints, c: Floats) -> Floats:
    """(n, 2) cotangent-harmonic extension of the values c (k, 2) at the vertices S."""
    return igl.harmonic(V, F, S, c, 1)


def intrinsic_delaunay_cotangent_matrix(V: Floats, F: Ints) -> csc_matrix:
    """(n, n) cotangent matrix of the intrinsic Delaunay triangulation, negative semidefinite."""
    return igl.intrinsic_delaunay_cotmatrix(V, F)[0]


def is_counterclockwise(triangles: Floats) -> Bools:
    """(k,) exact orientation of (k, 3, 2) plane triangles (Shewchuk's predicate)."""
    positive = igl.predicates.Orientation.POSITIVE
    return np.array([igl.predicates.orient2d(*t) == positive for t in triangles], dtype=bool)


def lscm(V: Floats, F: Ints, S: Ints, c: Floats) -> Floats:
    """(n, 2) least squares conformal map with the vertices S pinned at c (k, 2)."""
    return igl.lscm(V, F, S, c)[0]


def vector_area_matrix(F: Ints) -> csc_matrix:
    """(2n, 2n) symmetric A such that [u; v]^T A [u; v] is the signed area of the map (u, v)."""
    return igl.vector_area_matrix(F)
