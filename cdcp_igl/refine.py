"""Refinement beyond the harmonic map: reweighted Gauss-Newton on the corner angles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix

from .arrays import Complex, Floats
from .cholmod import Cholesky
from .distortion import plane_angles
from .injectivity import flipped_faces
from .mesh import DiskMesh

__all__ = ["Refinement", "gauss_newton_step", "refine"]

ROUNDING = np.radians(0.1)  # below this angle |r|^p is rounded off to a parabola
CG_ITERATIONS = 3  # leave a relative residual of about 0.1
DAMPINGS = (0, 1, 10, 100)  # times the mean weight of a corner; the last is the last attempt
SHIFT = 1e-10  # of the diagonal: keeps rounding from an indefinite matrix


@dataclass(frozen=True)
class Refinement:
    """What was done to lower the angular distortion beyond that of the harmonic map.

    Attributes
    ----------
    asked : int
        Steps that were asked for.
    steps : int
        Steps that were taken; fewer when no further step was an improvement.
    norm : float
        The exponent p.
    before, after : float
        The objective in degrees: the power mean, with exponent p, of the angle errors of
        all corners, each at least 0.1 degree.
    """

    asked: int = 0
    steps: int = 0
    norm: float = np.nan
    before: float = np.nan
    after: float = np.nan

    def __str__(self) -> str:
        if self.asked == 0:
            return "not asked for"
        if self.steps == 0:
            return "no improvement"
        return (
            f"{self.steps} of {self.asked} steps, angle errors in the {self.norm:g}-norm "
            f"from {self.before:.4f} to {self.after:.4f} degrees"
        )


def refine(
    mesh: DiskMesh, f: Complex, steps: int, norm: float, advance: Callable[[float], None]
) -> tuple[Complex, Refinement]:
    """Lower the sum of |angle error|^p over all corners by moving the interior vertices.

    Gauss-Newton with iteratively reweighted least squares. The first step has the weights
    of p = 2, which brings the large errors down. A step that flips a face or does not lower
    the objective is computed again with Levenberg-Marquardt damping of the shear of every
    face; when the strongest damping does not help, the refinement ends.

    Parameters
    ----------
    mesh : DiskMesh
    f : (n,) complex128
        Map onto the disk without flipped faces. With flipped faces nothing is done.
    steps : int
        At least 0.
    norm : float
        The exponent p, from 1 to 2.
    advance : callable
        Called with the share of the steps that is done, before each.

    Returns
    -------
    f : (n,) complex128
        The argument itself if no step was an improvement. The boundary stays.
    Refinement

    Raises
    ------
    SolverError
        If memory runs out.

    References
    ----------
    P. W. Holland, R. E. Welsch. Robust regression using iteratively reweighted
    least-squares. Communications in Statistics 6(9), 1977.
    """
    if steps == 0:
        return f, Refinement()
    r = plane_angles(f, mesh.F) - mesh.angles
    before = objective = _power_mean(r, norm)
    taken, strength = 0, 0
    preconditioner = _Preconditioner(mesh) if len(mesh.interior) else None
    while preconditioner and taken < steps and strength < len(DAMPINGS):
        advance(taken / steps)
        p = norm if taken else 2
        trial = f + gauss_newton_step(mesh, f, r, p, DAMPINGS[strength], preconditioner)
        r_trial = plane_angles(trial, mesh.F) - mesh.angles
        value = _power_mean(r_trial, norm)
        if value < objective and not len(flipped_faces(_columns(trial), mesh.F)[0]):
            f, r, objective = trial, r_trial, value
            taken, strength = taken + 1, max(strength - 1, 0)
        else:
            strength += 1
    return f, Refinement(steps, taken, norm, before, objective)


def gauss_newton_step(
    mesh: DiskMesh,
    f: Complex,
    r: Floats,
    p: float,
    damping: float,
    preconditioner: _Preconditioner,
    iterations: int = CG_ITERATIONS,
) -> Complex:
    """Find the displacement that lowers sum w (r + dr)^2, w = |r|^(p-2), by CG.

    A displacement of the corners of a plane face is dz = a z + b conj(z) + const, and only
    the shear b = sum beta_v dz_v, linear in the displacements, changes the angles:
    the direction of an edge e turns by Im(da + b conj(e) / e), hence

        dr_c = Im(b g_c),  g_c = conj(e_k) / e_k - conj(e_j) / e_j

    with e_j, e_k the edges at corner c. With the complex numbers b = B dz of all faces, the
    normal equations are B^H H B dz = -B^H sum_c w_c r_c i conj(g_c), where
    H(b) = (s + damping) b + conj(t b), s = sum_c w_c |g_c|^2 / 2, t = -sum_c w_c g_c^2 / 2.

    Parameters
    ----------
    mesh : DiskMesh
    f : (n,) complex128
    r : (m, 3) float64
        Errors of the corner angles in radians.
    p : float
    damping : float
        Weight of |b|^2, times the mean of w.
    preconditioner : _Preconditioner
    iterations : int

    Returns
    -------
    (n,) complex128
        Zero on the boundary.
    """
    corner = f[mesh.F]
    e = np.roll(corner, -2, axis=1) - np.roll(corner, -1, axis=1)  # opposite the corner
    twice_area = (e[:, 0].conj() * e[:, 1]).imag
    # Half the gradient of the hat function, which grows at right angles to the edge.
    beta = 1j * e / (2 * twice_area[:, None])
    q = e.conj() / e
    g = np.roll(q, -1, axis=1) - np.roll(q, -2, axis=1)
    w = (r * r + ROUNDING**2) ** (p / 2 - 1)
    s = (w * abs(g) ** 2).sum(axis=1) / 2 + damping * w.mean()
    t = -(w * g * g).sum(axis=1) / 2
    B = _shear(mesh, beta)

    def adjoint(b: Complex) -> Complex:
        x = (B.T @ b.conj()).conj()
        x[mesh.loop] = 0
        return x

    def normal_matrix(x: Complex) -> Complex:
        b = B @ x
        return adjoint(s * b + (t * b).conj())

    preconditioner.factor(beta, s)
    return _conjugate_gradients(
        normal_matrix, -adjoint((w * r * 1j * g.conj()).sum(axis=1)), preconditioner, iterations
    )


def _shear(mesh: DiskMesh, beta: Complex) -> csr_matrix:
    """(m, n) matrix of b = sum beta_v dz_v."""
    m, n = len(mesh.F), len(mesh.V)
    return csr_matrix((beta.ravel(), mesh.F.ravel(), np.arange(0, 3 * m + 1, 3)), (m, n))


def _conjugate_gradients(
    A: Callable[[Complex], Complex],
    b: Complex,
    preconditioner: Callable[[Complex], Complex],
    iterations: int,
) -> Complex:
    """Lower x^T A x / 2 - x^T b from x = 0, inner product Re x^H y (A is real-linear)."""
    x, residual = np.zeros_like(b), b
    direction, rho = np.zeros_like(b), 1.0
    for _ in range(iterations):
        z = preconditioner(residual)
        rho, last = np.vdot(residual, z).real, rho
        direction = z + rho / last * direction
        image = A(direction)
        alpha = rho / np.vdot(direction, image).real
        x = x + alpha * direction
        residual = residual - alpha * image
    return x


class _Preconditioner:
    """The interior block of the Laplacian with face weights s, factored.

    B^H diag(s) B is the normal matrix without its second, conjugate-linear term. Its real
    part is the Laplacian sum_f s / 4 grad.grad of the plane triangles, one matrix for both
    coordinates.

    Parameters
    ----------
    mesh : DiskMesh
        Has interior vertices.
    """

    def __init__(self, mesh: DiskMesh) -> None:
        self._interior = mesh.interior
        k = len(mesh.interior)
        place = np.full(len(mesh.V), -1)
        place[mesh.interior] = np.arange(k)
        corner = place[mesh.F]
        row, column = np.repeat(corner, 3, axis=1).ravel(), np.tile(corner, 3).ravel()
        self._inside = (row >= 0) & (column >= 0)
        row, column = row[self._inside], column[self._inside]
        # Entries that are zero by chance stay in the pattern, so that one symbolic analysis
        # serves all steps.
        self._matrix = csc_matrix((np.ones(len(row)), (row, column)), (k, k))
        number = self._matrix.copy()
        number.data = np.arange(number.nnz)
        self._entry = np.asarray(number[row, column]).ravel()
        self._diagonal = number.diagonal()
        self._cholesky: Cholesky | None = None

    def factor(self, beta: Complex, s: Floats) -> None:
        """Set the weights: beta is (m, 3), s is (m,) and positive."""
        products = s[:, None, None] * (beta[:, :, None] * beta[:, None, :].conj()).real
        entries = np.bincount(self._entry, products.ravel()[self._inside])
        entries[self._diagonal] *= 1 + SHIFT
        self._matrix.data = entries
        if self._cholesky is None:
            self._cholesky = Cholesky(self._matrix)
        else:
            self._cholesky.refactor(self._matrix)

    def __call__(self, x: Complex) -> Complex:
        """Solve in the interior; zero on the boundary."""
        y = np.zeros_like(x)
        solution = self._cholesky.solve(np.array([x[self._interior].real, x[self._interior].imag]).T)
        y[self._interior] = solution[:, 0] + 1j * solution[:, 1]
        return y


def _power_mean(r: Floats, p: float) -> float:
    """(mean |r|^p)^(1/p) in degrees, rounded off at 0.1 degree."""
    return float(np.degrees(((r * r + ROUNDING**2) ** (p / 2)).mean() ** (1 / p)))


def _columns(f: Complex) -> Floats:
    return np.column_stack([f.real, f.imag])
