"""Triangles to pixels: which face every pixel shows, and at which point of it.

Made once for a surface or a map, it can be coloured in many ways. NumPy alone draws two
million faces in seconds, and draws the same on every machine.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cdcp_igl.arrays import Floats, Ints

SAMPLES = 2  # across a pixel and down, averaged
MARGIN = 0.02  # of the picture, on each side
CHUNK = 1 << 20  # samples that are looked at together

Bytes = NDArray[np.uint8]


@dataclass(frozen=True)
class Raster:
    """What is seen of a triangle mesh.

    Attributes
    ----------
    F : (m, 3) int64
        The faces.
    face : (h, w) int64
        The face that each sample shows, -1 where there is none; the first row is on top.
    weights : (h, w, 3) float64
        Barycentric coordinates in that face.
    """

    F: Ints
    face: Ints
    weights: Floats

    @property
    def seen(self) -> NDArray[np.bool_]:
        """(h, w), where there is a face."""
        return self.face >= 0

    def at_vertices(self, values: Floats) -> Floats:
        """Interpolate values (n, ...) at the vertices: one row for each sample that is seen."""
        corners = values[self.F[self.face[self.seen]]]
        return np.einsum("sk,sk...->s...", self.weights[self.seen], corners)

    def on_faces(self, values: Floats) -> Floats:
        """Look up values (m, ...) on the faces: one row for each sample that is seen."""
        return values[self.face[self.seen]]

    def image(self, colors: Floats) -> Bytes:
        """Paint the samples that are seen, (s, 3) in [0, 1], and average them to pixels.

        Returns
        -------
        (h, w, 4) uint8
            RGBA, transparent where nothing is seen.
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
    """Find what is seen of a mesh, from the positive z axis.

    Parameters
    ----------
    points : (n, 2) or (n, 3) float64
        Right, up and, on a surface, towards the viewer. What is nearer hides what is behind.
    F : (m, 3) int64
    pixels : int
        Width and height of the picture, which the mesh fills but for a margin.

    Returns
    -------
    Raster
        With ``SAMPLES * pixels`` rows and columns.
    """
    side = SAMPLES * pixels
    x, y = in_picture(points, side).T - 0.5
    depth = points[:, 2] if points.shape[1] == 3 else np.zeros(len(points))

    # Rectangles of samples around the faces; most faces of a large mesh hold no sample.
    left, top = (np.ceil(c[F].min(axis=1)).astype(np.int64) for c in (x, y))
    right, bottom = (np.floor(c[F].max(axis=1)).astype(np.int64) for c in (x, y))
    reach = np.maximum(right - left, bottom - top) + 1
    reach[(right < left) | (bottom < top)] = 0

    face = np.full(side * side, -1)
    weights = np.zeros((side * side, 3))
    nearest = np.full(side * side, -np.inf)
    widths = 1 << np.arange(int(reach.max()).bit_length() + 1)
    for narrower, width in zip([0, *widths], widths, strict=False):
        alike = np.flatnonzero((reach > narrower) & (reach <= width))
        step_y, step_x = (step.ravel() for step in np.mgrid[:width, :width])
        for chunk in np.array_split(alike, 1 + len(alike) * width**2 // CHUNK):
            column = left[chunk, None] + step_x
            row = top[chunk, None] + step_y
            lam = _barycentric(x[F[chunk]], y[F[chunk]], column, row)
            inside = (lam >= 0).all(axis=2)
            inside &= (column >= 0) & (column < side) & (row >= 0) & (row < side)
            pixel = (row * side + column)[inside]
            z = np.einsum("fsk,fk->fs", lam, depth[F[chunk]])[inside]
            order = np.argsort(z, kind="stable")
            order = order[z[order] > nearest[pixel[order]]]
            shown = pixel[order]  # where a pixel comes twice, the later, nearer one stays
            nearest[shown] = z[order]
            face[shown] = np.broadcast_to(chunk[:, None], inside.shape)[inside][order]
            weights[shown] = lam[inside][order]
    return Raster(F, face.reshape(side, side), weights.reshape(side, side, 3))


def in_picture(points: Floats, side: int) -> Floats:
    """(n, 2) places of points in a picture with so many rows: to the right, and down."""
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    scale = (1 - 2 * MARGIN) * side / (high - low).max()
    return side / 2 + scale * (points[:, :2] - (low + high) / 2) * [1, -1]


def _barycentric(x: Floats, y: Floats, column: Ints, row: Ints) -> Floats:
    """(faces, samples, 3) coordinates of samples; of either orientation, NaN without area."""
    twice = (x[:, 1] - x[:, 0]) * (y[:, 2] - y[:, 0]) - (x[:, 2] - x[:, 0]) * (y[:, 1] - y[:, 0])
    lam = np.empty((*column.shape, 3))
    with np.errstate(divide="ignore", invalid="ignore"):
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            xi, yi, xj, yj = (c[:, n, None] for n in (i, j) for c in (x, y))
            lam[..., k] = ((xi - column) * (yj - row) - (xj - column) * (yi - row)) / twice[:, None]
    return lam
