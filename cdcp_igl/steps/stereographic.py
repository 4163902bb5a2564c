"""The sphere: stereographic projection, Möbius transformations, the conformal barycentre."""

from __future__ import annotations

import numpy as np

from ..arrays import Complex, Floats
from ..surface.triangles import EPS

# Towards the conformal barycentre: how many, how long, and how near to the sphere, in whose
# points half of the surface may crowd.
MAX_STEPS, LONGEST, NEAREST = 60, 0.6, 1 - 1e-10
CLOSE = 1e-8  # a shorter step leaves its square


def from_plane(z: Complex, side: int) -> Floats:
    """(n, 3) points of the sphere; 0 is at the pole (0, 0, side), 1 at (1, 0, 0)."""
    square = abs(z) ** 2
    P = np.column_stack([2 * z.real, 2 * side * z.imag, side * (1 - square)])
    return P / (1 + square)[:, None]


def to_plane(P: Floats, side: int) -> Complex:
    """(n,) the z of which `from_plane` makes points (n, 3), none at the other pole."""
    x, y, height = P.T
    z: Complex = (x + side * y * 1j) / (1 + side * height)
    return z


def moved_to_center(P: Floats, w: Floats) -> Floats:
    """Transform the unit ball such that w goes to 0, and points (n, 3) of the sphere with it."""
    from_w = P - w
    square = np.einsum("...i,...i", from_w, from_w)[..., None]
    within = 1 - np.einsum("...i,...i", P, P)[..., None]  # 0 on the sphere
    return ((1 - w @ w) * from_w - square * w) / (square + (1 - w @ w) * within)


def spherical_barycenter(P: Floats, mass: Floats) -> Floats:
    """Find w (3,) that puts the centre of mass of ``moved_to_center(P, w)`` at 0: Newton's method.

    See Cantarella and Schumacher 2022, in `sphere_map`.
    """
    mass = mass / mass.sum()
    w = np.zeros(3)
    for _ in range(MAX_STEPS):
        moved = moved_to_center(P, w)
        moment = mass @ moved
        slope = 2 * (np.eye(3) - moved.T @ (mass[:, None] * moved))
        d = np.linalg.lstsq(slope, moment, rcond=None)[0]
        d *= min(1.0, LONGEST / max(float(np.linalg.norm(d)), EPS))
        farther = moved_to_center(np.asarray(d), -w)
        if np.linalg.norm(farther) > NEAREST:
            break
        w = farther
        if np.linalg.norm(d) < CLOSE:
            break
    return w


def axes_along(direction: Floats) -> Floats:
    """Right-handed orthonormal axes (3, 3) in rows, the first along a direction (3,)."""
    axes = np.linalg.svd(direction[None])[2]  # the first one is along it, or against it
    axes *= np.sign(axes[0] @ direction)
    axes[2] *= np.linalg.det(axes)
    return axes


def rotation(P: Floats, targets: Floats) -> Floats:
    """Rotation R (3, 3) that brings points nearest to targets, both (k, 3): ``P @ R`` (Kabsch)."""
    U, _, W = np.linalg.svd(P.T @ targets)
    U[:, 2] *= np.sign(np.linalg.det(U @ W))
    return U @ W
