"""Triangles to pixels: which face every pixel shows, and at which point of it.

Made once for a surface or a map, it can be coloured in many ways. NumPy alone draws two
million faces in seconds, and draws the same on every machine.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints

SAMPLES = 2  # across a pixel and down, averaged
MARGIN = 0.02  # of the picture, on each side
TILE = 64  # samples across the largest square that is looked at in one piece
ROUNDING = 1e-9  # of barycentric coordinates: so that there is no gap between two faces
CHUNK = 1 << 18  # samples that are looked at together

Bytes = NDArray[np.uint8]
Window = tuple[float, float, float, float]  # left, right, bottom, top


@dataclass(frozen=True)
class Raster:
    """What is seen of a triangle mesh with faces F; the first row of samples is on top."""

    F: Ints
    face: Ints  # (h, w) that each sample shows, -1 where there is none
    weights: Floats  # (h, w, 3) barycentric coordinates in that face

    @property
    def seen(self) -> NDArray[np.bool_]:
        """(h, w), where there is a face."""
        return self.face >= 0

    def at_vertices(self, values: Floats) -> Floats:
        """Interpolate values (n, ...) at the vertices: one row for each sample that is seen."""
        corners = values[self.F[self.face[self.seen]]]
        return np.einsum("sk,sk...->s...", self.weights[self.seen], corners)

    def image(self, colors: Floats) -> Bytes:
        """Paint the samples that are seen, (s, 3) in [0, 1], and average them to pixels.

        They are (h, w, 4): RGBA, transparent where nothing is seen.
        """
        h, w = (side // SAMPLES for side in self.face.shape)
        painted = np.zeros((*self.face.shape, 4))
        painted[self.seen, :3] = colors
        painted[self.seen, 3] = 1
        painted = painted.reshape(h, SAMPLES, w, SAMPLES, 4).sum(axis=3).sum(axis=1) / SAMPLES**2
        opacity = painted[..., 3:]
        painted[..., :3] /= np.where(opacity > 0, opacity, 1)
        return (255 * np.clip(painted, 0, 1)).round().astype(np.uint8)


def rasterize(points: Floats, F: Ints, pixels: int) -> Raster:
    """Find what is seen of a mesh in a picture of so many pixels a side, which it fills.

    `points` and `F` are those of `sample`. There is a margin; the raster has ``SAMPLES * pixels``
    rows and columns.
    """
    return sample(points, F, SAMPLES * pixels, frame(points))


def sample(points: Floats, F: Ints, side: int, window: Window) -> Raster:
    """Find what is seen of a mesh, from the positive z axis, at the centres of a square grid.

    The columns of `points` are right, up and, on a surface, towards the viewer: what is nearer
    hides what is behind. The grid has `side` rows and columns; the `window` is the square that it
    covers, in the unit of the points.
    """
    x, y = in_window(points, side, window).T - 0.5
    depth = points[:, 2] if points.shape[1] == 3 else np.zeros(len(points))

    # Rectangles of samples around the faces, large ones in tiles, so that no face needs much
    # memory; most faces of a large mesh hold no sample, and get no tile.
    left, top = (np.ceil(c[F].min(axis=1)).astype(np.int64) for c in (x, y))
    right, bottom = (np.floor(c[F].max(axis=1)).astype(np.int64) for c in (x, y))
    across, down = ((end - start) // TILE + 1 for start, end in ((left, right), (top, bottom)))
    tiles = across * down * ((left <= right) & (top <= bottom))
    of = np.repeat(np.arange(len(F)), tiles)
    number = np.arange(len(of)) - np.repeat(np.cumsum(tiles) - tiles, tiles)
    left, top = left[of] + TILE * (number % across[of]), top[of] + TILE * (number // across[of])
    reach = np.minimum(np.maximum(right[of] - left, bottom[of] - top) + 1, TILE)

    face = np.full(side * side, -1)
    second, third = np.zeros((2, side * side))  # of the barycentric coordinates
    nearest = np.full(side * side, -np.inf)
    planes = _planes(x, y, depth, F)
    for width in np.unique(reach):
        alike = np.flatnonzero(reach == width)
        step_y, step_x = (step.ravel() for step in np.mgrid[:width, :width])
        for chunk in np.array_split(alike, 1 + len(alike) * width**2 // CHUNK):
            column = left[chunk, None] + step_x
            row = top[chunk, None] + step_y
            v, w, z = planes(of[chunk], column, row)
            inside = (v >= -ROUNDING) & (w >= -ROUNDING) & (v + w <= 1 + ROUNDING)
            inside &= (column >= 0) & (column < side) & (row >= 0) & (row < side)
            pixel, z = (row * side + column)[inside], z[inside]
            order = np.argsort(z, kind="stable")
            order = order[z[order] > nearest[pixel[order]]]
            shown = pixel[order]  # where a pixel comes twice, the later, nearer one stays
            nearest[shown] = z[order]
            face[shown] = np.broadcast_to(of[chunk, None], inside.shape)[inside][order]
            second[shown], third[shown] = v[inside][order], w[inside][order]
    weights = np.stack([1 - second - third, second, third], axis=-1)
    return Raster(F, face.reshape(side, side), weights.reshape(side, side, 3))


def frame(points: Floats) -> Window:
    """Left, right, bottom and top of the picture of points, in their unit."""
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    (x, y), reach = (low + high) / 2, (high - low).max() / (2 - 4 * MARGIN)
    return x - reach, x + reach, y - reach, y + reach


def in_picture(points: Floats, side: int) -> Floats:
    """(n, 2) places of points in their picture with so many rows: to the right, and down."""
    return in_window(points, side, frame(points))


def in_window(points: Floats, side: int, window: Window) -> Floats:
    """(n, 2) places of points in a square with so many rows: to the right, and down."""
    left, right, _, top = window
    return (points[:, :2] - [left, top]) * [1, -1] * side / (right - left)


def _planes(x: Floats, y: Floats, depth: Floats, F: Ints) -> Callable[..., list[Floats]]:
    """Make of faces what is linear in the plane of the picture: two coordinates, and depth.

    It takes (k,) faces and (k, s) columns and rows, and returns (k, s) each; NaN without area.
    """
    i, j, k = F.T
    (ax, ay, az), (bx, by, bz) = ([c[e] - c[i] for c in (x, y, depth)] for e in (j, k))
    with np.errstate(all="ignore"):
        v, w = np.stack([[by, -bx], [-ay, ax]]) / (ax * by - ay * bx)
        slopes = np.stack([v, w, az * v + bz * w]).transpose(2, 0, 1)  # by x and by y
    slopes[~np.isfinite(slopes).all(axis=(1, 2))] = np.nan

    def at(faces: Ints, column: Ints, row: Ints) -> list[Floats]:
        dx, dy = column - x[i[faces], None], row - y[i[faces], None]
        by_x, by_y = slopes[faces, ..., None].transpose(2, 1, 0, 3)
        v, w, z = by_x * dx + by_y * dy
        return [v, w, depth[i[faces], None] + z]

    return at
