"""What a descent lowers: errors of angles in the p-norm, or the shear and scale of every face.

An energy measures a map, and expands it to second order in displacements of the vertices. A
displacement of the corners of a face is dz = a z + b conj(z) + const in its plane: a scales and
turns, b shears. Both are linear in the displacements, as b = sum beta_v dz_v over the corners v;
only b changes the angles.

`SymmetricDirichlet`: with the singular values s1 >= s2 of a map f on a face, let s = log(s1 / s2)
and q = log(s1 s2). The sum over the faces, by area on the surface, of (e - 1) / k^2 is minimised,

    e = (1 + u (cosh ks - 1)) (1 + v (cosh kq - 1)),   u = min(1, 2 - 2t),  v = min(1, 2t):

t = 0 keeps angles, t = 1/2 lengths, for 4 cosh s cosh q = s1^2 + s2^2 + 1/s1^2 + 1/s2^2 is the
symmetric Dirichlet energy, and t = 1 areas. It is infinite where a face collapses.

To second order, with p = b conj(f_z f_zbar) / |f_z f_zbar|, as a shear moves f_zbar / f_z by a
translation of the hyperbolic plane,

    ds = 2 Re p + 2 coth(s) (Im p)^2 - 2 Re a Re p + 2 Im a Im p,   dq = 2 Re a - Re a^2 - |b|^2.

So the Hessian falls into two blocks a face, for (Re a, Re p) and (Im a, Im p). e is convex in
(s, q): far from the minimum the terms that are always positive are taken, near it the whole, its
negative eigenvalues at 0.

References
----------
K. Hormann, G. Greiner. MIPS: an efficient global parametrization method. Curve and Surface Design,
1999: t = 0.

J. Smith, S. Schaefer. Bijective parameterization with free boundaries. ACM Trans. Graph. 34(4),
2015: t = 1/2, and steps that end before the first face collapses.

P. W. Holland, R. E. Welsch. Robust regression using iteratively reweighted least-squares.
Communications in Statistics 6(9), 1977: angles.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix

from ..arrays import Complex, Floats, Ints
from ..surface.mesh import Mesh
from ..surface.triangles import blocks, face_areas
from ..verdict.distortion import wirtinger_derivative
from .targets import DISK, PLANE, Disk, Flipped, Target

ROUNDING = np.radians(0.1)  # below this angle |r|^p is rounded off to a parabola
SOFT = 0.1  # of k, at first: a step for cosh(kx) shortens x by 1 / k at most
CROWDED = 100.0  # a map of so much energy has parts that are far too small
# A face with all corners on the circle has the shape that this gives it, and counts little.
INSCRIBED = 0.01
HALF = 0.5  # t at which shape and size count alike


class Measured(NamedTuple):
    """A map (n,) with its energy, and its angle errors (m, 3) where the energy needs them."""

    f: Complex
    value: float
    errors: Floats


def shear_matrix(beta: Complex, F: Ints, n: int) -> csr_matrix:
    """Return the matrix (m, n) that takes displacements of vertices to shears of faces."""
    rows = np.arange(0, 3 * len(F) + 1, 3)
    return csr_matrix((beta.ravel(), F.ravel(), rows), (len(F), n))


@dataclass(frozen=True, eq=False)
class Angles:
    """The power mean of the angle errors of all corners, with exponent p, on a target.

    A face whose corner has the edges e_j, e_k turns them by Im(a + b conj(e) / e), hence

        dr_c = Im(b g_c),  g_c = conj(e_k) / e_k - conj(e_j) / e_j.

    Gauss-Newton with iteratively reweighted least squares lowers sum w (r + dr)^2, w = |r|^(p-2).

    Attributes
    ----------
    norm : float
        The exponent p, from 1 to 2.
    is_near : bool
        Whether the map is near the conformal one: then most steps need no factor.
    """

    mesh: Mesh
    target: Target
    norm: float
    is_near: bool = False

    is_barrier: ClassVar[bool] = False  # a face may collapse

    def measured(self, f: Complex, flipped: Flipped) -> Measured:
        """Measure a map f (n,): in degrees, errors rounded off at 0.1 degree."""
        r = self.target.errors(self.mesh, f, flipped)
        mean = ((r * r + ROUNDING**2) ** (self.norm / 2)).mean()
        return Measured(f, float(np.degrees(mean ** (1 / self.norm))), r)

    def quadratic(self, at: Measured, p: float, damping: float) -> Shear:
        """Expand sum w (r + dr)^2, w = |r|^(p-2).

        `damping` is the weight of |b|^2, times that of a corner with the root mean square error: a
        face flips only where |b| is not small, and the angles of a needle hardly feel b.
        """
        f, r, m = at.f, at.errors, len(self.mesh.F)
        beta, s = np.empty((m, 3), complex), np.empty(m)
        t, slope = np.empty((2, m), complex)
        mirrored = None
        for part in blocks(m):
            corner, turn, mirror = self.target.corners(f, self.mesh.F[part])
            e = corner[[2, 0, 1]] - corner[[1, 2, 0]]
            # Times reciprocals, as it takes long to divide complex numbers.
            by_area = 0.5j * (1 / (e[0].conj() * e[1]).imag)
            beta.T[:, part] = turn * e * by_area
            if mirror is not None:
                mirrored = np.empty_like(beta) if mirrored is None else mirrored
                mirrored.T[:, part] = mirror * e * by_area
            q = e.conj()
            q *= q * (1 / (e.real * e.real + e.imag * e.imag))  # conj(e) / e
            g, r_part = q[[1, 2, 0]] - q[[2, 0, 1]], r[part].T
            wg = (r_part * r_part + ROUNDING**2) ** (p / 2 - 1) * g
            s[part] = (wg.real * g.real + wg.imag * g.imag).sum(axis=0) / 2
            t[part] = (wg * g).sum(axis=0) / -2
            slope[part] = 1j * (r_part * wg).sum(axis=0).conj()
        if damping:
            s += damping * (r * r).mean() ** (p / 2 - 1)
        B = shear_matrix(beta, self.mesh.F, len(f))
        C = None if mirrored is None else shear_matrix(mirrored, self.mesh.F, len(f))
        return Shear(beta, B, B.conj().T, C, s, t, slope)


@dataclass(frozen=True, eq=False)
class Shear:
    """An energy of the shear b of every face alone, near a map.

    b = B dz + C conj(dz), with C where the target is not in the plane. The energy changes by the
    sum of Re(conj(slope) b + conj(b) H(b) / 2), with H(b) = s b + conj(t b).
    """

    beta: Complex  # (m, 3) the entries of B
    B: csr_matrix
    B_H: csc_matrix
    C: csr_matrix | None
    s: Floats  # (m,)
    t: Complex  # (m,)
    slope: Complex  # (m,)

    @property
    def weights(self) -> Floats:
        """(m,) weights of the faces in the Laplacian that is nearest to the Hessian."""
        return self.s

    def _adjoint(self, b: Complex) -> Complex:
        x: Complex = self.B_H @ b
        if self.C is not None:
            x += self.C.T @ b.conj()
        return x

    def gradient(self) -> Complex:
        """(n,) the gradient by the displacements of the vertices."""
        return self._adjoint(self.slope)

    def times(self, dz: Complex) -> Complex:
        """(n,) the Hessian times displacements (n,)."""
        b = self.B @ dz
        if self.C is not None:
            b += self.C @ dz.conj()
        turned = self.t * b
        b *= self.s
        b += np.conj(turned, out=turned)
        return self._adjoint(b)


@dataclass(frozen=True, eq=False)
class SymmetricDirichlet:
    """What it costs a map that faces change their shape and their size, see above.

    Attributes
    ----------
    F : (m, 3) int64
    area, weight : (m,) float64
        Of the faces at rest, and how much they count; the weights add up to 1.
    derivative : (2, m) complex128
        See `wirtinger_derivative`, of the faces at rest, but for the first corner: they add up
        to 0.
    t, k : (m,) float64
        What each face keeps, and how steeply the cost grows.
    """

    F: Ints
    area: Floats
    weight: Floats
    derivative: Complex
    t: Floats
    k: Floats

    is_barrier: ClassVar[bool] = True  # infinite where a face collapses

    def measured(self, f: Complex, flipped: Flipped) -> Measured:
        """Measure a map f (n,) without flipped faces."""
        return Measured(f, self.value(f), np.empty((0, 3)))

    @classmethod
    def of(cls, mesh: Mesh, t: float, k: float = 1.0, target: Target = PLANE) -> SymmetricDirichlet:
        """Let a surface keep t; on the disk, in the size that has the area of the disk."""
        F, area = mesh.F, face_areas(mesh.scaled, mesh.F)
        derivative = np.ascontiguousarray(wirtinger_derivative(mesh.scaled, F)[:, 1:].T)
        weight, t_of, k_of = area / area.sum(), *(np.broadcast_to(float(x), len(F)) for x in (t, k))
        if isinstance(target, Disk):
            scale = np.pi / area.sum()
            area, derivative = scale * area, derivative / np.sqrt(scale)
            weight[mesh.inscribed] *= INSCRIBED
            k_of = k_of.copy()
            k_of[mesh.inscribed] *= SOFT
        return cls(F, area, weight, derivative, t_of, k_of)

    @property
    def softened(self) -> SymmetricDirichlet:
        """The energy that goes first."""
        return replace(self, t=np.minimum(self.t, HALF), k=SOFT * self.k)

    def joined(self, other: SymmetricDirichlet, share: float) -> SymmetricDirichlet:
        """Return the energy of these faces and of others, which together have this weight."""
        arrays = {name: [x, vars(other)[name]] for name, x in vars(self).items()}
        arrays["weight"][1] = np.full(len(other.F), share / len(other.F))
        return SymmetricDirichlet(
            **{
                name: np.concatenate(both, axis=-1 if name == "derivative" else 0)
                for name, both in arrays.items()
            }
        )

    def value(self, f: Complex) -> float:
        """Sum up the energy of a map (n,) without flipped faces."""
        total = 0.0
        with np.errstate(over="ignore", invalid="ignore"):
            for part in blocks(len(self.F)):
                s, q, _ = self.stretch(f, part)
                (S, *_), (Q, *_) = self._factors(s, q, part)
                total += float((self.weight[part] / self.k[part] ** 2) @ (S + Q + S * Q))
        return total

    def is_crowded(self, f: Complex) -> bool:
        """Whether it is so much that parts of the map are far too small."""
        return not self.value(f) <= CROWDED  # nor NaN

    def stretch(self, f: Complex, part: slice) -> tuple[Floats, Floats, Complex]:
        """Compute s, q and f_z f_zbar, (k,), of some faces of a map (n,)."""
        z = f.take(self.F[part].T)
        (x, y), (one, other) = z[1:] - z[0], self.derivative[:, part]
        f_z, f_zbar = one * x + other * y, one.conj() * x + other.conj() * y
        area = np.maximum((x.conj() * y).imag / 2, np.finfo(float).tiny)
        q = np.log(area / self.area[part])
        return np.maximum(2 * np.log(abs(f_z) + abs(f_zbar)) - q, 0), q, f_z * f_zbar

    def _factors(self, s: Floats, q: Floats, part: slice) -> tuple[list[Floats], list[Floats]]:
        """Compute both factors of e, less 1, with their derivatives by s, and by q."""
        t, k = self.t[part], self.k[part]
        return _grown(np.minimum(1, 2 - 2 * t), k, s), _grown(np.minimum(1, 2 * t), k, q)

    def quadratic(self, f: Complex, *, whole: bool) -> ShearAndScale:
        """Expand the energy at a map (n,); the `whole` Hessian, or what is always positive."""
        m = len(self.F)
        beta, turn = np.empty((m, 3), complex), np.empty(m, complex)
        slope, real, imaginary = np.empty((2, m)), np.empty((3, m)), np.zeros((3, m))
        for part in blocks(m):
            i, j, k = f.take(self.F[part].T)
            e = np.array([k - j, i - k, j - i])
            beta.T[:, part] = e * (0.5j / (e[0].conj() * e[1]).imag)
            s, q, product = self.stretch(f, part)
            size = abs(product)
            ones = np.ones_like(product)
            turn[part] = np.divide(product.conj(), size, out=ones, where=size > 0)
            (S, S_s, S_ss), (Q, Q_q, Q_qq) = self._factors(s, q, part)
            w = self.weight[part] / self.k[part] ** 2
            e_s, e_q, e_sq = w * (1 + Q) * S_s, w * (1 + S) * Q_q, w * S_s * Q_q
            e_ss, e_qq = w * (1 + Q) * S_ss, w * (1 + S) * Q_qq
            across = np.divide(e_s, np.tanh(s), out=e_ss.copy(), where=s > 1e-6)
            slope[:, part] = 2 * e_q, 2 * e_s
            if whole:
                real[:, part] = _clamped(4 * e_qq - 2 * e_q, 4 * e_ss - 2 * e_q, 4 * e_sq - 2 * e_s)
                imaginary[:, part] = _clamped(2 * e_q, 4 * across - 2 * e_q, 2 * e_s)
            else:
                real[:, part] = 4 * e_qq, 4 * e_ss, 0 * e_ss
                imaginary[1, part] = 4 * across
        B = shear_matrix(beta, self.F, len(f))
        return ShearAndScale(beta, B, B.T, turn, slope, real, imaginary)


def _grown(w: Floats, k: Floats, x: Floats) -> list[Floats]:
    """Compute w (cosh kx - 1) with its derivatives, by one exponential."""
    e = np.expm1(k * abs(x))
    less = e / (1 + e)  # 1 - exp(-k|x|)
    more, slope = e * less / 2, np.copysign(e + less, x) / 2
    return [w * more, w * k * slope, w * k**2 * (1 + more)]


def _clamped(x: Floats, y: Floats, c: Floats) -> tuple[Floats, Floats, Floats]:
    """Take the negative eigenvalues of symmetric matrices [[x, c], [c, y]] for 0."""
    middle, half = (x + y) / 2, (x - y) / 2
    radius = np.hypot(half, c)
    high, low = np.maximum(middle + radius, 0), np.maximum(middle - radius, 0)
    mean, part = (high + low) / 2, (high - low) / (2 * np.where(radius > 0, radius, 1))
    return mean + part * half, mean - part * half, part * c


@dataclass(frozen=True, eq=False)
class ShearAndScale:
    """An energy near a map: its slope, and two symmetric blocks a face.

    p = turn B dz, and a = conj(B) dz. The blocks [[x, c], [c, y]], rows of (3, m), are
    for (Re a, Re p) and (Im a, Im p).
    """

    beta: Complex  # (m, 3) the entries of B
    B: csr_matrix
    B_T: csc_matrix
    turn: Complex  # (m,)
    slope: Floats  # (2, m) along Re a and Re p
    real: Floats
    imaginary: Floats

    @property
    def weights(self) -> Floats:
        """(m,) weights of the faces in the nearest Laplacian: means of the blocks."""
        weights: Floats = (self.real[:2].sum(axis=0) + self.imaginary[:2].sum(axis=0)) / 2
        return weights

    def _back(self, a: Complex, p: Complex) -> Complex:
        x: Complex = self.B_T @ a
        np.conj(p, out=p)
        p *= self.turn
        x += (self.B_T @ p).conj()
        return x

    def gradient(self) -> Complex:
        """(n,) the gradient by the displacements of the vertices."""
        return self._back(*self.slope.astype(complex))

    def times(self, dz: Complex) -> Complex:
        """(n,) the Hessian times displacements (n,)."""
        a, p = self.B @ dz.conj(), self.B @ dz
        for part in blocks(len(a)):
            (x, y, c), (X, Y, C) = self.real[:, part], self.imaginary[:, part]
            u, v = a[part].conj(), self.turn[part] * p[part]
            a.real[part], a.imag[part] = x * u.real + c * v.real, X * u.imag + C * v.imag
            p.real[part], p.imag[part] = c * u.real + y * v.real, C * u.imag + Y * v.imag
        return self._back(a, p)


def resized(energy: SymmetricDirichlet, f: Complex) -> Complex:
    """Scale a map (n,) so that its sum of cosh(s) cosh(q), by area, is least."""
    shrink = grow = 0.0
    for part in blocks(len(energy.F)):
        s, q, _ = energy.stretch(f, part)
        weight = energy.weight[part] * np.cosh(s)
        shrink += float(weight @ np.exp(-q))
        grow += float(weight @ np.exp(q))
    return f * (shrink / grow) ** 0.25


def mean_squared_log_dilatation(mesh: Mesh) -> SymmetricDirichlet:
    """Return the energy that takes a Tutte embedding to where refinement can go on.

    It is that of t = 0 with a small k: to second order the mean of s^2, the squared hyperbolic
    distances of the shapes of the faces from those on the surface. It does not depend on scale: all
    faces count the same, whose sizes may range over many powers of ten.
    """
    weight = np.full(len(mesh.F), 1 / len(mesh.F))
    weight[mesh.inscribed] *= INSCRIBED
    return replace(SymmetricDirichlet.of(mesh, 0.0, target=DISK), weight=weight).softened


Energy = Angles | SymmetricDirichlet
Quadratic = Shear | ShearAndScale
