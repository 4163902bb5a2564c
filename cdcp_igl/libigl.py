"""The only file that knows libigl's signatures.

Every function here expects what `DiskMesh` guarantees: C-ordered float64
coordinates, int64 faces, all indices in range. libigl 2.6 crashes the process on
some inputs that break this.
"""

from __future__ import annotations

import igl
import igl.predicates
import numpy as np
from scipy.sparse import csc_matrix

from .arrays import Bools, Floats, Ints

# For more faces `squared_edge_lengths` starts threads, which takes longer than to do without.
SERIAL = 999


def adjacency_matrix(F: Ints) -> csc_matrix:
    """(n, n) matrix of int64 with 1 for each edge, symmetric."""
    return igl.adjacency_matrix(F)


def arap(V: Floats, F: Ints, start: Floats, rounds: int) -> Floats:
    """(n, 2) map as rigid as possible from another (n, 2); its first vertex stays."""
    first, data = np.zeros(1, np.int32), igl.ARAPData()
    data.max_iter = rounds
    igl.arap_precomputation(V, F, 2, first, data)
    return igl.arap_solve(start[first], data, start)


def angles(V: Floats, F: Ints) -> Floats:
    """(m, 3) unsigned corner angles in radians, column k at corner k.

    Not a number at the ends of edges without length.
    """
    return igl.internal_angles(V, F)


def double_areas(V: Floats, F: Ints) -> Floats:
    """(m,) twice the areas of triangles; signed if V has two columns."""
    return igl.doublearea(V, F)


def fans(corners: Ints, ends: Ints) -> Ints:
    """(m, 3) triangles around the first corner of each polygon.

    Polygon p has the corners from ``ends[p]`` to ``ends[p + 1]``, at least three.
    """
    return igl.polygons_to_triangles(corners, ends)[0]


def grid_faces(columns: int, rows: int) -> Ints:
    """(m, 3) counterclockwise triangles of a grid of vertices, rows one after the other.

    The first row is the lowest, and the diagonals fall from left to right.
    """
    return igl.triangulated_grid(columns, rows)[1]


def harmonic(V: Floats, F: Ints, S: Ints, c: Floats) -> Floats:
    """(n, 2) cotangent-harmonic extension of the values c (k, 2) at the vertices S."""
    return igl.harmonic(V, F, S, c, 1)


def is_counterclockwise(triangles: Floats) -> Bools:
    """(k,) exact orientation of (k, 3, 2) plane triangles (Shewchuk's predicate)."""
    # In the plane at height 1; `orient2d` takes one triangle at a time.
    return is_seen_from_outside(np.insert(triangles, 2, 1, axis=2))


def is_seen_from_outside(triangles: Floats) -> Bools:
    """(k,) exact orientation of (k, 3, 3) triangles in space, seen from across the origin."""
    i, j, k = np.ascontiguousarray(triangles.transpose(1, 0, 2))
    return igl.predicates.orient3d(i, j, k, np.zeros(i.shape)) > 0


def lscm(V: Floats, F: Ints, S: Ints, c: Floats) -> Floats:
    """(n, 2) least squares conformal map with the vertices S pinned at c (k, 2)."""
    return igl.lscm(V, F, S, c)[0]


def path(edges: Ints) -> Ints:
    """(k,) vertices of one closed loop of directed edges (k, 2), in their direction."""
    vertices, _, column = igl.edges_to_path(edges)
    return vertices[:-1] if column[0] == 0 else vertices[:0:-1]


def slim(V: Floats, F: Ints, start: Floats, rounds: int) -> Floats:
    """(n, 2) map with less symmetric Dirichlet energy than one (n, 2) without flipped faces."""
    given = (np.asfortranarray(x) for x in (V, F.astype(np.int32), start))
    nothing = np.zeros(0, np.int32), np.zeros((0, 2), order="F")
    energy = igl.MappingEnergyType.SYMMETRIC_DIRICHLET
    data = igl.slim_precompute(*given, energy, *nothing, soft_p=0.0)
    return np.ascontiguousarray(igl.slim_solve(data, rounds)[:, :2])


def squared_edge_lengths(V: Floats, F: Ints) -> Floats:
    """(m, 3) squared lengths of the edges opposite each corner."""
    squared = np.empty(F.shape, order="F")  # columns are what is computed with
    for start in range(0, len(F), SERIAL):
        part = slice(start, start + SERIAL)
        squared[part] = igl.squared_edge_lengths(V, F[part])
    return squared


class Tree:
    """A tree of boxes around faces in space; faces may be flat, and lie in one plane."""

    def __init__(self, V: Floats, F: Ints) -> None:
        self._given, self._boxes = (V, F), igl.AABB()
        self._boxes.init(V, F)

    def nearest(self, points: Floats) -> Ints:
        """(k,) the nearest face of each point (k, 3)."""
        _, face, _ = self._boxes.squared_distance(*self._given, points)
        return face.astype(np.int64)


def upsample(V: Floats, F: Ints) -> tuple[Floats, Ints]:
    """Split each face into four at the middles of its edges."""
    V, F = igl.upsample(V, F)
    return V, F.astype(np.int64)


def vector_area_matrix(F: Ints) -> csc_matrix:
    """(2n, 2n) symmetric A such that [u; v]^T A [u; v] is the signed area of the map (u, v)."""
    return igl.vector_area_matrix(F)


def vertex_normals(V: Floats, F: Ints) -> Floats:
    """(n, 3) unit normals, faces weighted by area; not a number at vertices without area."""
    weighting = igl.PerVertexNormalsWeightingType.PER_VERTEX_NORMALS_WEIGHTING_TYPE_AREA
    return igl.per_vertex_normals(V, F, weighting)
