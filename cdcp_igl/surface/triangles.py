"""Areas of triangles, on the surface and, signed, in the plane; angles on the surface."""

from __future__ import annotations

import numpy as np

from ..arrays import Floats, Ints, blocks

__all__ = [
    "ORIENTATION_BOUND",
    "area_products",
    "corner_angles",
    "corner_cotangents",
    "corner_products",
    "face_areas",
    "parallelogram_areas",
]

EPS = np.finfo(float).eps / 2
# Shewchuk's bound: beyond it, the rounded determinant of an orientation has the sign of the
# exact one.
ORIENTATION_BOUND = (3 + 16 * EPS) * EPS


def face_areas(V: Floats, F: Ints) -> Floats:
    """(m,) areas of triangles in space."""
    corner, after, before = V[F[:, 0]], V[F[:, 1]], V[F[:, 2]]
    return parallelogram_areas(after - corner, before - corner) / 2


def parallelogram_areas(a: Floats, b: Floats) -> Floats:
    """(m,) lengths of the cross products of vectors in space."""
    (ax, ay, az), (bx, by, bz) = a.T, b.T
    return np.sqrt((ay * bz - az * by) ** 2 + (az * bx - ax * bz) ** 2 + (ax * by - ay * bx) ** 2)


def corner_products(V: Floats, F: Ints) -> tuple[Floats, Floats]:
    """Compute what angles, cotangents and edge lengths of triangles in space come from.

    Returns
    -------
    products : (m, 3) float64
        Scalar product of the two edges that leave each corner. Those of the ends of an edge
        add up to its squared length.
    twice_area : (m,) float64
        Over the product it is the tangent of the angle at the corner.
    """
    corner, after, before = V[F[:, 0]], V[F[:, 1]], V[F[:, 2]]
    e = [before - after, corner - before, after - corner]  # opposite the corners
    products = np.empty(F.shape)
    for k in range(3):
        np.einsum("ij,ij->i", e[k - 2], e[k - 1], out=products[:, k])
    np.negative(products, out=products)
    return products, parallelogram_areas(e[1], e[2])


def corner_cotangents(V: Floats, F: Ints) -> Floats:
    """(m, 3) cotangents of triangles in space, column k at corner k; not finite without area."""
    cotangents = np.empty((3, len(F)))  # by corner, like half-edges
    with np.errstate(divide="ignore", invalid="ignore"):
        for part in blocks(len(F)):
            products, twice_area = corner_products(V, F[part])
            np.divide(products.T, twice_area, out=cotangents[:, part])
    return cotangents.T


def corner_angles(V: Floats, F: Ints) -> Floats:
    """(m, 3) angles of triangles in space in radians, unsigned; column k at corner k."""
    angles = np.empty(F.shape)
    for part in blocks(len(F)):
        products, twice_area = corner_products(V, F[part])
        np.arctan2(twice_area[:, None], products, out=angles[part])
    return angles


def area_products(u: Floats, v: Floats, F: Ints) -> tuple[Floats, Floats]:
    """Compute the two products whose difference is twice the signed area."""
    i, j, k = F.T
    return (u[i] - u[k]) * (v[j] - v[k]), (v[i] - v[k]) * (u[j] - u[k])
