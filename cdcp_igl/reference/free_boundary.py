"""Maps with free boundary: conformal, but onto no disk."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import block_diag, csr_matrix, diags, vstack
from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh

from .. import libigl
from ..arrays import Complex, Floats, Ints, as_complex, places
from ..docstrings import like
from ..errors import MapError, SolverError, counted
from ..io.given import takes_meshes
from ..maps.boundary_first import (
    angles_of_scale,
    closed_curve,
    edge_means,
    grounded,
    scale_of_angles,
)
from ..solve.factored import FactoredSurface, harmonic_extension
from ..solve.laplacian import cotangent_laplacian
from ..solve.solvers import factorize
from ..starts.boundary import arc_length_map
from ..steps.trace import edge_lengths
from ..surface.mesh import DiskMesh, Mesh
from .certified import checked_free_map
from .dirichlet import Dirichlet, harmonic

ROUNDS = 10  # of `bff` towards a disk
ANGLE_TOLERANCE = 1e-8  # of what the constraints of `abf` lack, in radians
MAX_STEPS = 50  # of `abf`; the Human Brain takes 6
SHIFT = 1e-9  # makes the energy definite; its own eigenvalues have no unit


@takes_meshes
@like(harmonic)
def lscm(V: ArrayLike, F: ArrayLike) -> Floats:
    """Map a triangulated disk to the plane, conformally in the least squares sense, by libigl.

    The boundary is free but for two pins. The map may overlap itself and flip faces. To be
    compared on angles only.

    Returns
    -------
    (n, 2) float64
        Rows as in V, faces counterclockwise but for flips, the pins at (0, 0) and (1, 0).

    Raises
    ------
    MeshError
        If the input is not a triangulated disk.
    SolverError
        If a matrix cannot be factored.
    MapError
        If the map is not finite or has collapsed; its ``result`` is a `ReferenceMap`.

    References
    ----------
    B. Lévy, S. Petitjean, N. Ray, J. Maillot. Least squares conformal maps for automatic
    texture atlas generation. ACM Trans. Graph. 21(3), 2002.

    Examples
    --------
    A plane mesh keeps its angles:

    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.square(4)
    >>> uv = cdcp_igl.reference.lscm(V, F)
    >>> bool(cdcp_igl.angle_distortion(V, F, uv).max() < 1e-4)
    True
    """
    mesh = DiskMesh(V, F)
    uv = libigl.lscm(mesh.scaled, mesh.F, _two_far_vertices(mesh), np.eye(2)[::-1] * [1, 0])
    return checked_free_map(mesh, as_complex(uv))


def _two_far_vertices(mesh: Mesh) -> Ints:
    """Of the boundary: the farthest from its first vertex, and the farthest from that."""

    def farthest(vertex: int) -> int:
        return mesh.loop[
            np.linalg.norm(mesh.scaled[mesh.loop] - mesh.scaled[vertex], axis=1).argmax()
        ]

    first = farthest(mesh.loop[0])
    return np.array([first, farthest(first)])


@takes_meshes
@like(lscm)
def spectral(V: ArrayLike, F: ArrayLike) -> Floats:
    """Map a triangulated disk to the plane by the eigenvector of least conformal energy.

    The boundary is free and nothing is pinned. The map may overlap itself and flip faces. To be
    compared on angles only.

    The map minimises Dirichlet energy minus area (by libigl), among those whose
    boundary vertices have their mean at 0 and squares that sum to 1. (libigl's own
    ``igl.spectra.lscm`` measures the size of the whole map instead, by vertex areas, which
    distorts angles more on surfaces with large changes of scale.) SolverError, too, if the
    eigensolver fails.

    Returns
    -------
    (n, 2) float64
        Rows as in V, faces counterclockwise but for flips, the boundary vertex of smallest
        index on the positive real axis.

    References
    ----------
    P. Mullen, Y. Tong, P. Alliez, M. Desbrun. Spectral conformal parameterization.
    Comput. Graph. Forum 27(5), 2008.
    """
    mesh = DiskMesh(V, F)
    n, nB = len(mesh.scaled), len(mesh.loop)
    energy = conformal_energy(mesh, mesh.cotangents)
    on_boundary = np.zeros(2 * n)
    boundary = np.concatenate([mesh.loop, mesh.loop + n])  # of the vector [u; v]
    on_boundary[boundary] = 1
    shifted = factorize(energy + SHIFT * diags(on_boundary))

    def extend(b: Floats) -> Floats:
        """Solve (E + s B) x = B b."""
        x = np.zeros(2 * n)
        x[boundary] = b
        return shifted.solve(x)

    def centered(b: Floats) -> Floats:
        return (b.reshape(2, nB) - b.reshape(2, nB).mean(axis=1, keepdims=True)).ravel()

    # E x = lambda B x reads x_B / (lambda + s) = (extension of x_B) on the boundary: an
    # ordinary eigenproblem of size 2 nB, in which the constants are projected out.
    operator = LinearOperator(
        (2 * nB, 2 * nB), lambda b: centered(extend(centered(b))[boundary]), dtype=float
    )
    circle = arc_length_map(mesh)
    start = np.concatenate([circle.real, circle.imag])
    try:
        _, vectors = eigsh(operator, k=1, which="LA", v0=start)
    except ArpackError as error:
        raise SolverError(f"ARPACK found no conformal eigenvector: {error}") from error
    u, v = extend(vectors[:, 0]).reshape(2, n)
    f = u + 1j * v
    f -= f[mesh.loop].mean()
    f *= abs(f[mesh.loop[0]]) / f[mesh.loop[0]] / np.linalg.norm(f[mesh.loop])
    return checked_free_map(mesh, f)


@takes_meshes
@like(lscm)
def bff(V: ArrayLike, F: ArrayLike, *, disk: bool = False) -> Floats:
    """Map a triangulated disk to the plane, boundary first.

    The boundary keeps its lengths, which leads to its exterior angles; one coordinate is harmonic,
    the other its harmonic conjugate. The map may overlap itself and flip faces. To be compared on
    angles only. `free_map` begins as this does, and has both coordinates harmonic.

    The published program (version 1.6) adds 1e-8 to the diagonal of the Laplacian. That tells where
    a boundary is short for its surface: a hand that ends at the wrist has 1.17 degrees, not 1.16.

    Parameters
    ----------
    disk : bool
        Near a disk: the exterior angles are proportional to the lengths, in ten rounds; both
        coordinates are harmonic. The boundary leaves the circle by some 1e-3 of its radius.

    Returns
    -------
    (n, 2) float64
        Rows as in V, faces counterclockwise but for flips, the boundary vertex of smallest index
        at (0, 0), the unit that of V up to a power of two.

    References
    ----------
    R. Sawhney, K. Crane. Boundary first flattening. ACM Trans. Graph. 37(1), 2018.
    """
    mesh = DiskMesh(V, F)
    surface = FactoredSurface.of(mesh)
    but_one, u_B = grounded(surface), np.zeros(len(mesh.loop))
    if not disk:
        f_B = closed_curve(mesh, u_B, angles_of_scale(surface, u_B))
        x_B, y = f_B.real, np.zeros(len(mesh.scaled))
        y[mesh.loop] = (np.roll(x_B, 1) - np.roll(x_B, -1)) / 2  # the flux of the conjugate
        f = harmonic_extension(surface, x_B.astype(complex))
        return checked_free_map(mesh, f.real + 1j * but_one.solve(y))
    for _ in range(ROUNDS):
        lengths = edge_lengths(mesh) * np.exp(edge_means(u_B))
        dual = lengths + np.roll(lengths, 1)
        angles = 2 * np.pi * dual / dual.sum()
        u_B = scale_of_angles(but_one, angles)
    return checked_free_map(mesh, harmonic_extension(surface, closed_curve(mesh, u_B, angles)))


@takes_meshes
@like(lscm)
def abf(V: ArrayLike, F: ArrayLike, *, linear: bool = False) -> Floats:
    """Map a triangulated disk to the plane with the corner angles nearest to its own (ABF).

    The boundary is free. Angles a minimise the sum of ((a - b) / b)^2, b those of the surface,
    scaled to 2 pi around interior vertices. They are subject to what holds in the plane: the
    angles of a triangle add up to pi, those around an interior vertex to 2 pi, and the lengths
    close around it: the logarithms of the sines of the angles that follow and precede it add up to
    the same. Newton's method leaves out the curvature of the constraints, as ABF++ does, and with
    the logarithms of Zayer et al. its first step is their linear ABF.

    The map may overlap itself. To be compared on angles only. MapError if an angle is not positive,
    or the constraints are not satisfied after 50 steps.

    Parameters
    ----------
    linear : bool
        Whether to take the first step only: the angles are those of a plane mesh to first order,
        and the map has them as nearly as it can.

    References
    ----------
    A. Sheffer, B. Lévy, M. Mogilnitsky, A. Bogomyakov. ABF++: fast and robust angle based
    flattening. ACM Trans. Graph. 24(2), 2005.

    R. Zayer, B. Lévy, H.-P. Seidel. Linear angle based parameterization. Symposium on Geometry
    Processing, 2007.
    """
    mesh = DiskMesh(V, F)
    m, nI = len(mesh.F), len(mesh.interior)
    inside = ~mesh.on_boundary[mesh.F]
    vertex = places(mesh.interior, len(mesh.scaled))[mesh.F[inside]]
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
        if abs(lack).max() < ANGLE_TOLERANCE or (linear and step):
            return checked_free_map(mesh, least_squares_layout(mesh, a.reshape(m, 3)))
        J = vstack([in_triangle, around, (after - before) @ diags(1 / np.tan(a))])
        multipliers = factorize(J @ diags(b**2) @ J.T).solve(J @ (a - b) - lack)
        a = b + b**2 * (J.T @ multipliers)
    raise MapError(f"Angle-based flattening: no plane mesh after {MAX_STEPS} steps")


def least_squares_layout(mesh: Mesh, angles: Floats) -> Complex:
    """Lay faces with other angles (m, 3) out in the plane (n,), as nearly as they fit together.

    As `lscm`, two far boundary vertices lie at 0 and 1.
    """
    a, b = _two_far_vertices(mesh)
    n = len(mesh.scaled)
    pinned = Dirichlet(conformal_energy(mesh, 1 / np.tan(angles)), np.array([a, b, a + n, b + n]))
    u, v = pinned.solve(np.array([0, 1, 0, 0])).real.reshape(2, n)
    return u + 1j * v


def conformal_energy(mesh: Mesh, cotangents: Floats) -> csr_matrix:
    """(2n, 2n) matrix of twice the Dirichlet energy minus the area, of vectors [u; v].

    The cotangents (m, 3) of the corners may be those of another metric.
    """
    L = cotangent_laplacian(mesh, cotangents).matrix()
    return (block_diag([L, L]) - 2 * libigl.vector_area_matrix(mesh.F)).tocsr()
