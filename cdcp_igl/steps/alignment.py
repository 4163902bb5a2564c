"""What lies at angle 0."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Complex
from ..surface.mesh import DiskMesh


def rotate(
    mesh: DiskMesh, f: Complex, align: int | ArrayLike | None, *, on_circle: bool = True
) -> Complex:
    """Turn a map (n,) about 0.

    `align` is a boundary vertex, to go to 1, or if not `on_circle` to the right; or a direction d
    in space: the height x.d of the surface, as a function in the plane, has its moment
    sum_v m_v x_v.d f_v about the mean height, m_v the area at a vertex, at angle 0. None is the
    first boundary vertex. ValueError if the height has no moment.
    """
    if align is None:
        align = mesh.loop[0]
    if isinstance(align, int | np.integer):
        if on_circle:
            return at_one(mesh, f, int(align))
        return f * (abs(f[align]) / f[align] if f[align] else 1)
    direction = np.asarray(align)
    mass = mesh.vertex_areas
    height = mesh.V @ direction
    moment = complex((mass * (height - np.average(height, weights=mass)) * f).sum())
    check_slope(align, moment, mass.sum() * np.ptp(height))
    f = f * (abs(moment) / moment)
    if on_circle:
        f[mesh.loop] /= abs(f[mesh.loop])
    return f


def check_slope(align: ArrayLike, moment: complex, most: float) -> None:
    """Raise ValueError if the moment of the height is negligible beside what it may be."""
    if not abs(moment) > 1e-12 * most:
        raise ValueError(f"align={align!r}: the surface has no slope in this direction")


def at_one(mesh: DiskMesh, f: Complex, vertex: int) -> Complex:
    """Put a boundary vertex at 1, and the boundary on the circle to the last bit."""
    f = f / f[vertex]
    f[mesh.loop] /= abs(f[mesh.loop])
    return f
