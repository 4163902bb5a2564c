"""The Möbius transformation of least angular distortion, eq. (20): which point goes to 0."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..arrays import Complex, Floats, Ints, evenly_spaced_rows
from ..verdict.distortion import angles_between, plane_angles

# Faces on which Newton's method judges w: one in 32, but some 5,000 at least. Of 102 surfaces with
# 2,600 to 230,000 faces, w is that of all faces on 100, and on none it costs more than it may.
# Where a surface is rough, the errors of finer faces are as large and what psi_w changes is
# smaller: by a fixed number of faces, their errors and not their changes would choose w.
MANY_FACES, SHARE = 5_000, 32
SOFT = 0.2  # corner of the pseudo-Huber function, by the median residual
# That for w: with a narrower one, the noise of single faces has minima of its own.
SOFT_FOR_W = 1.0
MAX_STEPS = 30
LAST = 2e-3  # a step of w by the corner after which none is needed: convergence is quadratic
NEGLIGIBLE = 1e-8  # steps of w below this change the objective by its last digits only
SINGULAR = 1e-14  # determinant of a Hessian by its squared size, without a minimum


def least_angle_distortion(errors: AngleErrors) -> complex:
    """Find w that minimises the angular distortion of psi_w o f, eq. (20), by Newton.

    The sum of absolute values is replaced by a pseudo-Huber function.
    """
    w, best = 0j, errors.value(0j)
    for _ in range(MAX_STEPS):
        gradient, mean, rest = errors.derivatives(w)
        determinant = mean * mean - abs(rest) ** 2
        if not determinant > SINGULAR * mean * mean:
            break
        step = (rest * gradient.conjugate() - mean * gradient) / determinant
        # In hyperbolic length: the objective bends at its corner.
        if abs(step) < LAST * errors.corner * (1 - abs(w) ** 2) and abs(w + step) < 1:
            return w + step
        step, best = _backtrack(errors.value, w, step, best)
        if step == 0:
            break
        w += step
    return w


def faces_to_judge_by(m: int) -> Ints:
    """Rows of the faces, of m, on which w is judged."""
    return evenly_spaced_rows(m, max(MANY_FACES, m // SHARE))


class AngleErrors:
    """Angle errors of psi_w o f as functions of w, on some of the faces.

    They are those of f and their change, which is exact, also in faces that are as good as
    collapsed, whose angles are rounding errors. x and y (3, k) are the corners of the faces under
    f: row by row, a corner of all faces, in real numbers, takes half the time of complex columns.
    The `errors` (3, k) are those of f, in radians, as is the `corner` of the pseudo-Huber function.
    """

    def __init__(self, x: Floats, y: Floats, errors: Floats) -> None:
        self._x, self._y, self._errors = x, y, errors
        self.corner = pseudo_huber_corner(errors, SOFT_FOR_W)
        self._last = 0j, errors / self.corner

    @classmethod
    def of(cls, F: Ints, z: Complex, angles: Floats) -> AngleErrors:
        """Take faces F of the map z (n,); `angles` (m, 3) are those on the surface."""
        corners = z.take(F.T)
        errors = angles_between(*corners) - angles.T
        return cls(corners.real.copy(), corners.imag.copy(), errors)

    def mean(self, w: complex) -> float:
        """Mean of the absolute errors in radians."""
        return float(abs(self._residuals(w)).mean()) * self.corner

    def value(self, w: complex) -> float:
        """Pseudo-Huber function of the errors."""
        r = self._residuals(w)
        return float(np.sqrt(r * r + 1).sum())

    def derivatives(self, w: complex) -> tuple[complex, float, complex]:
        """Gradient g, and a, b of the Hessian, which takes a step d to a d + b conj(d).

        Far from the minimum, the Hessian is that of Gauss and Newton.
        """
        r, (c, s) = self._residuals(w), self._below(w)
        # a = Im log(1 - conj(w) z) is harmonic in w = x + iy: with g = -z / (1 - conj(w) z),
        # a_x = Im g, a_y = -Re g, a_xx = -a_yy = -Im g^2, a_xy = Re g^2.
        square = c * c + s * s
        re, im = -(self._x * c + self._y * s) / square, (self._x * s - self._y * c) / square
        square = r * r + 1
        root = np.sqrt(square)
        # Summed by parts: the sum of first times differences of h is minus that of this times h.
        back = _differences(r / root)
        weight = square * root * self.corner
        d_re, d_im = _differences(re), _differences(im)
        weighted = d_im / weight
        xx, xy, yy = _sum(weighted, d_im), -_sum(weighted, d_re), _sum(d_re / weight, d_re)
        b_re, b_im = back * re, back * im
        gradient = complex(-b_im.sum(), b_re.sum())
        mean, rest = (xx + yy) / 2, complex((xx - yy) / 2, xy)
        curved = rest + complex(2 * _sum(b_re, im), _sum(b_im, im) - _sum(b_re, re))
        return gradient, mean, curved if abs(curved) < mean else rest

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


def pseudo_huber_corner(errors: Floats, soft: float = SOFT) -> float:
    """Choose the error at which the pseudo-Huber function turns from a parabola to a line."""
    size, middle = abs(errors).ravel(), errors.size // 2
    median = float(np.partition(size, middle)[middle])  # in a third of the time of np.median
    return max(soft * median, np.finfo(float).eps)


def angle_change(F: Ints, z: Complex, w: complex) -> Floats:
    """(m, 3) exact change of every corner angle under psi_w, in radians.

    The angle at corner i of a face [i, j, k] grows by a_j - a_k, a = arg(1 - conj(w) z):
    one argument a vertex replaces three angles a face.
    """
    return _differences(np.angle(1 - np.conj(w) * z)[F].T).T


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
    while abs(step) > NEGLIGIBLE:
        if abs(w + step) < 1 and (trial := value(w + step)) < best:
            return step, trial
        step /= 2
    return 0j, best
