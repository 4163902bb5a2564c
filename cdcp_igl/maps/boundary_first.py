"""Boundary first: conformal maps by the scale, or by the angles, of the boundary.

With u the logarithm of the scale and Omega the angle defects, L u = -Omega inside; at the boundary
L u is the difference k~ - k of the exterior angles in the plane and on the surface.

References
----------
R. Sawhney, K. Crane. Boundary first flattening. ACM Trans. Graph. 37(1), 2018.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Complex, Floats, marked
from ..solve.factored import FactoredSurface
from ..steps.trace import boundary_flux, edge_lengths
from ..surface.mesh import Mesh


def curvatures(mesh: Mesh) -> Floats:
    """(n,) angle defects inside, and on the boundary exterior angles; they add up to 2 pi."""
    around = np.bincount(mesh.F.ravel(), mesh.angles.ravel(), len(mesh.scaled))
    return np.where(mesh.on_boundary, np.pi, 2 * np.pi) - around


def edge_means(u_B: Floats) -> Floats:
    """(nB,) means over the edges that leave the vertices of the loop."""
    return (u_B + np.roll(u_B, -1)) / 2


def angles_of_scale(surface: FactoredSurface, u_B: Floats) -> Floats:
    """(nB,) exterior angles in the plane where the boundary is scaled by exp(u_B) (nB,)."""
    sources = -curvatures(surface.mesh)
    if u_B.any():
        u = np.zeros(len(sources))
        u[surface.mesh.loop] = u_B
        sources -= surface.laplacian.times(u)
    return boundary_flux(surface, sources)


def scale_of_angles(pinned: FactoredSurface, angles: Floats) -> Floats:
    """u_B (nB,) of exterior angles in the plane; 0 at the vertex that alone is not free."""
    loop, r = pinned.mesh.loop, -curvatures(pinned.mesh)
    r[loop] += angles
    return pinned.solve(r)[loop]


def grounded(surface: FactoredSurface) -> FactoredSurface:
    """Factor the Laplacian but for the row of the first boundary vertex."""
    mesh = surface.mesh
    return FactoredSurface(mesh, surface.laplacian, ~marked(len(mesh.scaled), mesh.loop[0]))


def closed_curve(mesh: Mesh, u_B: Floats, angles: Floats) -> Complex:
    """(nB,) points of a closed polygon with these exterior angles, scaled by nearly exp(u_B).

    It is closed by the change of lengths that is least, its squares weighted by 1 / length.
    """
    length = edge_lengths(mesh)
    target = length * np.exp(edge_means(u_B))
    T = np.exp(1j * np.cumsum(angles))  # directions of the edges
    A = np.array([T.real, T.imag])
    closed = target - length * (A.T @ np.linalg.solve((A * length) @ A.T, A @ target))
    return np.append(0, np.cumsum(closed * T)[:-1])
