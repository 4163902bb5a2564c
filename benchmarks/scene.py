"""A surface and its maps, in the colours that the pictures of the report have."""

from __future__ import annotations

import numpy as np
from matplotlib import colormaps

from cdcp_igl.arrays import Floats, Ints
from cdcp_igl.distortion import angle_distortion
from cdcp_igl.plot.pictures import LIGHT, normal_colors, vertex_normals
from cdcp_igl.plot.viewpoint import choose_viewpoint

from .raster import Bytes, in_picture, rasterize

SQUARES = 24  # of the checkerboard, across the diameter of the disk
DARK, BRIGHT = np.array([0.0, 0.447, 0.698]), np.array([0.97, 0.97, 0.95])  # its colours
NEAR = 0.03  # of the width: how far behind what is seen a point counts as seen
SCALE = "viridis"  # of the angular distortion: even steps, also without colour vision


class Scene:
    """A surface from where it shows itself best.

    Parameters
    ----------
    V : (n, 3) float64
    F : (m, 3) int64
    pixels : int
        Width and height of the pictures.
    """

    def __init__(self, V: Floats, F: Ints, pixels: int) -> None:
        self._V, self._F, self._pixels = V, F, pixels
        self.points = V @ choose_viewpoint(V, F).T
        self.surface = rasterize(self.points, F, pixels)
        self._normals = vertex_normals(self.points, F)
        self._colors = normal_colors(self._normals)[:, :3]
        towards = self.surface.at_vertices(self._normals) @ (LIGHT / np.linalg.norm(LIGHT))
        self._light = np.clip(0.72 + 0.3 * towards, 0, 1)[:, None]

    def by_normal(self) -> Bytes:
        """Return the surface, coloured by its normals."""
        return self.surface.image(self.surface.at_vertices(self._colors))

    def plain(self) -> Bytes:
        """Return the surface in light grey, to draw upon."""
        return self.surface.image(self._light * [0.92, 0.92, 0.92])

    def disk(self, uv: Floats) -> Bytes:
        """Return a map in the colours of the surface."""
        image = rasterize(self._turned(uv), self._F, self._pixels)
        return image.image(image.at_vertices(self._colors))

    def checkerboard(self, uv: Floats) -> Bytes:
        """Return the surface under the checkerboard of its image, as wide as the image."""
        image = self._turned(uv)
        middle = (image.max(axis=0) + image.min(axis=0)) / 2
        squares = SQUARES * (image - middle) / np.ptp(image, axis=0).max()
        odd = np.floor(self.surface.at_vertices(squares)).sum(axis=1) % 2 == 1
        return self.surface.image(self._light * np.where(odd[:, None], DARK, BRIGHT))

    def distortion(self, uv: Floats, most: float) -> Bytes:
        """Return the surface by angular distortion, mean of a face's corners, 0 to `most`."""
        degrees = angle_distortion(self._V, self._F, uv).mean(axis=1)
        colors = colormaps[SCALE](self.surface.on_faces(degrees) / most)[:, :3]
        return self.surface.image(self._light * colors)

    def _turned(self, uv: Floats) -> Floats:
        """Turn a map so that what one sees of the surface keeps its direction."""
        front = self._normals[:, 2] > 0
        z, x = uv @ [1, 1j], self.points[:, :2] @ [1, 1j]
        z = z * np.exp(1j * np.angle(np.vdot(z[front], x[front] - x.mean())))
        return np.column_stack([z.real, z.imag])

    def locate(self, face: int) -> tuple[float, float, bool]:
        """Return where a face is in the picture, right and down, and whether one sees it."""
        x, y = in_picture(self.points, self._pixels)[self._F[face]].mean(axis=0)
        samples = len(self.surface.face) / self._pixels
        shown = self.surface.face[int(y * samples), int(x * samples)]
        depth, nearest = (self.points[self._F[f], 2].mean() for f in (face, shown))
        return x, y, bool(depth > nearest - NEAR * np.ptp(self.points[:, :2], axis=0).max())
