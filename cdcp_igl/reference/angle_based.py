"""Angle-based flattening: angles first, then the map that has them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_matrix, diags, vstack

from ..arrays import Floats, places
from ..errors import MapError, counted
from ..io.given import takes_meshes
from ..solve.solvers import factorize
from ..surface.mesh import DiskMesh
from .certified import checked_free_map
from .free_boundary import least_squares_layout

TOLERANCE = 1e-8  # of what the constraints lack, in radians
MAX_STEPS = 50  # the Human Brain takes 6


@takes_meshes
def abf(V: ArrayLike, F: ArrayLike, *, linear: bool = False) -> Floats:
    """Map a triangulated disk to the plane with the corner angles nearest to its own (ABF).

    The boundary is free. Angles a minimise the sum of ((a - b) / b)^2, b those of the surface,
    scaled to 2 pi around interior vertices. They are subject to what holds in the plane: the
    angles of a triangle add up to pi, those around an interior vertex to 2 pi, and the lengths
    close around it: the logarithms of the sines of the angles that follow and precede it add up to
    the same. Newton's method leaves out the curvature of the constraints, as ABF++ does, and with
    the logarithms of Zayer et al. its first step is their linear ABF.

    The map may overlap itself. To be compared on angles only.

    Parameters
    ----------
    V, F
        As in `harmonic`.
    linear : bool
        Whether to take the first step only: the angles are those of a plane mesh to first order,
        and the map has them as nearly as it can.

    Returns
    -------
    (n, 2) float64
        As of `lscm`.

    Raises
    ------
    MeshError, SolverError
        As `harmonic`.
    MapError
        If an angle is not positive, or the constraints are not satisfied after 50 steps; or as
        `lscm`.

    References
    ----------
    A. Sheffer, B. Lévy, M. Mogilnitsky, A. Bogomyakov. ABF++: fast and robust angle based
    flattening. ACM Trans. Graph. 24(2), 2005.

    R. Zayer, B. Lévy, H.-P. Seidel. Linear angle based parameterization. Symposium on Geometry
    Processing, 2007.

    Examples
    --------
    A plane mesh keeps its angles:

    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.square(4)
    >>> uv = cdcp_igl.reference.abf(V, F)
    >>> bool(cdcp_igl.angle_distortion(V, F, uv).max() < 1e-4)
    True
    """
    mesh = DiskMesh(V, F)
    m, nI = len(mesh.F), len(mesh.interior)
    inside = ~mesh.on_boundary[mesh.F]
    vertex = places(mesh.interior, len(mesh.V))[mesh.F[inside]]
    corner = np.arange(3 * m).reshape(m, 3)

    def sums(rows: ArrayLike, corners: ArrayLike, count: int) -> csr_matrix:
        return csr_matrix(
            (np.ones(np.size(rows)), (np.ravel(rows), np.ravel(corners))), (count, 3 * m)
        )

    in_triangle = sums(corner // 3, corner, m)
    around = sums(vertex, corner[inside], nI)
    after = sums(vertex, np.roll(corner, -1, axis=1)[inside], nI)
    before = sums(vertex, np.roll(corner, 1, axis=1)[inside], nI)

    b = mesh.angles.ravel()
    b = b * np.where(inside.ravel(), around.T @ (2 * np.pi / (around @ b)), 1)
    a = b
    for step in range(MAX_STEPS):
        if not a.min() > 0:
            count = counted((a <= 0).sum(), "angle is", "angles are")
            raise MapError(f"Angle-based flattening: {count} not positive")
        lack = np.concatenate(
            [in_triangle @ a - np.pi, around @ a - 2 * np.pi, (after - before) @ np.log(np.sin(a))]
        )
        if abs(lack).max() < TOLERANCE or (linear and step):
            return checked_free_map(mesh, least_squares_layout(mesh, a.reshape(m, 3)))
        J = vstack([in_triangle, around, (after - before) @ diags(1 / np.tan(a))])
        multipliers = factorize(J @ diags(b**2) @ J.T).solve(J @ (a - b) - lack)
        a = b + b**2 * (J.T @ multipliers)
    raise MapError(f"Angle-based flattening: no plane mesh after {MAX_STEPS} steps")
