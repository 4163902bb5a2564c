"""Triangles on the surface: areas, cotangents, angles; in the plane: signed areas, gradients."""

from __future__ import annotations

import numpy as np

from .. import libigl
from ..arrays import Complex, Floats, Ints, as_complex

EPS = np.finfo(float).eps / 2
# Shewchuk's bound: beyond it, the rounded determinant of an orientation has the sign of the
# exact one.
ORIENTATION_BOUND = (3 + 16 * EPS) * EPS

# A face is degenerate when area / longest edge^2 is below this: a relative measure, so
# that metres and microns are judged alike. The worst faces of real scans are near 1e-5;
# cotangents above 1e10 would leave the other faces at a vertex too few digits.
DEGENERATE = 1e-10

# A face whose sides are so near to one line, by the sine of their angle, is turned over by rounding
# when its map is moved. No angle of a face of a surface is as small.
FLAT = 1e-12

BLOCK = 1 << 14  # faces


def blocks(m: int) -> list[slice]:
    """Split m faces, or vertices, into blocks whose arrays stay in the cache."""
    return [slice(start, start + BLOCK) for start in range(0, m, BLOCK)]


def face_areas(V: Floats, F: Ints) -> Floats:
    """(m,) areas of triangles in space."""
    return libigl.double_areas(V, F) / 2


def vertex_areas(V: Floats, F: Ints) -> Floats:
    """(n,) a third of the sum of the areas of the faces at each vertex."""
    areas = np.zeros(len(V))
    for part in blocks(len(F)):
        third = face_areas(V, F[part]) / 3
        for corners in F[part].T:
            np.add.at(areas, corners, third)
    return areas


def corner_cotangents(V: Floats, F: Ints) -> Floats:
    """(m, 3) cotangents of triangles in space, column k at corner k; not finite without area.

    From squared lengths and the area: cot = (l_i^2 + l_j^2 - l_k^2) / (4 area). Of lengths
    alone, as by Heron, flat triangles would lose half of their digits.
    """
    cotangents = np.empty((3, len(F)))  # by corner, like half-edges
    with np.errstate(divide="ignore", invalid="ignore"):
        for part in blocks(len(F)):
            squared = libigl.squared_edge_lengths(V, F[part]).T
            out = cotangents[:, part]
            np.subtract(squared[0] + squared[1] + squared[2], 2 * squared, out=out)
            out /= 2 * libigl.double_areas(V, F[part])
    return cotangents.T


def corner_angles(cotangents: Floats) -> Floats:
    """(m, 3) angles in radians of corners with these cotangents."""
    angles = np.empty_like(cotangents)
    with np.errstate(divide="ignore"):  # the arctangent of infinity is a right angle
        for part in blocks(len(angles)):
            # In half the time of arctan2.
            out = np.arctan(1 / cotangents[part], out=angles[part])
            out += np.pi * (out < 0)
    return angles


def degenerate_faces(cotangents: Floats) -> Ints:
    """Faces without area, by the square of their longest edge."""
    # The cotangents at the ends of an edge add up to its squared length by twice the area.
    i, j, k = cotangents.T
    with np.errstate(invalid="ignore"):  # of faces without any area
        longest_squared = np.maximum(np.maximum(i + j, j + k), k + i)
    return np.flatnonzero(~(longest_squared < 1 / (2 * DEGENERATE)))


def oriented_areas(z: Complex, F: Ints) -> tuple[Floats, Floats]:
    """(m,) twice the signed areas of plane triangles, and (m,) bounds of their rounding errors."""
    i, j, k = z.take(F.T)
    return spanned_areas(i - k, j - k)


def flipped_faces(f: Complex, F: Ints) -> tuple[Ints, int]:
    """Faces that are not positively oriented, exactly, and how many were in doubt."""
    others = _not_above(f, F, 1)
    if len(others) == 0:
        return others, 0
    area, error = oriented_areas(f, F[others])
    in_doubt = abs(area) <= error
    corners = f[F[others[in_doubt]]]
    flipped = np.ones(len(others), dtype=bool)
    flipped[in_doubt] = ~libigl.is_counterclockwise(np.stack([corners.real, corners.imag], axis=-1))
    return others[flipped], int(np.count_nonzero(in_doubt))


def flipped_or_flat(f: Complex, F: Ints) -> Ints:
    """Faces that are flipped, or that rounding flips if the map (n,) is moved."""
    return _not_above(f, F, FLAT / ORIENTATION_BOUND)


def _not_above(f: Complex, F: Ints, times: float) -> Ints:
    """Faces with an area of no more than so many times the bound of its rounding error."""
    above = np.empty(len(F), dtype=bool)
    for part in blocks(len(F)):
        area, error = oriented_areas(f, F[part])
        error *= times
        np.greater(area, error, out=above[part])
    return np.flatnonzero(~above)


def orientations(i: Complex, j: Complex, k: Complex) -> Ints:
    """(m,) 1 for counterclockwise plane triangles, -1 for clockwise ones, 0 on a line; exactly."""
    u, v = i - k, j - k
    area, error = spanned_areas(u, v)
    sign = np.sign(area).astype(np.int64)
    in_doubt = np.flatnonzero((abs(area) <= error) & (u != 0) & (v != 0) & (u != v))
    corners = np.stack([i[in_doubt], j[in_doubt], k[in_doubt]], axis=1)
    both = np.stack([corners.real, corners.imag], axis=-1)
    up, down = libigl.is_counterclockwise(both), libigl.is_counterclockwise(both[:, ::-1])
    sign[in_doubt] = up.astype(np.int64) - down
    return sign


def lost_in_single_precision(uv: Floats, F: Ints) -> Ints:
    """Faces whose corners (n, 2), as float32, have no area, or are turned over.

    Renderers, and files of type glb and ply, have single precision.
    """
    area, _ = oriented_areas(as_complex(uv), F)
    upwards = np.where((area < 0)[:, None], F[:, ::-1], F)
    return flipped_faces(as_complex(uv.astype(np.float32)), upwards)[0]


def spanned_areas(u: Complex, v: Complex) -> tuple[Floats, Floats]:
    """Twice the signed areas of plane triangles with edges u and v; their bounds likewise."""
    left, right = u.real * v.imag, u.imag * v.real
    return left - right, ORIENTATION_BOUND * (abs(left) + abs(right))


def opposite_edges(corners: Complex) -> Complex:
    """(m, 3) edges of plane triangles with these corners (m, 3), each opposite its corner."""
    return corners[:, [2, 0, 1]] - corners[:, [1, 2, 0]]


def twice_areas(edges: Complex) -> Floats:
    """(m,) twice the signed areas of plane triangles with these edges (m, 3), in their order."""
    return (edges[:, 0].conj() * edges[:, 1]).imag


def hat_gradients(opposite: Complex, twice_area: Floats) -> Complex:
    """(m, 3) gradients of the hat functions of the corners, of triangles with these edges."""
    # They grow at right angles to the opposite edge.
    return 1j * opposite / twice_area[:, None]


def extents(corners: Complex) -> tuple[Floats, Floats]:
    """(k,) longest edges of faces with these corners (3, k), and their largest distances from 0."""
    size = abs(corners - corners[[2, 0, 1]]).max(axis=0)
    return size, abs(corners).max(axis=0)
