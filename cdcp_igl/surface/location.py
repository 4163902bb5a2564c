"""The face of the disk, the ring or the sphere in which a point lies, and where in it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Bools, Complex, Floats, Ints, as_complex
from .topology import Edges
from .triangles import EPS, oriented_areas, spanned_areas

Codes = NDArray[np.uint64]

BITS = 31  # of each coordinate in a Morton code: a cell of 1e-9
ONE_POINT = 1e-12  # size of a face by its distance
ON_CIRCLE = 1e-12  # points this far outside the circle have left it by rounding
RESOLUTION = 2.0**-52  # of coordinates in the disk
BLOCK = 1 << 17  # points that walk at a time: their arrays stay in the cache
AHEAD = 16  # of so many points that are close together, the first is located before the others


class FaceFinder:
    """Locates points in a certified map onto the disk.

    A walk: from a face nearby, across an edge that has the point on its other side, until
    there is none. The edge is drawn by lot where there are two, so that no walk goes in
    circles. A point counts as beyond an edge where the sign of the orientation is certain, so
    that each point on an edge or a vertex is in one of the faces there.

    Faces from row `shown` on fill holes, and no points are located in them but on the rim of the
    others. ValueError if the map z (n,) is no bijection onto the polygon inscribed in the unit
    circle: a face is flipped, or the faces cover more than the disk.

    O. Devillers, S. Pion, M. Teillaud. Walking in a triangulation. Int. J. Found. Comput.
    Sci. 13(2), 2002.
    """

    def __init__(self, F: Ints, edges: Edges, z: Complex, shown: int) -> None:
        area, error = oriented_areas(z, F)
        if (area < -error).any() or area.sum() > 2 * np.pi * (1 + ON_CIRCLE):
            raise ValueError("the map is no bijection onto the disk: points have no one place")
        self._angles, self._rim = _rim(F, edges, z)
        self._index(F, edges, z, shown)

    def _index(self, F: Ints, edges: Edges, images: Floats | Complex, shown: int) -> None:
        self._F, self._shown = F, shown
        self._corners: Any = images[F]  # real ones of the sphere
        self._across = _faces_across(F, edges)
        codes = _morton(self._key(self._corners.mean(axis=1)))
        self._start = np.argsort(codes, kind="stable")
        self._codes = codes[self._start]

    def _key(self, points: Complex) -> Complex:
        """(k,) points of the disk by which those that are near are found."""
        return points

    def _seen(self, corners: Complex, points: Complex) -> Complex:
        """(k, 3) corners of faces as seen from a point each: it is 0 in the plane."""
        return corners - points[:, None]

    def _outset(self, points: Complex) -> Ints:
        """(k,) faces from which the way to points leads through no smaller ones: outer ones."""
        return self._below(points) // 3

    def locate(self, points: Complex) -> tuple[Ints, Floats]:
        """Find the face (k,) of each point and its barycentric coordinates (k, 3) in it.

        The points are finite. Outside of the unit disk there is face -1, with NaN. Coordinates are
        not negative, and rows sum to 1; between a boundary edge and its arc they are those of the
        nearest point of the edge.
        """
        face = np.full(len(points), -1)
        barycentric = np.full((len(points), 3), np.nan)
        keys = self._key(points)
        inside = np.flatnonzero(abs(keys) <= 1 + ON_CIRCLE)
        codes = _morton(keys[inside])
        # In this order, neighbours in the plane are neighbours in memory.
        order = np.argsort(codes, kind="stable")
        inside, codes = inside[order], codes[order]
        lots = np.random.default_rng(0)
        for first in range(0, len(inside), BLOCK):
            rows = inside[first : first + BLOCK]
            nearest = np.searchsorted(self._codes, codes[first : first + BLOCK])
            start = self._start[np.minimum(nearest, len(self._start) - 1)]
            if len(inside) > len(self._start):  # neighbours are nearer than centres of long faces
                sent, _ = self._walk(points[rows[::AHEAD]], start[::AHEAD], lots)
                start = np.repeat(sent, AHEAD)[: len(rows)]
            face[rows], barycentric[rows] = self._walk(points[rows], start, lots)
        hidden = np.flatnonzero(face >= self._shown)
        face[hidden], barycentric[hidden] = self._on_rim(face[hidden], barycentric[hidden])
        return face, barycentric

    def _on_rim(self, hidden: Ints, barycentric: Floats) -> tuple[Ints, Floats]:
        """Take points of faces that fill a hole to one beside it, if they lie on its rim."""
        weights, F = np.where(barycentric > ON_CIRCLE, barycentric, 0), self._F
        face_at = np.full(self._F.max() + 1, -1)
        face_at[F[: self._shown]] = np.arange(self._shown)[:, None]
        at_vertex = (weights > 0).sum(axis=1) == 1
        beside = np.where(
            at_vertex,
            face_at[F[hidden, weights.argmax(axis=1)]],
            self._across[hidden, weights.argmin(axis=1)],
        )
        on_rim = (weights.min(axis=1) == 0) & (beside >= 0) & (beside < self._shown)
        same = F[beside][:, :, None] == F[hidden][:, None]
        weights = (same * weights[:, None]).sum(axis=2)
        weights /= np.where(on_rim, weights.sum(axis=1), np.nan)[:, None]
        return np.where(on_rim, beside, -1), weights

    def _walk(self, points: Complex, face: Ints, lots: np.random.Generator) -> tuple[Ints, Floats]:
        """Walk from the given faces to those of the points."""
        barycentric = np.empty((len(points), 3))
        on_way = np.arange(len(points))
        while len(on_way):
            seen = self._seen(self._corners[face[on_way]], points[on_way])
            areas, beyond = _orientations(seen)
            blocked = np.asarray(beyond.any(axis=1))
            # Faces so small and far away that they seem to be one point hold no other.
            there = np.flatnonzero(~blocked)
            there = there[areas[there].max(axis=1) < 4 * ONE_POINT]  # as all of these are
            reach = abs(seen[there] - np.roll(seen[there], 1, axis=1)).max(axis=1)
            strayed = there[reach < ONE_POINT * abs(seen[there]).max(axis=1)]
            blocked[strayed] = True
            arrived, ahead = np.flatnonzero(~blocked), np.flatnonzero(blocked)
            barycentric[on_way[arrived]] = _weights(seen[arrived], areas[arrived])

            edge = (beyond[ahead] * lots.random((len(ahead), 3))).argmax(axis=1)
            rows = on_way[ahead]
            following = self._across[face[rows], edge]
            again = np.searchsorted(ahead, strayed)
            following[again] = self._outset(points[rows[again]])
            out = np.flatnonzero(following < 0)
            nearest = _nearest_on_edge(seen[ahead[out]], edge[out])
            # Where the boundary is crowded, rounding turns its edges, and their lines cut through
            # the disk. Only the edge below the arc that the point is nearest to sends it out.
            below = self._below(self._key(points[rows[out]]))
            follows = below != 3 * face[rows[out]] + edge[out]
            follows &= nearest.max(axis=1) == 1  # not beside this edge
            following[out[follows]] = below[follows] // 3
            barycentric[rows[out]] = nearest
            on_way = rows[following >= 0]
            face[on_way] = following[following >= 0]
        return face, barycentric

    def _below(self, points: Complex) -> Ints:
        """(k,) the boundary edge in the direction of each point: 3 times its face, plus corner."""
        return self._rim[np.searchsorted(self._angles, np.angle(points), side="right") - 1]


class SphereFinder(FaceFinder):
    """Locates points (k, 3) of the sphere in a certified map P (n, 3) onto it.

    In the plane that touches the sphere at a point, the corners of a face lie around it if the
    spherical triangle contains it; its barycentric coordinates there are those of the place where
    the ray from 0 meets the straight triangle.
    """

    def __init__(self, F: Ints, edges: Edges, P: Floats) -> None:
        self._angles, self._rim = np.empty(0), np.empty(0, np.int64)
        self._index(F, edges, P, len(F))
        self._largest = int(np.linalg.norm(P[F] - P[np.roll(F, 1, axis=1)], axis=2).max(1).argmax())

    def _outset(self, points: Floats) -> Ints:  # type: ignore[override]
        return np.full(len(points), self._largest)

    def _key(self, points: Floats) -> Complex:  # type: ignore[override]
        # Lambert's azimuthal projection, of equal area.
        z = as_complex(points[:, :2])
        height = points[:, 2] / np.linalg.norm(points, axis=1)
        return z / np.maximum(abs(z), EPS) * np.sqrt(np.maximum(1 - height, 0) / 2)

    def _seen(self, corners: Floats, points: Floats) -> Complex:  # type: ignore[override]
        x, y, z = points.T
        side = np.copysign(1, z)
        a = -1 / (side + z)
        right = np.column_stack([1 + side * x**2 * a, side * x * y * a, -side * x])
        up = np.column_stack([x * y * a, side + y**2 * a, -y])
        seen = corners - points[:, None]
        return _dot(seen, right) + 1j * _dot(seen, up)


def _dot(vectors: Floats, other: Floats) -> Floats:
    """(k, 3) products of three vectors each with another one (k, 3)."""
    return np.einsum("kic,kc->ki", vectors, other)


def _faces_across(F: Ints, edges: Edges) -> Ints:
    """(m, 3) the face across the edge opposite corner k, or -1 at the boundary."""
    (one, other), m = edges.twins, len(F)
    across = np.full(3 * m, -1)
    across[one], across[other] = other % m, one % m
    # Half-edge k m + f leaves corner k of face f, so it lies opposite corner k - 1.
    return np.roll(across.reshape(3, m), -1, axis=0).T.copy()


def _rim(F: Ints, edges: Edges, z: Complex) -> tuple[Floats, Ints]:
    """Where on the circle each boundary edge begins, ascending, and 3 face + opposite corner."""
    corner, face = np.divmod(edges.border.astype(np.int64), len(F))
    angles = np.angle(z[F[face, corner]])
    order = np.argsort(angles)
    return angles[order], (3 * face + (corner - 1) % 3)[order]


def _orientations(seen: Complex) -> tuple[Floats, Bools]:
    """Twice the area of the origin with each edge; whether it is negative for certain.

    The origin at a corner makes two of them zero without rounding; the faces on both sides
    of an edge have exactly opposite values.
    """
    areas, beyond = np.empty(seen.shape), np.empty(seen.shape, dtype=bool)
    for k in range(3):
        areas[:, k], error = spanned_areas(seen[:, k - 2], seen[:, k - 1])
        beyond[:, k] = areas[:, k] < -error
    return areas, beyond


def _weights(seen: Complex, areas: Floats) -> Floats:
    """(k, 3) barycentric coordinates of the origin: those that rounding made negative are 0."""
    areas = np.maximum(areas, 0)
    weights = areas / areas.sum(axis=1, keepdims=True)
    # Along a needle the ratios of its areas say little: a projection on its longest edge does.
    left = (weights * seen).sum(axis=1)
    needles = np.flatnonzero(abs(left) > RESOLUTION)
    seen, left, rows = seen[needles], left[needles], np.arange(len(needles))
    apex = abs(np.roll(seen, -1, axis=1) - np.roll(seen, 1, axis=1)).argmax(axis=1)
    tail, head = (apex + 1) % 3, (apex + 2) % 3
    along = seen[rows, head] - seen[rows, tail]
    step = (left * along.conj()).real / abs(along) ** 2
    step = np.clip(step, -weights[needles, tail], weights[needles, head])
    weights[needles, tail] += step
    weights[needles, head] -= step
    return weights


def _nearest_on_edge(seen: Complex, edge: Ints) -> Floats:
    """(k, 3) barycentric coordinates of the point nearest to the origin on an edge."""
    rows = np.arange(len(seen))
    tail, head = (edge + 1) % 3, (edge + 2) % 3
    a, along = seen[rows, tail], seen[rows, head] - seen[rows, tail]
    share = np.clip(-(a * along.conj()).real / abs(along) ** 2, 0, 1)
    barycentric = np.zeros(seen.shape)
    barycentric[rows, tail], barycentric[rows, head] = 1 - share, share
    return barycentric


def z_order(z: Complex) -> Ints:
    """(k,) the rows of points of the disk along a Z-shaped curve; stable."""
    return np.argsort(_morton(z), kind="stable")


def _morton(z: Complex) -> Codes:
    """(k,) position along a Z-shaped curve: the bits of both coordinates, interleaved."""
    return _with_gaps(z.real) | _with_gaps(z.imag) << np.uint64(1)


def _with_gaps(x: Floats) -> Codes:
    """(k,) the first bits of coordinates from -1 to 1, each followed by a zero."""
    bits = np.clip((x + 1) * 2.0 ** (BITS - 1), 0, 2**BITS - 1).astype(np.uint64)
    for shift, mask in (
        (16, 0x0000FFFF0000FFFF),
        (8, 0x00FF00FF00FF00FF),
        (4, 0x0F0F0F0F0F0F0F0F),
        (2, 0x3333333333333333),
        (1, 0x5555555555555555),
    ):
        bits = (bits | bits << np.uint64(shift)) & np.uint64(mask)
    return bits
