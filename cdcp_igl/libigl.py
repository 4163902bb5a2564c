"""The only file that knows libigl's signatures.

Every function here expects what `DiskMesh` guarantees: C-ordered float64
coordinates, int64 faces, all indices in range. libigl 2.6 crashes the process on
some inputs that break this.
"""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path

import igl
import igl.predicates
import numpy as np
from scipy.sparse import csc_matrix

from .arrays import Bools, Floats, Ints

__all__ = [
    "VERSION",
    "half_cotangents",
    "internal_angles",
    "intrinsic_delaunay_cotangent_matrix",
    "is_counterclockwise",
    "read_stl",
]

VERSION = version("libigl")


def half_cotangents(V: Floats, F: Ints) -> Floats:
    """(m, 3) half cotangents; column k belongs to the angle at corner k."""
    return np.asarray(igl.cotmatrix_entries(V, F))


def internal_angles(V: Floats, F: Ints) -> Floats:
    """(m, 3) angles in radians, unsigned; column k belongs to corner k."""
    return np.asarray(igl.internal_angles(V, F))


def intrinsic_delaunay_cotangent_matrix(V: Floats, F: Ints) -> csc_matrix:
    """(n, n) cotangent matrix of the intrinsic Delaunay triangulation, negative semidefinite."""
    return igl.intrinsic_delaunay_cotmatrix(V, F)[0]


def is_counterclockwise(triangles: Floats) -> Bools:
    """(k,) exact orientation of (k, 3, 2) plane triangles (Shewchuk's predicate)."""
    positive = igl.predicates.Orientation.POSITIVE
    return np.array([igl.predicates.orient2d(*t) == positive for t in triangles], dtype=bool)


def read_stl(path: Path) -> tuple[Floats, Ints]:
    """(3m, 3) vertices and (m, 3) faces of an stl file; RuntimeError if it is damaged."""
    return igl.read_triangle_mesh(str(path))
