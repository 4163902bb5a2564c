"""The face of a map in which a point lies, and where in it: in the plane, and on the sphere."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import libigl
from ..arrays import Bools, Complex, Floats, Ints, as_complex, coordinates
from ..cached import cached_property
from .topology import Edges, group_by_edge, tails
from .triangles import EPS, oriented_areas, spanned_areas

Codes = NDArray[np.uint64]

BITS = 31  # of each coordinate in a Morton code: a cell of 1e-9
ON_CIRCLE = 1e-12  # vertices this near the circle lie on it
RIM = 1e-6  # points this near are taken to the rim: they have single precision, or six digits
RESOLUTION = 2.0**-52  # of coordinates in the disk
# Beyond it, times d and e, an area in the plane that touches the unit sphere at a point has the
# sign of the exact volume; the ends of its edge are d and e away from the point. Seen from there,
# each end is wrong by 20 EPS of its distance at most: 1 by the difference, 14 by the frame, 5 by
# the products. So the area is wrong by 2 (20 + 1) EPS d e, to first order.
TANGENT_BOUND = 48 * EPS
TINY = 1e-160  # squares of distances that are no larger have lost digits
BLOCK = 1 << 17  # points that walk at a time: their arrays stay in the cache
AHEAD = 16  # of so many points that are close together, the first is located before the others


class FaceFinder:
    """Locates points in a certified map z (n,) to the plane, whose coordinates are at most 1.

    A walk: from a face nearby, across an edge that has the point on its other side, until
    there is none. The edge is drawn by lot where there are two, so that no walk goes in
    circles. On which side of an edge a point lies is exact, as the certificate is: where rounding
    leaves the sign in doubt, exact arithmetic decides. So a walk ends in a face that contains the
    point, however crowded the faces are.

    The image need not be convex: of points whose walk leaves it, or is long, the nearest of all
    faces is searched in a tree of boxes. They are taken to it if they are nearly there; if the map
    is `inscribed` in the unit circle, those between an edge with both ends on it and its arc, too.
    ValueError if a face is flipped.

    O. Devillers, S. Pion, M. Teillaud. Walking in a triangulation. Int. J. Found. Comput.
    Sci. 13(2), 2002.
    """

    def __init__(
        self, F: Ints, z: Complex, edges: Edges | None = None, *, inscribed: bool = False
    ) -> None:
        area, error = oriented_areas(z, F)
        if (area < -error).any():
            raise ValueError("the map is no bijection: points have no one place on the surface")
        self._inscribed = inscribed
        uv, corners = coordinates(z), z[F]
        # An arc is no higher over its chord than a quarter of the square of that.
        longest = float(abs(corners - np.roll(corners, 1, axis=1)).max())
        margin = RIM + inscribed * longest**2 / 4
        self._low, self._high = uv[F].min(axis=(0, 1)) - margin, uv[F].max(axis=(0, 1)) + margin
        self._index(F, np.column_stack([uv, np.zeros(len(z))]), corners, edges)

    def _index(self, F: Ints, P: Floats, corners: Any, edges: Edges | None) -> None:
        self._F, self._P, self._corners = F, P, corners  # real ones of the sphere
        n = len(P)
        self._across = _faces_across(F, edges or group_by_edge(tails(F, n), n))
        codes = _morton(self._key(corners.mean(axis=1)))
        self._start = np.argsort(codes, kind="stable")
        self._codes = codes[self._start]
        # A walk from nearby crosses fewer faces; one across all of a mesh as many, about.
        self._most = 100 + 10 * int(np.sqrt(len(F)))

    @cached_property
    def _tree(self) -> libigl.Tree:
        return libigl.Tree(self._P, self._F)

    def _near(self, points: Complex) -> Ints:
        """Find the points that are not too far away: their rows."""
        uv = coordinates(points)
        near = ((self._low <= uv) & (uv <= self._high)).all(axis=1)
        return np.flatnonzero(near & (abs(points) <= 1 + RIM) if self._inscribed else near)

    def _key(self, points: Complex) -> Complex:
        """(k,) points of the disk by which those that are near are found."""
        return points

    def _frames(self, points: Complex) -> Any:
        """(k, ...) what places are seen by from points, for all steps of their walks."""
        return points

    def _seen(self, corners: Complex, points: Complex) -> tuple[Complex, Floats, Floats]:
        """(k, 3) corners of faces as seen from a point each, which is 0 in the plane.

        And twice the areas of 0 with the edges opposite each corner, and bounds of their errors.
        """
        seen = corners - points[:, None]
        return seen, *_areas(seen)

    def _clockwise(self, tails: Complex, heads: Complex, points: Complex) -> Bools:
        """(k,) whether points are to the right of edges, exactly."""
        corners = np.stack([heads, tails, points], axis=1)
        return libigl.is_counterclockwise(np.stack([corners.real, corners.imag], axis=-1))

    def _sides(self, corners: Any, frames: Any) -> tuple[Complex, Floats, Bools]:
        """See corners from points, with areas; tell beyond which edges (k, 3) the points lie."""
        seen, areas, error = self._seen(corners, frames)
        beyond = areas < 0
        row, k = np.nonzero(abs(areas) < error)
        if len(row):
            edge = corners[row, k - 2], corners[row, k - 1]
            beyond[row, k] = self._clockwise(*edge, frames[row])
        return seen, areas, beyond

    def locate(self, points: Complex) -> tuple[Ints, Floats, Floats]:
        """Find the face (k,) of points, barycentric coordinates (k, 3) in it, and how far it is.

        The points are finite. Where there is no face, it is -1, with NaN, and the distance (k,)
        infinite; it is 0 within a face. Coordinates are not negative, and rows sum to 1.
        """
        face = np.full(len(points), -1)
        barycentric, away = np.full((len(points), 3), np.nan), np.full(len(points), np.inf)
        near = self._near(points)
        codes = _morton(self._key(points[near]))
        # In this order, neighbours in the plane are neighbours in memory.
        order = np.argsort(codes, kind="stable")
        near, codes = near[order], codes[order]
        for first in range(0, len(near), BLOCK):
            rows = near[first : first + BLOCK]
            nearest = np.searchsorted(self._codes, codes[first : first + BLOCK])
            start = self._start[np.minimum(nearest, len(self._start) - 1)]
            if len(near) > len(self._start):  # neighbours are nearer than centres of long faces
                sent, weights = self._walk(points[rows[::AHEAD]], start[::AHEAD])
                sent = np.where(np.isnan(weights[:, 0]), start[::AHEAD], sent)
                start = np.repeat(sent, AHEAD)[: len(rows)]
            face[rows], barycentric[rows] = self._walk(points[rows], start)
        away[near] = 0
        if len(lost := near[np.isnan(barycentric[near, 0])]):
            face[lost], barycentric[lost], away[lost] = self._nearest(points[lost])
        return face, barycentric, away

    def _walk(self, points: Any, start: Ints) -> tuple[Ints, Floats]:
        """Walk from the given faces to those of the points: the last ones.

        The weights (k, 3) are NaN where a walk has not arrived.
        """
        face, barycentric = start.copy(), np.full((len(points), 3), np.nan)
        on_way, frames = np.arange(len(points)), self._frames(points)
        lots = np.random.default_rng(0)
        for _ in range(self._most):
            if len(on_way) == 0:
                break
            at = face[on_way]
            seen, areas, beyond = self._sides(self._corners[at], frames[on_way])
            blocked = beyond.any(axis=1)
            there = np.flatnonzero(~blocked)
            barycentric[on_way[there]] = _weights(seen[there], areas[there])

            ahead = np.flatnonzero(blocked)
            edge = (beyond[ahead] * lots.random((len(ahead), 3))).argmax(axis=1)
            following = self._across[at[ahead], edge]
            inside = following >= 0
            on_way = on_way[ahead[inside]]
            face[on_way] = following[inside]
        return face, barycentric

    def _nearest(self, points: Complex) -> tuple[Ints, Floats, Floats]:
        """Locate points in the nearest of all faces, if that is near enough, as `locate` does."""
        face = self._tree.nearest(np.column_stack([coordinates(points), np.zeros(len(points))]))
        barycentric, away = self._foot(points, face)
        # To the tree, needles are farther away than they are: a walk goes on into them.
        last, _ = self._walk(points, face)
        other, nearer = self._foot(points, last)
        better = nearer < away
        face[better], barycentric[better], away[better] = (
            last[better],
            other[better],
            nearer[better],
        )
        far = away > RIM
        if self._inscribed:
            on_circle = abs(self._corners[face]) > 1 - ON_CIRCLE
            far &= ~(on_circle | (barycentric == 0)).all(axis=1)
        face[far], barycentric[far], away[far] = -1, np.nan, np.inf
        return face, barycentric, away

    def _foot(self, points: Complex, face: Ints) -> tuple[Floats, Floats]:
        """Find the nearest place (k, 3) to each point in a face, and how far it is."""
        seen, areas, beyond = self._sides(self._corners[face], points)
        barycentric = _weights(seen, areas)
        out = np.flatnonzero(beyond.any(axis=1))
        on_edges = np.stack([_nearest_on_edge(seen[out], k) for k in range(3)])
        edge = abs((on_edges * seen[out]).sum(axis=2)).argmin(axis=0)
        barycentric[out] = on_edges[edge, np.arange(len(out))]
        return barycentric, abs((barycentric * seen).sum(axis=1))


class SphereFinder(FaceFinder):
    """Locates points (k, 3) of the sphere in a certified map P (n, 3) onto it.

    In the plane that touches the sphere at a point, the corners of a face lie around it if the
    spherical triangle contains it; its barycentric coordinates there are those of the place where
    the ray from 0 meets the straight triangle. The faces cover the sphere, so that each point is in
    one of them.
    """

    def __init__(self, F: Ints, P: Floats, edges: Edges) -> None:
        self._inscribed = False
        self._index(F, P, P[F], edges)

    def _near(self, points: Floats) -> Ints:  # type: ignore[override]
        return np.arange(len(points))

    def _key(self, points: Floats) -> Complex:  # type: ignore[override]
        # Lambert's azimuthal projection, of equal area.
        z = as_complex(points[:, :2])
        height = points[:, 2] / np.linalg.norm(points, axis=1)
        return z / np.maximum(abs(z), EPS) * np.sqrt(np.maximum(1 - height, 0) / 2)

    def _frames(self, points: Floats) -> Floats:  # type: ignore[override]
        """(k, 3, 3) to the right, up, and the point."""
        x, y, z = points.T
        side = np.copysign(1, z)
        a = -1 / (side + z)
        right = 1 + side * x**2 * a, side * x * y * a, -side * x
        up = x * y * a, side + y**2 * a, -y
        return np.stack([*right, *up, x, y, z], axis=1).reshape(-1, 3, 3)

    def _seen(  # type: ignore[override]
        self, corners: Floats, frames: Floats
    ) -> tuple[Complex, Floats, Floats]:
        away = corners - frames[:, None, 2]
        seen = np.empty(away.shape[:2], dtype=complex)
        for k, axis in enumerate((seen.real, seen.imag)):
            np.einsum("kic,kc->ki", away, frames[:, k], out=axis)
        size = np.sqrt(np.einsum("kic,kic->ki", away, away))
        areas, error = np.empty(seen.shape), np.empty(seen.shape)
        for k in range(3):
            areas[:, k] = (seen[:, k - 2].conj() * seen[:, k - 1]).imag
            error[:, k] = TANGENT_BOUND * size[:, k - 2] * size[:, k - 1] + TINY
        return seen, areas, error

    def _clockwise(self, tails: Floats, heads: Floats, frames: Floats) -> Bools:  # type: ignore[override]
        return libigl.is_seen_from_outside(np.stack([heads, tails, frames[:, 2]], axis=1))

    def _nearest(self, points: Floats) -> tuple[Ints, Floats, Floats]:  # type: ignore[override]
        """Locate points whose walk is long, by a look at all faces each."""
        face, frames = np.empty(len(points), dtype=np.int64), self._frames(points)
        for k, frame in enumerate(frames):
            everywhere = np.broadcast_to(frame, (len(self._F), 3, 3))
            face[k] = self._sides(self._corners, everywhere)[2].any(axis=1).argmin()
        seen, areas, _ = self._sides(self._corners[face], frames)
        return face, _weights(seen, areas), np.zeros(len(points))


def _faces_across(F: Ints, edges: Edges) -> Ints:
    """(m, 3) the face across the edge opposite corner k, or -1 at the boundary."""
    (one, other), m = edges.twins, len(F)
    across = np.full(3 * m, -1)
    across[one], across[other] = other % m, one % m
    # Half-edge k m + f leaves corner k of face f, so it lies opposite corner k - 1.
    return np.roll(across.reshape(3, m), -1, axis=0).T.copy()


def _areas(seen: Complex) -> tuple[Floats, Floats]:
    """(k, 3) twice the areas of 0 with the edges opposite each corner; bounds of their errors.

    Faces on both sides of an edge have exactly opposite values; those at a corner in 0 are 0.
    """
    areas, error = np.empty(seen.shape), np.empty(seen.shape)
    for k in range(3):
        areas[:, k], error[:, k] = spanned_areas(seen[:, k - 2], seen[:, k - 1])
    return areas, error


def _weights(seen: Complex, areas: Floats) -> Floats:
    """(k, 3) barycentric coordinates of 0 in faces that contain it."""
    areas = np.maximum(areas, 0)
    total = areas.sum(axis=1, keepdims=True)
    weights = areas / np.where(total > 0, total, 1)
    # Along a needle the ratios of its areas say little: a projection on its longest edge does. It
    # leaves the apex no more than what the other two can balance.
    left = abs((weights * seen).sum(axis=1))
    needles = np.flatnonzero((left > RESOLUTION) | (total[:, 0] <= 0))
    seen, rows = seen[needles], np.arange(len(needles))
    apex = abs(np.roll(seen, -1, axis=1) - np.roll(seen, 1, axis=1)).argmax(axis=1)
    tail, head = (apex + 1) % 3, (apex + 2) % 3
    start = seen[rows, tail]
    along = seen[rows, head] - start
    share, foot = (
        np.clip(((x - start) * along.conj()).real / abs(along) ** 2, 0, 1)
        for x in (0, seen[rows, apex])
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        most = np.fmin(share / foot, (1 - share) / (1 - foot))
    top = np.fmin(weights[needles, apex], most)
    weights[needles, apex] = top
    weights[needles, head] = np.maximum(share - top * foot, 0)
    weights[needles, tail] = np.maximum(1 - top - weights[needles, head], 0)
    return weights


def _nearest_on_edge(seen: Complex, corner: int) -> Floats:
    """(k, 3) barycentric coordinates of the point nearest to the origin on the edge opposite."""
    tail, head = seen[:, corner - 2], seen[:, corner - 1]
    along = head - tail
    barycentric = np.zeros(seen.shape)
    share = np.clip(-(tail * along.conj()).real / abs(along) ** 2, 0, 1)
    barycentric[:, corner - 2], barycentric[:, corner - 1] = 1 - share, share
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
