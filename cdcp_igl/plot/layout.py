"""What is drawn of a result, whichever kind it is: a surface and its image in a square."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, Ints
from ..verdict.distortion import AngleDistortion


@dataclass(frozen=True, eq=False)
class Layout:
    """A surface and its image in the square from -1 to 1.

    The coordinates of the map are ``middle + scale * uv``, those of textures ``origin + uv / 2``.
    """

    V: Floats  # (n, 3) of unit size, so that it is drawn alike in any unit
    F: Ints  # (m, 3) opened where the surface was cut
    uv: Floats  # (n, 2)
    vertices: Ints  # (n,) their rows in the mesh that was given
    faces: Ints  # (m,) those of the faces
    plane: str  # what the image is called
    distortion: AngleDistortion  # of the faces that are drawn
    flipped: int  # how many of them are not positively oriented
    facts: tuple[str, ...]  # what there is to know of it
    verdict: str  # whether it is valid and conformal
    middle: tuple[float, float] = (0.0, 0.0)
    scale: float = 1.0
    origin: tuple[float, float] = (0.5, 0.5)
    charts: Ints | None = None  # (n,) where there are several, -1 of vertices of no face
    ball: Floats | None = None  # (n, 3) the image on the sphere; uv is then a chart for textures

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
