"""Areas of triangles, on the surface and, signed, in the plane."""

from __future__ import annotations

import numpy as np

from .arrays import Floats, Ints

__all__ = ["area_products", "face_areas"]


def face_areas(V: Floats, F: Ints) -> Floats:
    """(m,) areas of triangles in space."""
    i, j, k = F.T
    return np.linalg.norm(np.cross(V[j] - V[i], V[k] - V[i]), axis=1) / 2


def area_products(u: Floats, v: Floats, F: Ints) -> tuple[Floats, Floats]:
    """Compute the two products whose difference is twice the signed area."""
    i, j, k = F.T
    return (u[i] - u[k]) * (v[j] - v[k]), (v[i] - v[k]) * (u[j] - u[k])
