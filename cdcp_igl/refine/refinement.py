"""Refinement beyond the harmonic map: reweighted Gauss-Newton on the corner angles."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix

from ..arrays import Complex, Floats, Ints
from ..result.records import Refinement
from ..solve.cholesky import Cholesky
from ..surface.mesh import Mesh
from ..surface.triangles import blocks, extents
from ..verdict.outline import OutlineCertificate
from .preconditioning import WeightedLaplacian, conjugate_gradients
from .targets import DISK, Target

# Further steps are taken while one of the last three lowers the objective by this share.
PATIENCE, WORTH = 3, 0.004
# However many are asked for, they end where the last three lower it by less than this: 1,200 steps
# to there leave 3e-6 of it to gain.
NOTHING = 1e-8
# After so many steps one can tell, to within this factor, whether they will make a map conformal.
FEW_STEPS, HOPE = 10, 3
ROUNDING = np.radians(0.1)  # below this angle |r|^p is rounded off to a parabola
# Not far from the conformal map three lower the objective to within 0.3 % of what the solved system
# would; the weights of other maps differ more.
CG_ITERATIONS, FAR_ITERATIONS = 3, 8
# Below this objective in degrees, what is left of the errors belongs to single faces: after the way
# that the map has just gone and one direction by the factor, so many by the diagonal alone, each
# a sixth of the time, bring as much; and the preconditioner stays while a step gains less than so.
GOOD, SMOOTHING, GOOD_GAIN = 4, 3, 0.08
# Near the conformal map, the diagonal alone will do until a step gains more than that, or fails:
# it gives directions until one brings less than this share of what all have, but at most so many.
ENOUGH, MOST_SMOOTHING = 0.05, 40
DAMPINGS = (0, 1, 10, 100)  # tried in turn
# The preconditioner is used again after a step that has lowered the objective by less than this
# share, as the weights are much the same; but not if p is smaller, as they change too much then.
SMALL_GAIN, STEADY = 0.02, 1.5
LOWERING = 0.5  # of p from 2 to the norm, with each step

HALVINGS = 6  # of a step, before it is computed again with more damping
# The corners of a face that a step flips go a shorter part of it; where this part is too long, too,
# they stay where they are.
SMALLEST_SCALE = 0.03
# The corners of faces smaller than this, by their distance from 0, stay at once: rounding flips
# these faces however short the step is.
TINY = 1e-14


def lower_angle_distortion(
    mesh: Mesh,
    f: Complex,
    order: Ints,
    steps: int,
    norm: float,
    *,
    seconds: float = np.inf,
    analysis: Cholesky | None = None,
    halvings: int = HALVINGS,
    least: int | None = None,
    wanted: float = 0.0,
    gaining: tuple[int, float] = (PATIENCE, WORTH),
    near: bool = False,
    target: Target = DISK,
    accepted: Callable[[Complex, Floats], bool] = lambda f, r: True,
    advance: Callable[[float], None] = lambda done: None,
) -> tuple[Complex, Refinement]:
    """Lower the sum of |angle error|^p over all corners; the image stays the `target` that it is.

    Gauss-Newton with iteratively reweighted least squares. A step that flips a face or does
    not lower the objective is halved, where it flips or everywhere, and then computed again with
    Levenberg-Marquardt damping of the shear of every face; so is one to a map that is not
    `accepted`, with its angle errors (m, 3). One that all vertices went a part of, and that gains
    little, is followed by a damped one. When the strongest damping does not help, the
    refinement ends. The weights begin with those of p = 2, which bring the large errors down that a
    smaller p would take for outliers; each step lowers p until it is the norm, from 1 to 2.

    `order` are the interior vertices, or all that move if there is no circle on which others slide,
    in a fill-reducing order, or in that of an `analysis` of their Laplacian.
    After so many `seconds` no step is begun. A step is halved up to `halvings` times before it is
    computed again with more damping; more of them are slower, and help where a map is bad. After
    the `least` number of steps, if it is told, further ones end where there is little to gain, as
    among so many of the last none was `gaining` this share of the objective, or where it is out of
    reach that only the share `wanted` of it is left, which would make the map conformal. Of a map
    that is `near` the conformal one, most steps need no factor.
    `advance` is called after each step with the share that is done. Returns f itself if no step was
    an improvement, or if it has flipped faces or overlaps itself.

    References
    ----------
    P. W. Holland, R. E. Welsch. Robust regression using iteratively reweighted
    least-squares. Communications in Statistics 6(9), 1977.
    """
    deadline = perf_counter() + seconds
    measure = partial(_power_mean, p=norm)
    flipped = target.flipped(mesh.F, f)
    r = target.errors(mesh, f, flipped)
    before = objective = measure(r)
    schedule, gains, stopped, refused = Schedule(norm, near), list[float](), "", False
    if len(order) == 0 or not target.certificate(mesh, f, flipped).valid:
        return f, Refinement(steps, 0, "no improvement", norm, before, objective)
    laplacian = WeightedLaplacian(mesh, order, analysis)
    while len(gains) < steps and not stopped:
        if schedule.attempt == len(DAMPINGS):
            stopped = "no improvement"
            break
        if perf_counter() >= deadline:
            stopped = "time limit"
            break
        weights, directions = schedule.weights, schedule.directions(objective)
        how: dict[str, Any] = {"anew": schedule.stale, "along": schedule.along, "target": target}
        step = gauss_newton_step(mesh, f, r, *weights, laplacian, *directions, **how)
        found = search_along(mesh, f, step, measure, objective, halvings, target)
        if found is None:
            schedule.failed()
        elif not accepted(*found[:2]):
            refused = True
            schedule.failed()
        else:
            way, was = found[0] - f, objective
            f, r, objective, is_held = found
            gains.append(1 - objective / was)
            advance(len(gains) / steps)
            if is_held and gains[-1] < WORTH and schedule.attempt == 0:
                schedule.failed()  # its gain says nothing of a damped one, which flips fewer faces
            else:
                schedule.went(way, was, objective)
            if len(gains) >= PATIENCE and max(gains[-PATIENCE:]) < NOTHING:
                stopped = "no improvement"
            elif least is not None and least <= len(gains) < steps:
                stopped = _reason_to_stop(
                    gains, steps - len(gains), wanted * before / objective, *gaining
                )
    if refused and stopped not in ("", "time limit"):
        stopped = "not conformal"
    return f, Refinement(steps, len(gains), stopped, norm, before, objective)


class Schedule:
    """How the next step is found: its exponent and damping, its directions, a factor or none.

    Attributes
    ----------
    attempt : int
        Which of the dampings is next; there is none after the strongest.
    stale : bool
        The preconditioner is no longer that of the weights.
    along : (n,) complex128 or None
        The way that a good map has just gone.
    """

    def __init__(self, norm: float, near: bool) -> None:
        self._norm, self._near, self._p, self._little = norm, near, 2.0, True
        self.attempt, self.stale = 0, True
        self.along: Complex | None = None

    @property
    def weights(self) -> tuple[float, float]:
        """The exponent p, and the damping."""
        return self._p, DAMPINGS[self.attempt]

    def directions(self, objective: float) -> tuple[int, int]:
        """How many directions the factor gives, and how many the diagonal."""
        if self._near and self._little and objective < GOOD and self.attempt == 0:
            return 0, MOST_SMOOTHING
        if self.along is not None:
            return 1, SMOOTHING
        return CG_ITERATIONS if objective < GOOD else FAR_ITERATIONS, 0

    def failed(self) -> None:
        """Take more damping: the step was none."""
        self.attempt, self.along, self.stale = self.attempt + 1, None, True

    def went(self, way: Complex, before: float, after: float) -> None:
        """Take account of a step (n,) and of what it did to the objective."""
        used = self._p, self.attempt
        self._p = max(self._norm, self._p - LOWERING)
        self.attempt = max(self.attempt - 1, 0)
        self.along = way if after < GOOD else None
        self._little = after >= (1 - GOOD_GAIN) * before
        alike = (self._p, self.attempt) == used and after >= (1 - SMALL_GAIN) * before
        if self.along is not None:
            alike = self._little
        self.stale = self._norm < STEADY or not alike


def search_along(
    mesh: Mesh,
    f: Complex,
    step: Complex,
    measure: Callable[[Floats], float],
    objective: float,
    halvings: int,
    target: Target,
) -> tuple[Complex, Floats, float, bool] | None:
    """Halve a step until the objective falls, and at faces that it flips until it does not.

    Where the outline would meet itself its vertices are slowed by more than the others. The step
    (n,) is tangential to the `target`; `measure` takes angle errors (m, 3) to the objective.
    Returns the map, its angle errors, its objective, and whether all vertices were slowed; None if
    nothing helps.
    """
    scale = np.ones(len(f))
    for _ in range(halvings):
        trial = target.moved(mesh, f, scale * step)
        flipped = target.flipped(mesh.F, trial)
        if len(flipped[0]):
            faces = mesh.F[flipped[0]]
            scale[faces] = _slower(scale[faces], 2)
            size, distance = extents(f.take(faces.T))
            scale[faces[size < TINY * distance]] = 0
            continue
        r = target.errors(mesh, trial, flipped)
        value = measure(r)
        if value < objective:
            certificate = target.certificate(mesh, trial, flipped)
            if certificate.valid:
                return trial, r, value, bool(scale.max() < 1)
            if isinstance(certificate, OutlineCertificate):
                start = mesh.loop_index[certificate.meeting]
                ends = mesh.loop[np.array([start, start + 1]) % len(mesh.loop)]
                scale[ends] = _slower(scale[ends], 4)
        scale /= 2
    return None


def _slower(scale: Floats, times: int) -> Floats:
    """Make parts of a step so many times smaller; 0 where they are the smallest already."""
    return np.where(scale > SMALLEST_SCALE, scale / times, 0)


def _reason_to_stop(
    gains: list[float], left: int, wanted: float, patience: int = PATIENCE, worth: float = WORTH
) -> str:
    """Say why further steps are not worth their time; empty if they may be.

    `gains` are the shares of the objective that each step has removed, `left` is how many more
    there can be, and `wanted` the share of the objective that is to be left in the end. There is
    little to gain if `patience` of the last have gained less than a share that is `worth` it.
    """
    best = max(gains[-patience:])
    if len(gains) >= patience and best < worth:
        return "little to gain"
    hopeless = len(gains) >= FEW_STEPS and (1 - best) ** left > HOPE * wanted
    return "out of reach" if hopeless else ""


def gauss_newton_step(
    mesh: Mesh,
    f: Complex,
    r: Floats,
    p: float,
    damping: float,
    laplacian: WeightedLaplacian,
    iterations: int = CG_ITERATIONS,
    smoothing: int = 0,
    *,
    anew: bool = True,
    along: Complex | None = None,
    target: Target = DISK,
) -> Complex:
    """Find the displacement (n,) that lowers sum w (r + dr)^2, w = |r|^(p-2), by CG.

    A displacement of the corners of a plane face is dz = a z + b conj(z) + const, and only
    the shear b = sum beta_v dz_v, linear in the displacements, changes the angles:
    an edge e turns by Im(a + b conj(e) / e), hence

        dr_c = Im(b g_c),  g_c = conj(e_k) / e_k - conj(e_j) / e_j

    with e_j, e_k the edges at corner c. With the complex numbers b = B dz of all faces, the
    normal equations are B^H H B dz = -B^H sum_c w_c r_c i conj(g_c), where
    H(b) = (s + damping) b + conj(t b), s = sum_c w_c |g_c|^2 / 2, t = -sum_c w_c g_c^2 / 2.
    On the boundary of the disk dz is a real multiple of i z: it slides on the circle. On a
    `target` in space, beta also turns dz into the plane of the face, and conj(dz) counts, too.

    `damping` is the weight of |b|^2, times that of a corner with the root mean square error: a
    face flips only where |b| is not small, and the angles of a needle hardly feel b. `laplacian`
    preconditions; unless `anew` it stays as it is: to factor it takes half the time of a step.
    It gives as many directions as there are `iterations`, and its diagonal those of `smoothing`;
    without `iterations` it is not factored, and these end when one of them brings little.
    `along` (n,), the way that a good map has just gone, comes before them if it is told.
    """
    shear = Shear.of(mesh, f, target, lambda e, part: _of_angles(e, r[part].T, p))
    if damping:
        shear.s += damping * (r * r).mean() ** (p / 2 - 1)
    if not iterations:
        laplacian.weigh(shear.beta, shear.s)
    elif anew:
        laplacian.factor(shear.beta, shear.s)
    towards: list[Callable[[Complex], Complex]] = [laplacian.solve] * iterations
    towards += [laplacian.divide] * smoothing
    if along is not None:
        towards.insert(0, lambda residual: along.copy())
    return shear.lowered(mesh, f, target, towards, 0 if iterations else ENOUGH)


@dataclass
class Shear:
    """The shear b of every face that displacements of a map make, and what it does to an objective.

    b = B dz = sum beta_v dz_v + mirrored_v conj(dz_v) over the corners v of the face. To second
    order the objective changes by the sum of Re(conj(gradient) b + conj(b) H(b) / 2), with
    H(b) = s b + conj(t b).
    """

    beta: Complex  # (m, 3), a column a corner
    mirrored: Complex | None  # (m, 3), where the target is not in the plane
    s: Floats  # (m,)
    t: Complex  # (m,)
    gradient: Complex  # (m,)

    @classmethod
    def of(
        cls,
        mesh: Mesh,
        f: Complex,
        target: Target,
        weigh: Callable[[Complex, slice], tuple[Floats, Complex, Complex]],
    ) -> Shear:
        """Compute it for a map f (n,); `weigh` finds s, t and gradient of a block of faces.

        It gets their edges (3, k), opposite the corners, each face in its own plane.
        """
        m = len(mesh.F)
        beta, s = np.empty((m, 3), complex), np.empty(m)
        t, gradient = np.empty((2, m), complex)
        mirrored = None
        for part in blocks(m):
            corner, turn, mirror = target.corners(f, mesh.F[part])
            e = corner[[2, 0, 1]] - corner[[1, 2, 0]]
            # Times reciprocals, as it takes long to divide complex numbers.
            by_area = 0.5j * (1 / (e[0].conj() * e[1]).imag)
            beta.T[:, part] = turn * e * by_area
            if mirror is not None:
                mirrored = np.empty_like(beta) if mirrored is None else mirrored
                mirrored.T[:, part] = mirror * e * by_area
            s[part], t[part], gradient[part] = weigh(e, part)
        return cls(beta, mirrored, s, t, gradient)

    def lowered(
        self,
        mesh: Mesh,
        f: Complex,
        target: Target,
        towards: Iterable[Callable[[Complex], Complex]],
        enough: float,
    ) -> Complex:
        """Find the displacement (n,) that lowers the objective, see `conjugate_gradients`."""
        m = len(mesh.F)
        rows = np.arange(0, 3 * m + 1, 3)

        def by_corner(weights: Complex) -> csr_matrix:
            return csr_matrix((weights.ravel(), mesh.F.ravel(), rows), (m, len(mesh.V)))

        B, C = by_corner(self.beta), None if self.mirrored is None else by_corner(self.mirrored)
        B_H = B.conj().T
        project = partial(target.tangential, mesh, f)

        def adjoint(b: Complex) -> Complex:
            x = B_H @ b
            if C is not None:
                x += C.T @ b.conj()
            return project(x)

        def normal_matrix(x: Complex) -> Complex:
            b = B @ x
            if C is not None:
                b += C @ x.conj()
            turned = self.t * b
            b *= self.s
            b += np.conj(turned, out=turned)
            return adjoint(b)

        return conjugate_gradients(normal_matrix, -adjoint(self.gradient), towards, project, enough)


def _of_angles(e: Complex, r: Floats, p: float) -> tuple[Floats, Complex, Complex]:
    """Compute s, t and the gradient (k,) of k faces with edges e and angle errors r (3, k)."""
    q = e.conj()
    q *= q * (1 / (e.real * e.real + e.imag * e.imag))  # conj(e) / e
    g = q[[1, 2, 0]] - q[[2, 0, 1]]
    wg = (r * r + ROUNDING**2) ** (p / 2 - 1) * g
    s = (wg.real * g.real + wg.imag * g.imag).sum(axis=0) / 2
    return s, (wg * g).sum(axis=0) / -2, 1j * (r * wg).sum(axis=0).conj()


def _power_mean(r: Floats, p: float) -> float:
    """(mean |r|^p)^(1/p) in degrees, rounded off at 0.1 degree."""
    return float(np.degrees(((r * r + ROUNDING**2) ** (p / 2)).mean() ** (1 / p)))
