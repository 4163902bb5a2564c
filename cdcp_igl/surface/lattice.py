"""The regular mesh of the disk."""

from __future__ import annotations

import numpy as np

from ..arrays import Complex, Ints

__all__ = ["disk_lattice"]

# Between the circle and the lattice, in sides. Among 0.4, 0.45, ..., 0.9 this has the largest
# smallest angle, 31 degrees, over sides from 1 to 0.01.
MARGIN = 0.8


def disk_lattice(side: float) -> tuple[Complex, Ints]:
    """Mesh the unit disk by a lattice of equilateral triangles and a ring on the circle.

    Parameters
    ----------
    side : float
        Of the triangles, from 0 to 1; neighbours on the circle are as far apart.

    Returns
    -------
    z : (k,) complex128
        The ring first, counterclockwise from 1.
    F : (m, 3) int64
        Counterclockwise; the Delaunay triangulation.
    """
    from scipy.spatial import Delaunay  # slow to import, and only a lattice uses it

    reach = int(2 / side) + 1
    row, column = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    inner = side * (column + row * np.exp(1j * np.pi / 3)).ravel()
    inner = inner[abs(inner) < 1 - MARGIN * side]
    ring = np.exp(2j * np.pi * np.linspace(0, 1, round(2 * np.pi / side), endpoint=False))
    z = np.concatenate([ring, inner])
    F = Delaunay(np.column_stack([z.real, z.imag])).simplices.astype(np.int64)
    a, b, c = z[F.T]
    clockwise = ((b - a).conj() * (c - a)).imag < 0
    F[clockwise] = F[clockwise, ::-1]
    return z, F
