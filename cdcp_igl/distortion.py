"""Angular distortion, eq. (7)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from . import libigl
from .arrays import Complex, Floats, Ints
from .check import as_faces, as_vertices

__all__ = ["AngleDistortion", "angle_distortion", "plane_angles"]


@dataclass(frozen=True)
class AngleDistortion:
    """Mean, standard deviation and maximum of the angular distortion over all corners.

    Attributes
    ----------
    mean, sd, max : float
        Degrees. `mean` and `sd` are the two numbers of the paper's Table 1.
    """

    mean: float
    sd: float
    max: float

    @classmethod
    def of(cls, degrees: Floats) -> AngleDistortion:
        """Summarise an (m, 3) array that `angle_distortion` returned."""
        return cls(float(degrees.mean()), float(degrees.std()), float(degrees.max()))

    def __str__(self) -> str:
        return f"mean {self.mean:.4f}, SD {self.sd:.4f}, max {self.max:.2f} degrees"


def angle_distortion(V: ArrayLike, F: ArrayLike, uv: ArrayLike) -> Floats:
    """Absolute change of every corner angle, eq. (7).

    Parameters
    ----------
    V : (n, 3) or (n, 2) array_like
        Vertex positions of the surface.
    F : (m, 3) array_like of integers
        Corners of the faces. The surface need not be a disk.
    uv : (n, 2) array_like
        Positions in the plane.

    Returns
    -------
    (m, 3) float64
        Degrees; column k belongs to corner k of the face. The angles of a flipped face
        count as negative, so that it is never taken for a conformal one.

    Raises
    ------
    MeshError
        If V and F are no triangle mesh, or a coordinate is not finite.
    ValueError
        If `uv` does not have two columns and a row for each row of V.

    Examples
    --------
    A square stretched to twice its width:

    >>> import cdcp_igl
    >>> V = [[0, 0], [1, 0], [1, 1], [0, 1]]
    >>> F = [[0, 1, 2], [0, 2, 3]]
    >>> uv = [[0, 0], [2, 0], [2, 1], [0, 1]]
    >>> cdcp_igl.angle_distortion(V, F, uv).round(2)
    array([[18.43,  0.  , 18.43],
           [18.43, 18.43,  0.  ]])
    """
    positions = as_vertices(V)
    faces = as_faces(F, len(positions))
    if np.shape(uv) != (len(positions), 2):
        raise ValueError(
            f"uv has shape {np.shape(uv)}, V has {len(positions)} rows: uv must be (n, 2)"
        )
    u, v, _ = as_vertices(uv, "uv").T
    angles = libigl.internal_angles(positions, faces)
    return np.degrees(abs(plane_angles(u + 1j * v, faces) - angles))


def plane_angles(z: Complex, F: Ints) -> Floats:
    """(m, 3) corner angles in radians of plane triangles, negative in clockwise ones.

    0 or pi, never NaN, in triangles that have collapsed.
    """
    corners = [z[F[:, k]] for k in range(3)]
    u, v, w = (corners[k - 2] - corners[k] for k in range(3))  # edge k leaves corner k
    twice_area = u.real * v.imag - u.imag * v.real
    angles = np.empty(F.shape)
    for k, (ahead, back) in enumerate([(u, w), (v, u), (w, v)]):
        cosine = -(ahead.real * back.real + ahead.imag * back.imag)
        np.arctan2(twice_area, cosine, out=angles[:, k])
    return angles
