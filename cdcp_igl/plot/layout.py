"""What is drawn of a result, whichever kind it is: a surface and its image in a square."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, Ints
from ..distortion import AngleDistortion


@dataclass(frozen=True, eq=False)
class Layout:
    """A surface and its image in the square from -1 to 1.

    Attributes
    ----------
    V : (n, 3) float64
        Scaled to unit size, so that it is drawn alike in any unit.
    F : (m, 3) int64
        Opened where the surface was cut.
    uv : (n, 2) float64
        In the square from -1 to 1.
    vertices : (n,) int64
        Their rows in the mesh that was given.
    faces : (m,) int64
        Those of the faces.
    plane : str
        What the image is called.
    distortion : AngleDistortion
        Of the faces that are drawn.
    flipped : int
        How many of them are not positively oriented.
    facts : tuple of str
        What there is to know of it.
    middle, scale : (float, float) and float
        The coordinates of the map are ``middle + scale * uv``.
    origin : (float, float)
        Texture coordinates are ``origin + uv / 2``.
    ball : (n, 3) float64, optional
        The image on the unit sphere, which is drawn; `uv` is then a chart for textures.
    """

    V: Floats
    F: Ints
    uv: Floats
    vertices: Ints
    faces: Ints
    plane: str
    distortion: AngleDistortion
    flipped: int
    facts: tuple[str, ...]
    middle: tuple[float, float] = (0.0, 0.0)
    scale: float = 1.0
    origin: tuple[float, float] = (0.5, 0.5)
    ball: Floats | None = None

    @property
    def image(self) -> Floats:
        """(n, 2) or (n, 3) the map."""
        return self.uv if self.ball is None else self.ball

    @property
    def drawn(self) -> tuple[Floats, Ints, Floats]:
        """V, F and the image; a sphere without the seam between its charts."""
        if self.ball is None:
            return self.V, self.F, self.uv
        _, first, rows = np.unique(self.vertices, return_index=True, return_inverse=True)
        return self.V[first], rows[self.F], self.ball[first]

    @property
    def turns(self) -> bool:
        """Whether the image may be turned to match the surface; a rectangle stands upright."""
        return self.plane == "Disk"
