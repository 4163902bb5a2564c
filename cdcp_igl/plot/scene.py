"""A surface and its maps, in the colours that pictures have: the one drawing engine."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .. import libigl
from ..arrays import Floats, Ints, as_complex, coordinates
from ..extras import from_extra
from ..surface.validation import checked_surface
from ..verdict.distortion import angle_distortion
from .raster import Bytes, frame, rasterize
from .viewpoint import choose_viewpoint

with from_extra("plot"):
    from matplotlib import colormaps

Extent = tuple[float, float, float, float]

LIGHT = np.array([-0.35, 0.5, 0.79])  # from above left, behind the viewer
POLAR = 0.998  # sine of a latitude: beyond it, squares would be too small to see
SQUARES = 24  # of the checkerboard, across the diameter of the disk
DARK, BRIGHT = np.array([0.0, 0.447, 0.698]), np.array([0.97, 0.97, 0.95])  # its colours
SCALE = "viridis"  # of the angular distortion: even steps, also without colour vision


class Scene:
    """A surface from where it shows itself best, in pictures of so many pixels a side.

    If it `turns` them, what one sees of the surface keeps its direction in each map.
    """

    def __init__(self, V: ArrayLike, F: ArrayLike, pixels: int, *, turns: bool = True) -> None:
        (self._V, self._F), self._pixels, self._turns = checked_surface(V, F), pixels, turns
        self._view = choose_viewpoint(self._V, self._F)
        self.points = self._V @ self._view.T
        self.surface = rasterize(self.points, self._F, pixels)
        self._normals = vertex_normals(self.points, self._F)
        self._colors = normal_colors(self._normals)
        towards = self.surface.at_vertices(self._normals) @ (LIGHT / np.linalg.norm(LIGHT))
        self._light = np.clip(0.72 + 0.3 * towards, 0, 1)[:, None]

    def by_normal(self) -> Bytes:
        """Return the surface, coloured by its normals."""
        return self.surface.image(self.surface.at_vertices(self._colors))

    def plain(self) -> Bytes:
        """Return the surface in light grey, to draw upon."""
        return self.surface.image(self._light * [0.92, 0.92, 0.92])

    def disk(self, uv: Floats) -> Bytes:
        """Return a map, (n, 2) or onto the sphere (n, 3), in the colours of the surface."""
        image = rasterize(self._turned(uv), self._F, self._pixels)
        return image.image(image.at_vertices(self._colors))

    def extent(self, uv: Floats) -> Extent:
        """Return left, right, bottom and top of `disk`, in the unit of the map."""
        return frame(self._turned(uv))

    def checkerboard(self, uv: Floats) -> Bytes:
        """Return the surface under the checkerboard of its image, as wide as the image.

        That of a sphere lies between meridians and parallels, as on Mercator's map.
        """
        image = self._turned(uv)
        if image.shape[1] == 3:
            x, y, z = self.surface.at_vertices(image).T
            height = np.clip(y / np.sqrt(x * x + y * y + z * z), -POLAR, POLAR)
            mercator = np.column_stack([np.arctan2(x, z), np.arctanh(height)])
            squares = SQUARES / (2 * np.pi) * mercator
        else:
            middle = (image.max(axis=0) + image.min(axis=0)) / 2
            across = SQUARES * (image - middle) / np.ptp(image, axis=0).max()
            squares = self.surface.at_vertices(across)
        odd = np.floor(squares).sum(axis=1) % 2 == 1
        return self.surface.image(self._light * np.where(odd[:, None], DARK, BRIGHT))

    def distortion(self, uv: Floats, most: float) -> Bytes:
        """Return the surface by angular distortion, mean of a face's corners, 0 to `most`."""
        degrees = angle_distortion(self._V, self._F, uv).mean(axis=1)
        colors = colormaps[SCALE](degrees[self.surface.face[self.surface.seen]] / most)[:, :3]
        return self.surface.image(self._light * colors)

    def _turned(self, uv: Floats) -> Floats:
        """Turn a map so that what one sees of the surface keeps its direction."""
        if uv.shape[1] == 3:
            return uv @ self._view.T
        if not self._turns:
            return uv
        turn = np.exp(1j * angle_to_view(self.points, self._normals, uv))
        return coordinates(as_complex(uv) * turn)


def angle_to_view(points: Floats, normals: Floats, uv: Floats) -> float:
    """Angle by which to turn a map so that what one sees of the surface keeps its direction.

    Points and normals (n, 3) are seen from the positive z axis.
    """
    front = normals[:, 2] > 0
    z, x = as_complex(uv), as_complex(points[:, :2])
    return float(np.angle(np.vdot(z[front], x[front] - x.mean())))


def vertex_normals(V: Floats, F: Ints) -> Floats:
    """(n, 3) unit normals, faces weighted by area; zero at vertices without area."""
    return np.nan_to_num(libigl.vertex_normals(V, F), nan=0.0)


def normal_colors(normals: Floats) -> Floats:
    """(n, 3) RGB: each axis of the normal, as the viewer has it, on a primary; lit."""
    light = LIGHT / np.linalg.norm(LIGHT)
    shade = 0.8 + 0.35 * (normals @ light)  # nothing goes black: the disk shows all sides
    return np.clip((0.5 + 0.5 * normals) * shade[:, None], 0, 1)
