"""A descent: steps that lower an energy of a map onto a target, and flip no face."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import chain
from operator import length_hint
from time import perf_counter
from typing import NamedTuple

import numpy as np

from ..arrays import Bools, Complex, Floats, Ints
from ..errors import SolverError
from ..solve.laplacian import Laplacian
from ..solve.ordering import elimination_order
from ..solve.solvers import solver
from ..surface.mesh import Mesh
from ..surface.triangles import blocks, extents
from ..verdict.outline import OutlineCertificate
from .energies import (
    HALF,
    Energy,
    Measured,
    Quadratic,
    SymmetricDirichlet,
    mean_squared_log_dilatation,
)
from .preconditioning import WeightedLaplacian, conjugate_gradients, dot
from .schedules import NEAR, WORTH, Directions, Taken, schedule_of
from .targets import DISK, PLANE, Disk, Target

NO_FLIPPED = np.empty(0, np.int64), 0
STEPS = 100
ISOMETRIC = 1e-20  # of the energy: rounding
# A descent ends where the last steps lower the energy by less than this: 1,200 steps to there leave
# 3e-6 of it to gain.
NOTHING, PATIENCE = 1e-8, 3
# After so many steps one can tell, to within this factor, whether they will make a map conformal.
FEW_STEPS, HOPE = 10, 3
# Of a soft energy first, with a small k; where the map is crowded, then with some times as much.
FIRST_STEPS, HARDER = 60, 3
MANY = 40  # steps to a minimum: another may be lower
# Of an embedding's shear: refinement, in which faces get into the way, takes longer for that.
SHEAR_STEPS, SHEAR_WORTH = 100, 4e-3
# Rounds in which vertices are pulled to their places, and the share of the way to the first flip.
PULLS, PULL = 120, 0.6
# They end where so many rounds have not brought the farthest vertex nearer by this factor.
ROUNDS, NEARER = 40, 0.9
# Trial lengths of a step. With a barrier it ends before the first flip, after this share of the way
# there, and lowers the energy by this share of its slope; its gain says nothing if it is so short.
TRIALS, SHARE, SUFFICIENT, SHORT = 16, 0.9, 1e-4, 0.5
# Without a barrier, the corners of a face that a step flips go a shorter part of it; where this
# part is too long, too, they stay where they are.
SMALLEST_SCALE = 0.03
# The corners of faces smaller than this, by their distance from 0, stay at once: rounding flips
# these faces however short the step is.
TINY = 1e-14


@dataclass(frozen=True)
class Limits:
    """When a descent ends.

    Attributes
    ----------
    steps : int
        At most.
    least : int or None
        Steps after which it ends where there is little to gain, or no hope; None if it does not.
    patience, worth : int, float
        There is little to gain if none of so many of the last steps gained this share.
    error_ratio : float
        There is no hope if so little of the energy as it began is out of reach.
    seconds : float
        After which no step begins.
    trials : int
        Lengths of a step that are tried. More of them are slower, and help where a map is bad.
    """

    steps: int = STEPS
    least: int | None = 1
    patience: int = 1
    worth: float = WORTH
    error_ratio: float = np.inf
    seconds: float = np.inf
    trials: int = TRIALS

    def reason_to_stop(self, gains: list[float], ratio: float) -> str:
        """Say why there are no further steps, or nothing.

        `gains` are the shares of the energy that each step has removed, and `ratio` is what they
        have left of it.
        """
        if gains[PATIENCE - 1 :] and max(gains[-PATIENCE:]) < NOTHING:
            return "no improvement"
        if self.least is None or not self.least <= len(gains) < self.steps:
            return ""
        best, left = max(gains[-self.patience :]), self.steps - len(gains)
        if len(gains) >= self.patience and best < self.worth:
            return "little to gain"
        hopeless = len(gains) >= FEW_STEPS and (1 - best) ** left > HOPE * self.error_ratio / ratio
        return "out of reach" if hopeless else ""


TO_THE_MINIMUM, AFTER_A_PULL = Limits(), Limits(3)


class Found(NamedTuple):
    """A map that is lower, and the largest part of the step that a vertex went."""

    to: Measured
    length: float


class Descent:
    """A map f (n,) of a mesh on its way down, what moves of it, and what preconditions it.

    Vertices that are `held` (n,) stay; those of the boundary slide where the target says so. The
    preconditioner is that of a `laplacian` of what moves, or of the pattern of the mesh.

    Attributes
    ----------
    f : (n,) complex128
        The map, without flipped faces; `lower` moves it.
    steps, factors : int
        How many it took.
    stopped : str
        Why the last descent ended, as `Refinement` says it; empty if the steps were at an end.
    """

    def __init__(
        self,
        mesh: Mesh,
        f: Complex,
        target: Target = PLANE,
        held: Bools | None = None,
        laplacian: WeightedLaplacian | None = None,
    ) -> None:
        self.mesh, self.target, self._held = mesh, target, held
        self._laplacian = laplacian or _laplacian_of(mesh, target, held)
        self.f, self.steps, self.factors, self.stopped = f, 0, 0, ""

    @property
    def is_fixed(self) -> bool:
        """Whether nothing may move but what slides."""
        return len(self._laplacian.order) == 0

    def lower(
        self,
        energy: Energy,
        limits: Limits = TO_THE_MINIMUM,
        accepted: Callable[[Measured], bool] = lambda found: True,
        advance: Callable[[float], None] = lambda done: None,
    ) -> float:
        """Go down, to maps that are `accepted`, until the limits say that it ends.

        `advance` is called after each step with the share that is done. Returns the energy.
        """
        deadline, refused = perf_counter() + limits.seconds, False
        at = energy.measured(self.f, NO_FLIPPED)
        first, gains, schedule = at.value, list[float](), schedule_of(energy, limits.worth)
        self.stopped = "no improvement" if first < ISOMETRIC else ""
        while len(gains) < limits.steps and not self.stopped:
            if schedule.is_exhausted:
                self.stopped = "no improvement"
                break
            if perf_counter() >= deadline:
                self.stopped = "time limit"
                break
            model, directions = schedule.model(at), schedule.directions(at.value)
            way, slope, used = self.direction(model, directions, is_stale=schedule.is_stale)
            del model  # before the next one: it is as large as all the rest
            found = self._searched(energy, at, way, slope, limits.trials)
            if found is None or not accepted(found.to):
                refused |= found is not None
                schedule.failed()
                continue
            before, at = at, found.to
            self.f, self.steps, gain = at.f, self.steps + 1, 1 - at.value / before.value
            # A barrier shortens all of a step for one face, and then its gain says nothing.
            gains.append(np.inf if energy.is_barrier and found.length <= SHORT else gain)
            advance(len(gains) / limits.steps)
            schedule.went(Taken(at.f - before.f, found.length, before.value, at.value, used))
            is_done = at.value < ISOMETRIC
            self.stopped = (
                "no improvement" if is_done else limits.reason_to_stop(gains, at.value / first)
            )
        if refused and self.stopped not in ("", "time limit"):
            self.stopped = "not conformal"
        return at.value

    def direction(
        self, model: Quadratic, directions: Directions, *, is_stale: bool = True
    ) -> tuple[Complex, float, int]:
        """Find a direction (n,) by CG, the slope along it, and how often CG took the factor.

        That is factored anew if it is stale.
        """
        if not directions.by_factor:
            self._laplacian.weigh(model.beta, model.weights)
        elif is_stale:
            self._laplacian.factor(model.beta, model.weights)
            self.factors += 1
        gradient, along = self._possible(model.gradient()), directions.along
        by_factor = iter([self._laplacian.solve] * directions.by_factor)
        towards = chain(
            [] if along is None else [lambda residual: along.copy()],
            by_factor,
            [self._laplacian.divide] * directions.by_diagonal,
        )
        step = conjugate_gradients(
            lambda dz: self._possible(model.times(dz)),
            *(-gradient, towards, self._possible, directions.enough),
        )
        return step, dot(gradient, step), directions.by_factor - length_hint(by_factor)

    def _possible(self, x: Complex) -> Complex:
        x = self.target.tangential(self.mesh, self.f, x)
        if self._held is not None:
            x[self._held] = 0
        return x

    def _searched(
        self, energy: Energy, at: Measured, step: Complex, slope: float, trials: int
    ) -> Found | None:
        """Go along a step (n,) to where the energy is lower and no face is flipped, if anywhere."""
        if energy.is_barrier:
            return self._before_the_first_flip(energy, at, step, slope, trials)
        return self._around_flips(energy, at, step, trials)

    def _around_flips(
        self, energy: Energy, at: Measured, step: Complex, trials: int
    ) -> Found | None:
        """Halve a step until the energy falls, and at faces that it flips until it does not.

        Where the boundary would meet itself its vertices are slowed by more than the others.
        """
        mesh, scale = self.mesh, np.ones(len(step))
        for _ in range(trials):
            trial = self.target.moved(mesh, at.f, scale * step)
            flipped = self.target.flipped(mesh.F, trial)
            if len(flipped[0]):
                faces = mesh.F[flipped[0]]
                scale[faces] = _slower(scale[faces], 2)
                size, distance = extents(at.f.take(faces.T))
                scale[faces[size < TINY * distance]] = 0
                continue
            there = energy.measured(trial, flipped)
            if there.value < at.value:
                certificate = self.target.certificate(mesh, trial, flipped)
                if certificate.valid:
                    return Found(there, float(scale.max()))
                if isinstance(certificate, OutlineCertificate):
                    start = mesh.loop_index[certificate.meeting]
                    ends = mesh.loop[np.array([start, start + 1]) % len(mesh.loop)]
                    scale[ends] = _slower(scale[ends], 4)
            scale /= 2
        return None

    def _before_the_first_flip(
        self, energy: Energy, at: Measured, step: Complex, slope: float, trials: int
    ) -> Found | None:
        """Go back by parabolas or on by doubling."""
        limit = SHARE * way_to_flip(self.mesh.F, at.f, step)
        length, found = min(1.0, limit), None
        for _ in range(trials):
            trial = self.target.moved(self.mesh, at.f, length * step)
            flipped = self.target.flipped(self.mesh.F, trial)
            lowest, lower = 0.5, False  # where the parabola is lowest, by the length
            if len(flipped[0]) == 0:
                there = energy.measured(trial, flipped)
                bend = (there.value - at.value) / length - slope
                lowest = -slope / (2 * bend) if bend > 0 else 2.0
                lower = there.value <= at.value + SUFFICIENT * length * slope
            if found is not None and not (lower and there.value < found.to.value):
                return found
            if lower:
                longer = found is not None and length > found.length
                found = Found(there, length)
                at_end = lowest >= 1.5 and (2 * length > limit or length < 1)
                if 0.75 < lowest < 1.5 or at_end or (lowest <= 0.75 and longer):
                    return found
            length *= 2 if lower and lowest >= 1.5 else min(max(lowest, 0.1), 0.75)
        return found

    def pull(self, energy: SymmetricDirichlet, rows: Ints, goal: Complex) -> bool:
        """Bring `rows` that are held nearer to their places (k,), as far as no face flips.

        The rest follows harmonically, and then goes down. False if the energy is not finite any
        more, because a face is all but flipped.
        """
        sliding = isinstance(self.target, Disk) & self.mesh.on_boundary[rows]
        at = self.f[rows]
        way = np.zeros_like(self.f)
        way[rows] = np.where(sliding, 1j * at * np.angle(goal / np.where(at, at, 1)), goal - at)
        model = energy.quadratic(self.f, whole=False)
        self._laplacian.factor(model.beta, model.weights)
        step = self._laplacian.extended(way)
        length = min(1.0, PULL * way_to_flip(self.mesh.F, self.f, step))
        for _ in range(TRIALS):
            trial = self.target.moved(self.mesh, self.f, length * step)
            if length == 1:
                trial[rows] = goal
            if len(self.target.flipped(self.mesh.F, trial)[0]) == 0:
                self.f = trial
                break
            length /= 2
        if not np.isfinite(energy.value(self.f)):
            return False
        self.lower(energy, AFTER_A_PULL)
        return True


def _laplacian_of(mesh: Mesh, target: Target, held: Bools | None) -> WeightedLaplacian:
    free = np.ones(len(mesh.scaled), dtype=bool) if held is None else ~held
    if target.slides:
        free &= ~mesh.on_boundary
    low, high = mesh.edges.low, mesh.edges.high
    pattern = Laplacian.of(low, high, np.ones(len(low)), len(mesh.scaled))
    order, ordering, _ = elimination_order(pattern, mesh.scaled, free, solver())
    return WeightedLaplacian(mesh, order, ordering=ordering)


def _slower(scale: Floats, times: int) -> Floats:
    """Make parts of a step so many times smaller; 0 where they are the smallest already."""
    return np.where(scale > SMALLEST_SCALE, scale / times, 0)


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


class Progress:
    """Whether vertices still get nearer to their places, if slowly."""

    def __init__(self) -> None:
        self._nearest, self._rounds = np.inf, 0

    def made(self, left: float) -> bool:
        """Take account of what is `left` of the way; false if many rounds brought little."""
        self._rounds += 1
        if left < NEARER * self._nearest:
            self._nearest, self._rounds = left, 0
        return self._rounds < ROUNDS


def pulled(descent: Descent, energy: SymmetricDirichlet, rows: Ints, goal: Complex) -> bool:
    """Bring `rows` that are held to their places (k,), as far as no face flips, till they are.

    Between, the rest goes down. False if something of the way is left after all.
    """
    progress = Progress()
    try:
        for _ in range(PULLS):
            if np.array_equal(descent.f[rows], goal):
                descent.lower(energy)
                return True
            goes_on = descent.pull(energy, rows, goal)
            if not (goes_on and progress.made(float(abs(descent.f[rows] - goal).max()))):
                break
    except SolverError:  # faces are all but flipped
        pass
    return False


def minimise(descent: Descent, energy: SymmetricDirichlet, *, soft: bool = True) -> float:
    """Go down to the minimum, the `soft` energy first; return the energy there."""
    if soft:
        first, roughly = energy.softened, Limits(FIRST_STEPS, worth=NEAR)
        descent.lower(first, roughly)
        if energy.is_crowded(descent.f):
            descent.lower(replace(first, k=HARDER * first.k), roughly)
    return descent.lower(energy)


def keeping(
    mesh: Mesh,
    f: Complex,
    t: float,
    target: Target = PLANE,
    *,
    near: bool = False,
    held: Bools | None = None,
) -> Descent:
    """Let a map f (n,) without flipped faces keep t; no face flips on the way.

    It may have any size; one of a `near` t is gone on from as it is. Where that takes many steps,
    they go on from t = 1/2 as well, and the lower map is taken.
    """
    energy = SymmetricDirichlet.of(mesh, t, target=target)
    descent = Descent(mesh, f, target, held)
    value = minimise(descent, energy, soft=not near)
    if not (near or t == HALF or descent.steps < MANY):
        best, descent.f = descent.f, f
        minimise(descent, SymmetricDirichlet.of(mesh, HALF, target=target))
        if descent.lower(energy) >= value:
            descent.f = best
    return descent


def from_tutte(mesh: Mesh, f: Complex, held: Bools | None = None, target: Target = DISK) -> Complex:
    """Lower the `mean_squared_log_dilatation` of a Tutte embedding (n,); `held` vertices stay.

    f itself if it has flipped faces.
    """
    if len(target.flipped(mesh.F, f)[0]):
        return f
    descent = Descent(mesh, f, target, held)
    descent.lower(mean_squared_log_dilatation(mesh), Limits(SHEAR_STEPS, worth=SHEAR_WORTH))
    return descent.f
