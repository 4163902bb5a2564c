"""Areas of triangles, on the surface and, signed, in the plane."""

from __future__ import annotations

import numpy as np

from .arrays import Floats, Ints

__all__ = ["area_products", "face_areas", "parallelogram_areas"]


def face_areas(V: Floats, F: Ints) -> Floats:
    """(m,) areas of triangles in space."""
    corner, after, before = V[F[:, 0]], V[F[:, 1]], V[F[:, 2]]
    return parallelogram_areas(after - corner, before - corner) / 2


def parallelogram_areas(a: Floats, b: Floats) -> Floats:
    """(m,) lengths of the cross products of vectors in space."""
    (ax, ay, az), (bx, by, bz) = a.T, b.T
    return np.sqrt((ay * bz - az * by) ** 2 + (az * bx - ax * bz) ** 2 + (ax * by - ay * bx) ** 2)


def area_products(u: Floats, v: Floats, F: Ints) -> tuple[Floats, Floats]:
    """Compute the two products whose difference is twice the signed area."""
    i, j, k = F.T
    return (u[i] - u[k]) * (v[j] - v[k]), (v[i] - v[k]) * (u[j] - u[k])
