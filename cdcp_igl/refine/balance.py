"""Angles, lengths or areas: Newton's method for the shear and the scale of every face.

With the singular values s1 >= s2 of a map f on a face, let s = log(s1 / s2) and q = log(s1 s2). The
sum over the faces, by area on the surface, of (e - 1) / k^2 is minimised,

    e = (1 + u (cosh ks - 1)) (1 + v (cosh kq - 1)),   u = min(1, 2 - 2t),  v = min(1, 2t):

t = 0 keeps angles, t = 1/2 lengths, for 4 cosh s cosh q = s1^2 + s2^2 + 1/s1^2 + 1/s2^2 is the
symmetric Dirichlet energy, and t = 1 areas. It is infinite where a face collapses.

A displacement of the corners of a face is dz = a z + b conj(z) + const in the image: b shears, a
scales and turns. To second order, with p = b conj(f_z f_zbar) / |f_z f_zbar|, as a shear moves
f_zbar / f_z by a translation of the hyperbolic plane,

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
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from operator import length_hint

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix

from ..arrays import Bools, Complex, Floats, Ints
from ..solve.laplacian import Laplacian
from ..solve.ordering import elimination_order
from ..solve.solvers import solver
from ..surface.mesh import Mesh
from ..surface.triangles import blocks, face_areas
from ..verdict.distortion import wirtinger_derivative
from .preconditioning import WeightedLaplacian, conjugate_gradients, dot
from .targets import DISK, PLANE, Disk, Target

# First a part of k, and then some times as much, as a step for cosh(kx) shortens x by 1 / k at
# most; and at t <= 1/2, as above faces could shear at first as much as they like.
SOFT, HARDER, FIRST_STEPS, STEPS = 0.1, 3, 60, 100
MANY = 40  # steps to a minimum: another may be lower
CROWDED = 100.0  # a map of so much energy has parts that are far too small
# A step that gains less than so ends those that are soft or far from the minimum, or all; unless it
# is short, as a face was about to flip: then its gain says nothing.
NEAR, WORTH, SHORT = 0.03, 1e-3, 0.5
# Of an embedding's shear: refinement, in which faces get into the way, takes longer for that.
SHEAR_STEPS, SHEAR_WORTH = 100, 4e-3
# Directions of CG at most, and the share of what all have gained that ends them: roughly or not.
DIRECTIONS, ENOUGH_ROUGHLY, ENOUGH = 12, 1e-2, 1e-3
SPARE = 6  # further directions than with a factor that is new, before another is made
TRIALS, SUFFICIENT = 16, 1e-4  # of the length of a step, which lowers by this share of its slope
SHARE = 0.9  # of the way to the first flip
# A face with all corners on the circle has the shape that this gives it, and counts little.
INSCRIBED = 0.01
# Rounds in which vertices are pulled to where they are told to be, the steps after each, and the
# share of the way to the first flip.
PULLS, PULLED, PULL = 120, 3, 0.6
ISOMETRIC = 1e-20  # of the energy: rounding
HALF = 0.5  # where shape and size count alike


@dataclass(frozen=True, eq=False)
class Energy:
    """What it costs a map that faces change their shape and their size.

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

    @classmethod
    def of(cls, mesh: Mesh, t: float, k: float = 1.0, target: Target = PLANE) -> Energy:
        """Let a surface keep t; on the disk, in the size that has the area of the disk."""
        F, area = mesh.F, face_areas(mesh.V, mesh.F)
        derivative = np.ascontiguousarray(wirtinger_derivative(mesh.V, F)[:, 1:].T)
        weight, t_of, k_of = area / area.sum(), *(np.broadcast_to(float(x), len(F)) for x in (t, k))
        if isinstance(target, Disk):
            scale = np.pi / area.sum()
            area, derivative = scale * area, derivative / np.sqrt(scale)
            weight[mesh.inscribed] *= INSCRIBED
            k_of = k_of.copy()
            k_of[mesh.inscribed] *= SOFT
        return cls(F, area, weight, derivative, t_of, k_of)

    @property
    def softened(self) -> Energy:
        """The energy that goes first."""
        return replace(self, t=np.minimum(self.t, HALF), k=SOFT * self.k)

    def joined(self, other: Energy, share: float) -> Energy:
        """Return the energy of these faces and of others, which together have this weight."""
        arrays = {name: [x, vars(other)[name]] for name, x in vars(self).items()}
        arrays["weight"][1] = np.full(len(other.F), share / len(other.F))
        return Energy(
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

    def quadratic(self, f: Complex, *, whole: bool) -> Quadratic:
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
        rows = np.arange(0, 3 * m + 1, 3)
        B = csr_matrix((beta.ravel(), self.F.ravel(), rows), (m, len(f)))
        return Quadratic(beta, B, B.T, turn, slope, real, imaginary)


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
class Quadratic:
    """The energy near a map: its slope, and two symmetric blocks a face.

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
        """(m,) means of the blocks: those of the Laplacian that is nearest."""
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


class Newton:
    """Newton's method: a map f (n,) of a mesh, what moves of it, and what preconditions it.

    Vertices that are `held` (n,) stay; those of the boundary of a disk slide.

    Attributes
    ----------
    f : (n,) complex128
        The map, without flipped faces; `descend` moves it.
    steps, factors : int
        How many it took.
    done : bool
        Whether the last descent ended with a step that gained little.
    """

    def __init__(
        self, mesh: Mesh, f: Complex, target: Target = PLANE, held: Bools | None = None
    ) -> None:
        self._mesh, self._target, self._held = mesh, target, held
        free = np.ones(len(f), dtype=bool) if held is None else ~held
        if target.slides:
            free &= ~mesh.on_boundary
        pattern = Laplacian.of(
            mesh.edges.low, mesh.edges.high, np.ones(len(mesh.edges.low)), len(f)
        )
        order, ordering, _ = elimination_order(pattern, mesh.V, free, solver())
        self._laplacian = WeightedLaplacian(mesh, order, ordering=ordering)
        self.f, self.steps, self.factors, self.done = f, 0, 0, False

    def lower(self, energy: Energy, *, soft: bool = True) -> float:
        """Go down to the minimum, the `soft` energy first; return the energy there."""
        if soft:
            first = energy.softened
            self.descend(first, FIRST_STEPS, NEAR)
            if energy.is_crowded(self.f):
                self.descend(replace(first, k=HARDER * first.k), FIRST_STEPS, NEAR)
        return self.descend(energy)

    def descend(self, energy: Energy, steps: int = STEPS, worth: float = WORTH) -> float:
        """Go down until a step gains less than a share that is `worth` it."""
        value, whole, anew, failed, least = energy.value(self.f), False, True, False, 0
        self.done = value < ISOMETRIC
        enough = ENOUGH_ROUGHLY if worth > WORTH else ENOUGH
        for _ in range(steps):
            if self.done:
                break
            quadratic = energy.quadratic(self.f, whole=whole)
            if anew:
                self._laplacian.factor(quadratic.beta, quadratic.weights)
                self.factors += 1
            step, slope, used = self._direction(quadratic, enough)
            del quadratic  # before the next one: it is as large as all the rest
            least = used if anew else least
            found = self._search(energy, step, slope, value)
            if found is None:
                if anew and not whole:
                    break
                whole, anew, failed = False, True, True
                continue
            gain, value, length = 1 - found[0] / value, found[0], found[1]
            self.f, self.steps = found[2], self.steps + 1
            self.done = value < ISOMETRIC or (length > SHORT and gain < worth)
            was, near = whole, gain < NEAR
            whole = worth < NEAR and not failed and (whole or near)
            solved = used < min(DIRECTIONS, least + SPARE + 1)
            anew = not (was and whole and near and solved)
        return value

    def pull(self, energy: Energy, rows: Ints, goal: Complex) -> bool:
        """Bring `rows` that are held to their places (k,), as far as no face flips, till they are.

        Between, the rest goes down. False if something of the way is left after all.
        """
        sliding = isinstance(self._target, Disk) & self._mesh.on_boundary[rows]
        for _ in range(PULLS):
            at = self.f[rows]
            way = np.where(sliding, 1j * at * np.angle(goal / np.where(at, at, 1)), goal - at)
            if not way.any():
                break
            prescribed = np.zeros_like(self.f)
            prescribed[rows] = way
            quadratic = energy.quadratic(self.f, whole=False)
            self._laplacian.factor(quadratic.beta, quadratic.weights)
            step = self._laplacian.extended(prescribed)
            length = min(1.0, PULL * way_to_flip(energy.F, self.f, step))
            for _ in range(TRIALS):
                trial = self._target.moved(self._mesh, self.f, length * step)
                if length == 1:
                    trial[rows] = goal
                if len(self._target.flipped(energy.F, trial)[0]) == 0:
                    self.f = trial
                    break
                length /= 2
            if not np.isfinite(energy.value(self.f)):  # for a face is all but flipped
                return False
            self.descend(energy, PULLED)
        else:
            return False
        self.descend(energy)
        return True

    def _direction(self, quadratic: Quadratic, enough: float) -> tuple[Complex, float, int]:
        """Find a direction (n,) by CG, the slope along it, and how often CG took the factor."""
        gradient = self._possible(quadratic.gradient())
        towards = iter([self._laplacian.solve] * DIRECTIONS)
        step = conjugate_gradients(
            lambda dz: self._possible(quadratic.times(dz)),
            *(-gradient, towards, self._possible, enough),
        )
        return step, dot(gradient, step), DIRECTIONS - length_hint(towards)

    def _possible(self, x: Complex) -> Complex:
        x = self._target.tangential(self._mesh, self.f, x)
        if self._held is not None:
            x[self._held] = 0
        return x

    def _search(
        self, energy: Energy, step: Complex, slope: float, value: float
    ) -> tuple[float, float, Complex] | None:
        """Go along a step, back by parabolas or on by doubling: energy, length and map, or None."""
        limit = SHARE * way_to_flip(energy.F, self.f, step)
        length, found = min(1.0, limit), None
        for _ in range(TRIALS):
            trial = self._target.moved(self._mesh, self.f, length * step)
            lowest, lower = 0.5, False  # where the parabola is lowest, by the length
            if len(self._target.flipped(energy.F, trial)[0]) == 0:
                there = energy.value(trial)
                bend = (there - value) / length - slope
                lowest = -slope / (2 * bend) if bend > 0 else 2.0
                lower = there <= value + SUFFICIENT * length * slope
            if found is not None and not (lower and there < found[0]):
                return found
            if lower:
                longer = found is not None and length > found[1]
                found = there, length, trial
                at_end = lowest >= 1.5 and (2 * length > limit or length < 1)
                if 0.75 < lowest < 1.5 or at_end or (lowest <= 0.75 and longer):
                    return found
            length *= 2 if lower and lowest >= 1.5 else min(max(lowest, 0.1), 0.75)
        return found


def way_to_flip(F: Ints, f: Complex, step: Complex) -> float:
    """Find the multiple of a step (n,) at which the first face of a map (n,) has no area."""
    nearest = np.inf
    for part in blocks(len(F)):
        (x, y), (u, v) = (z[1:] - z[0] for z in (f.take(F[part].T), step.take(F[part].T)))
        a, b, c = ((p.conj() * q).imag for p, q in ((u, v), (x, v), (x, y)))
        b += (u.conj() * y).imag
        with np.errstate(all="ignore"):
            root = np.sqrt(b * b - 4 * a * c)  # NaN where the area stays positive
            roots = np.concatenate([2 * c / (-b + root), 2 * c / (-b - root)])
        nearest = min(nearest, roots[roots > 0].min(initial=np.inf))
    return float(nearest)


def resized(energy: Energy, f: Complex) -> Complex:
    """Scale a map (n,) so that its sum of cosh(s) cosh(q), by area, is least."""
    shrink = grow = 0.0
    for part in blocks(len(energy.F)):
        s, q, _ = energy.stretch(f, part)
        weight = energy.weight[part] * np.cosh(s)
        shrink += float(weight @ np.exp(-q))
        grow += float(weight @ np.exp(q))
    return f * (shrink / grow) ** 0.25


def balanced(
    mesh: Mesh,
    f: Complex,
    t: float,
    target: Target = PLANE,
    *,
    k: float = 1.0,
    near: bool = False,
    held: Bools | None = None,
) -> Newton:
    """Let a map f (n,) without flipped faces keep t; no face flips on the way.

    It may have any size; one of a `near` t is gone on from as it is. Where that takes many steps,
    they go on from t = 1/2 as well, and the lower map is taken.
    """
    energy, newton = Energy.of(mesh, t, k, target), Newton(mesh, f, target, held)
    value = newton.lower(energy, soft=not near)
    if not (near or t == HALF or newton.steps < MANY):
        best, newton.f = newton.f, f
        newton.lower(Energy.of(mesh, HALF, k, target))
        if newton.descend(energy) >= value:
            newton.f = best
    return newton


def soft_shear(mesh: Mesh) -> Energy:
    """Return the energy that takes a map onto the disk, however bad, to where refinement can go on.

    That is t = 0, softly: to second order the sum of s^2, the squared hyperbolic distances of the
    shapes of the faces from those on the surface. It is free of scale: all faces count the same,
    whose sizes may range over many powers of ten.
    """
    weight = np.full(len(mesh.F), 1 / len(mesh.F))
    weight[mesh.inscribed] *= INSCRIBED
    return replace(Energy.of(mesh, 0.0, target=DISK), weight=weight).softened


def lower_shear(
    mesh: Mesh, f: Complex, held: Bools | None = None, target: Target = DISK
) -> Complex:
    """Lower the `soft_shear` of an embedding (n,); vertices that are `held` (n,) stay.

    f itself if it has flipped faces.
    """
    if len(target.flipped(mesh.F, f)[0]):
        return f
    newton = Newton(mesh, f, target, held)
    newton.descend(soft_shear(mesh), SHEAR_STEPS, SHEAR_WORTH)
    return newton.f
