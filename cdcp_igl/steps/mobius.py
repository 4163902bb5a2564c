"""Möbius transformations of the disk: least angular distortion, eqs. (19)-(20), or area."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..arrays import Complex, Floats, Ints, spread_evenly
from ..certificate import flipped_faces, is_around
from ..distortion import corner_angles, plane_angles
from ..surface.mesh import DiskMesh
from .alignment import at_one, vertex_areas

__all__ = [
    "AngleErrors",
    "MobiusMethod",
    "Normalization",
    "angle_change",
    "composed",
    "conformal_barycenter",
    "least_angle_distortion",
    "least_angle_distortion_nelder_mead",
    "mobius_transformation",
    "normalize",
]

MobiusMethod = Literal["angle", "area", "nelder-mead"]


# Faces on which Newton's method looks: few at first, to come near. On 13 scans, the mean
# angular distortion with 10,000 is within 1e-4 degrees of that with all faces.
FEW_FACES, MANY_FACES = 2_000, 10_000
SOFT = 0.2  # corner of the pseudo-Huber function, by the median residual
MAX_STEPS = 30
HALVINGS = 10  # of w, until no face is turned over
TOLERANCE = 1e-8  # steps of w below this change the objective by its last digits only
NEAR = 1e-2  # the minimum on few faces is no nearer to that on many


@dataclass(frozen=True)
class Normalization:
    """The Möbius transformation that was applied.

    Attributes
    ----------
    method : str
        What chose it: ``"angle"``, ``"nelder-mead"``, ``"area"`` or ``"none"``.
    w : complex
        The point that went to 0, eq. (19); 0 where nothing was applied. With ``"none"`` too, if
        a part of the surface was too small for double precision anywhere else.
    rejected : str
        Why the method's result was not used; empty where it was.
    """

    method: str
    w: complex
    rejected: str = ""

    def __str__(self) -> str:
        note = f" (rejected: {self.rejected})" if self.rejected else ""
        moved = f", moves a point w to the centre, |w| = {abs(self.w):.4f}" if self.w else ""
        return f"{self.method}{moved}{note}"


def normalize(
    mesh: DiskMesh,
    f: Complex,
    method: MobiusMethod | None,
    finished: Callable[[Complex, complex], Complex] = lambda f, w: f,
) -> tuple[Complex, Normalization]:
    """Apply the best Möbius transformation that does no harm.

    psi_w turns a face over exactly when 1 / conj(w) lies in its circumdisk. A transformation
    that does so, or that crowds the boundary beyond double precision, is halved until it does
    not: what can be gained on the way is gained. It is not applied where it does not lower
    the angular distortion.

    Parameters
    ----------
    mesh : DiskMesh
    f : (n,) complex128
        Map onto the unit disk, first boundary vertex at 1.
    method : {"angle", "nelder-mead", "area"} or None
        Least angular distortion by Newton or by Nelder-Mead; conformal barycentre; none.
    finished : callable
        What is done to the map after psi_w, given w, before its faces count as turned over.

    Returns
    -------
    f : (n,) complex128
        The transformed map, finished, boundary on the unit circle.
    Normalization
    """
    if method is None:
        return finished(f, 0j), Normalization("none", 0j)
    errors = AngleErrors.of(mesh.F, f, mesh.angles)
    before = errors.mean(0j)
    if method == "angle":
        w = 0j
        if len(mesh.F) > FEW_FACES:
            w = least_angle_distortion(errors.on_fewer(FEW_FACES), tolerance=NEAR)
        w = least_angle_distortion(errors, w)
    elif method == "nelder-mead":
        w = least_angle_distortion_nelder_mead(mesh.F, f, mesh.angles)
    else:
        w = conformal_barycenter(f, vertex_areas(mesh))

    allowed: Ints | None = None  # faces that are turned over anyway
    reason = "no improvement"
    for _ in range(HALVINGS):
        if method != "area" and not errors.mean(w) < before:
            break
        moved = at_one(mesh, mobius_transformation(f, w), mesh.loop[0])
        if is_around(moved[mesh.loop]):
            moved = finished(moved, w)
            turned, _ = flipped_faces(moved, mesh.F)
            if len(turned) and allowed is None:
                allowed, _ = flipped_faces(finished(f, 0j), mesh.F)
            if allowed is None or np.isin(turned, allowed).all():
                return moved, Normalization(method, w)
            reason = "flipped faces"
        else:
            reason = "crowding"
        w /= 2
    return finished(f, 0j), Normalization(method, 0j, reason)


def mobius_transformation(z: Complex, w: complex) -> Complex:
    """Apply psi_w(z) = (z - w) / (1 - conj(w) z), eq. (19): the disk onto itself, w to 0."""
    return (z - w) / (1 - np.conj(w) * z)


def composed(first: complex, w: complex) -> complex:
    """Find the point that goes to 0 when psi_first comes before psi_w."""
    return (w + first) / (1 + first.conjugate() * w)


def angle_change(F: Ints, z: Complex, w: complex) -> Floats:
    """(m, 3) exact change of every corner angle under psi_w, in radians.

    The angle at corner i of a face [i, j, k] grows by a_j - a_k, a = arg(1 - conj(w) z):
    one argument a vertex replaces three angles a face.
    """
    return _differences(np.angle(1 - np.conj(w) * z)[F].T).T


def least_angle_distortion(
    errors: AngleErrors, w: complex = 0j, tolerance: float = TOLERANCE
) -> complex:
    """Find w that minimises the angular distortion of psi_w o f, eq. (20), by Newton.

    The sum of absolute values is replaced by a pseudo-Huber function.

    Parameters
    ----------
    errors : AngleErrors
    w : complex
        Where to start.
    tolerance : float
        How near to the minimum to come.

    Returns
    -------
    complex
        |w| < 1.
    """
    best = errors.value(w)
    for _ in range(MAX_STEPS):
        gradient, hessian = errors.derivatives(w)
        dx, dy = np.linalg.lstsq(hessian, -gradient, rcond=None)[0]
        newton = complex(dx, dy)
        # Convergence is quadratic in hyperbolic length, and the objective bends at its corner.
        length = abs(newton) / (1 - abs(w) ** 2)
        if length**2 < tolerance * errors.corner and abs(w + newton) < 1:
            return w + newton
        step, best = _backtrack(errors.value, w, newton, best)
        if step == 0:
            break
        w += step
    return w


class AngleErrors:
    """Angle errors of psi_w o f as functions of w, on some of the faces.

    They are those of f and their change, which is exact, also in faces that are as good as
    collapsed, whose angles are rounding errors.

    Parameters
    ----------
    x, y : (3, k) float64
        The corners of the faces under f. Row by row, a corner of all faces, in real numbers, takes
        half the time of complex columns.
    errors : (3, k) float64
        The angle errors of f in radians.

    Attributes
    ----------
    corner : float
        Of the pseudo-Huber function, in radians.
    """

    def __init__(self, x: Floats, y: Floats, errors: Floats) -> None:
        self._x, self._y, self._errors = x, y, errors
        self.corner = max(SOFT * float(np.median(abs(errors))), np.finfo(float).eps)
        self._last = 0j, errors / self.corner

    @classmethod
    def of(cls, F: Ints, z: Complex, angles: Floats) -> AngleErrors:
        """Take at most 10,000 of the faces, spread evenly.

        Parameters
        ----------
        F : (m, 3) int64
        z : (n,) complex128
            The map f.
        angles : (m, 3) float64
            Corner angles of the surface in radians.
        """
        faces = spread_evenly(len(F), MANY_FACES)
        corners = z.take(F[faces].T)
        errors = corner_angles(*corners) - angles.T[:, faces]
        return cls(corners.real.copy(), corners.imag.copy(), errors)

    def on_fewer(self, most: int) -> AngleErrors:
        """Take at most so many of these faces, spread evenly."""
        faces = spread_evenly(self._errors.shape[1], most)
        return AngleErrors(self._x[:, faces], self._y[:, faces], self._errors[:, faces])

    def mean(self, w: complex) -> float:
        """Mean of the absolute errors in radians."""
        return float(abs(self._residuals(w)).mean()) * self.corner

    def value(self, w: complex) -> float:
        """Pseudo-Huber function of the errors."""
        r = self._residuals(w)
        return float(np.sqrt(r * r + 1).sum())

    def derivatives(self, w: complex) -> tuple[Floats, Floats]:
        """Gradient (2,) and Hessian (2, 2); far from the minimum, that of Gauss and Newton."""
        r, (c, s) = self._residuals(w), self._below(w)
        # a = Im log(1 - conj(w) z) is harmonic in w = x + iy: with g = -z / (1 - conj(w) z),
        # a_x = Im g, a_y = -Re g, a_xx = -a_yy = -Im g^2, a_xy = Re g^2.
        square = c * c + s * s
        re, im = -(self._x * c + self._y * s) / square, (self._x * s - self._y * c) / square
        root = np.sqrt(r * r + 1)
        first, second = r / root, 1 / (root * root * root * self.corner)
        d_re, d_im = _differences(re), _differences(im)
        xx, yy = _sum(second * d_im, d_im), _sum(second * d_re, d_re)
        xy = -_sum(second * d_im, d_re)
        # Summed by parts: the sum of first times differences of h is minus that of this times h.
        back = _differences(first)
        gradient = np.array([-_sum(back, im), _sum(back, re)])
        cxx, cxy = 2 * _sum(back * re, im), _sum(back, im * im - re * re)
        if xx + yy > 0 and (xx + cxx) * (yy - cxx) > (xy + cxy) ** 2:  # positive definite
            xx, xy, yy = xx + cxx, xy + cxy, yy - cxx
        return gradient, np.array([[xx, xy], [xy, yy]])

    def _residuals(self, w: complex) -> Floats:
        """(3, k) angle errors of psi_w o f by the corner of the pseudo-Huber function."""
        if self._last[0] != w:
            c, s = self._below(w)
            change = _differences(np.arctan2(s, c))
            self._last = w, (self._errors + change) / self.corner
        return self._last[1]

    def _below(self, w: complex) -> tuple[Floats, Floats]:
        """Real and imaginary part (3, k) of 1 - conj(w) z."""
        return 1 - w.real * self._x - w.imag * self._y, w.imag * self._x - w.real * self._y


def _differences(a: Floats) -> Floats:
    """(3, k) a_j - a_k at each corner i of the faces [i, j, k]; row by row a corner."""
    out = np.empty_like(a)
    for i in range(3):
        np.subtract(a[i - 2], a[i - 1], out=out[i])
    return out


def _sum(a: Floats, b: Floats) -> float:
    """Sum of products, which does not depend on the number of threads as that of BLAS does."""
    return float(np.einsum("ij,ij->", a, b))


def _backtrack(
    value: Callable[[complex], float], w: complex, step: complex, best: float
) -> tuple[complex, float]:
    """Halve the step until it stays in the disk and descends; 0 once it is negligible."""
    while abs(step) > TOLERANCE:
        if abs(w + step) < 1 and (trial := value(w + step)) < best:
            return step, trial
        step /= 2
    return 0j, best


def least_angle_distortion_nelder_mead(F: Ints, z: Complex, angles: Floats) -> complex:
    """Find w of eq. (20) as the paper does: Nelder-Mead on the mean over all faces.

    Parameters as of `AngleErrors.of`, return value as of `least_angle_distortion`.
    """
    from scipy.optimize import minimize  # slow to import, and only the paper's preset uses it

    residual = plane_angles(z, F) - angles

    def mean_distortion(x: Floats) -> float:
        w = complex(*x)
        return float(abs(residual + angle_change(F, z, w)).mean()) if abs(w) < 1 else np.inf

    start = np.array([[0.0, 0.0], [0.05, 0.0], [0.0, 0.05]])
    options = {"initial_simplex": start, "xatol": 1e-6, "fatol": 1e-10}
    return complex(*minimize(mean_distortion, start[0], method="Nelder-Mead", options=options).x)


def conformal_barycenter(z: Complex, mass: Floats) -> complex:
    """Find w that puts the centre of mass of psi_w o f at 0, by Newton's method.

    This evens out the area; it is canonical, so that maps of different meshes of one
    surface agree up to a rotation.

    Parameters
    ----------
    z : (n,) complex128
        The map f.
    mass : (n,) float64
        Positive weights, areas on the surface.

    Returns
    -------
    complex
        |w| < 1.

    References
    ----------
    J. Cantarella, H. Schumacher. Computing the conformal barycenter. SIAM J. Appl.
    Algebra Geometry 6(3), 2022.
    """
    mass = mass / mass.sum()
    w = 0j
    for _ in range(MAX_STEPS):
        moved = mobius_transformation(z, w)
        c, q = complex(mass @ moved), complex(mass @ (moved * moved))
        # To first order psi_d moves the centre of mass by -d + q conj(d).
        d = (c + q * c.conjugate()) / max(1 - abs(q) ** 2, np.finfo(float).eps)
        d /= max(1, 2 * abs(d))  # stay well inside the disk
        w = (d + w) / (1 + w.conjugate() * d)  # psi_d o psi_w, up to a rotation
        if abs(d) < 1e-14:
            break
    return w
