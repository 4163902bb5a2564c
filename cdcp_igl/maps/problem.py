"""The way to a map, whatever it is onto: starts in turn, placed and judged; descent; the best."""

from __future__ import annotations

import logging
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from typing import Generic, TypeVar

import numpy as np

from ..arrays import Complex
from ..descent.descent import Descent, Limits
from ..descent.energies import Angles, Measured
from ..descent.preconditioning import WeightedLaplacian
from ..descent.refinement import HALVINGS, PATIENCE, WORTH, lower_angle_distortion
from ..descent.targets import Target
from ..errors import MapError, SolverError
from ..options import Options
from ..phases import Phases
from ..result.base import valid_map
from ..result.made import MadeMap
from ..steps.circle import Rejected
from ..surface.mesh import Mesh
from ..verdict.conformality import LARGEST_DEGREES, judge
from . import rules

log = logging.getLogger("cdcp_igl")

PATIENT = 12  # halvings of a step of a map that is not conformal, or barely
Kind = TypeVar("Kind", bound=MadeMap)
Start = Callable[[], Kind]


@dataclass(frozen=True, eq=False)
class OnTarget:
    """A map as descent sees it: f (n,) in the coordinate of its target.

    The Laplacian, of the vertices that move, preconditions; a map that is `near` the conformal one
    needs no factor, see `Angles`.
    """

    target: Target
    f: Complex
    laplacian: WeightedLaplacian
    near: bool = False


class Problem(ABC, Generic[Kind]):
    """A surface and what it is to be mapped onto: what differs between disk, sphere and others.

    Attributes
    ----------
    onto, remedy : str
        What the error says if there is no valid map; the remedy may name what the map has.
    """

    onto: str = ""
    remedy: str
    coarse = rules.COARSE

    def __init__(self, mesh: Mesh, options: Options, phase: Phases) -> None:
        self.mesh, self.options, self.phase = mesh, options, phase

    @abstractmethod
    def starts(self) -> Iterator[Start[Kind]]:
        """Yield harmonic maps, placed and judged, in the order in which they are tried."""

    def is_good_start(self, made: Kind) -> bool:
        """Whether no other harmonic map is tried."""
        return made.is_acceptable

    def tutte_starts(self, best: Kind) -> Iterator[Start[Kind]]:
        """Yield maps from Tutte embeddings; each is refined."""
        return iter(())

    def needs_no_other_start(self, made: Kind) -> bool:
        """Whether no Tutte embedding may lead nearer to the conformal map."""
        return made.is_acceptable

    def chosen(self, made: list[Kind], failures: list[str]) -> Kind:
        """Return the best of some maps."""
        return min(made, key=rules.rank) if made[1:] else made[0]

    def steps(self, made: Kind) -> int:
        """Return how many steps of refinement a map gets."""
        return rules.steps_of(made, self.options, self.coarse)

    @abstractmethod
    def on_target(self, made: Kind) -> OnTarget:
        """Return a map as descent sees it."""

    @abstractmethod
    def moved(self, made: Kind, f: Complex, known: float) -> Kind:
        """Return what descent made of a map, f (n,): repaired, certified and judged."""

    def release(self) -> None:
        """Give back memory that only further starts would need."""

    def finished(self, best: Kind) -> Kind:
        """Return the map that is returned for the best one, which may be not valid."""
        return best


def solve(problem: Problem[Kind]) -> Kind:
    """Map a surface: the best map of a harmonic start, else of a Tutte embedding.

    MapError if no map is valid; its result is the best one.
    """
    plain = problem.chosen(*_tried(problem.starts(), problem.is_good_start))
    settled = problem.needs_no_other_start(plain)
    best = descended(problem, plain, last=settled)
    if not (settled or problem.needs_no_other_start(best)):
        starts = (partial(_descended_start, problem, one) for one in problem.tutte_starts(best))
        is_enough = problem.needs_no_other_start
        best = problem.chosen(*_tried(chain([lambda: best], starts), is_enough))
    best = valid_map(problem.finished(best), problem.onto, problem.remedy)
    problem.phase.done()
    return best


def _descended_start(problem: Problem[Kind], start: Start[Kind]) -> Kind:
    return descended(problem, start())


def _tried(
    starts: Iterable[Start[Kind]], is_enough: Callable[[Kind], bool]
) -> tuple[list[Kind], list[str]]:
    """Try starts in turn until a map is good enough: the maps, and why others are none."""
    made, failures = list[Kind](), list[Exception]()
    for start in starts:
        try:
            made.append(start())
        except (Rejected, SolverError, MapError) as failure:
            failures.append(failure)
            continue
        if is_enough(made[-1]):
            break
    if failures and not made:
        raise failures[-1]
    return made, [str(failure) for failure in failures]


class _NoLessConformal:
    """Which steps are accepted: those after which a map that was conformal still is.

    `known` is the mean error in which there is no shear, see `judge`.
    """

    def __init__(self, made: MadeMap, target: Target) -> None:
        verdict = made.conformality
        self._made, self._target, self._conformal = made, target, made.is_acceptable
        self.known = 0.0 if verdict.sheared else verdict.mean

    def __call__(self, found: Measured) -> bool:
        degrees = np.degrees(abs(found.errors))
        mean, closely = float(degrees.mean()), self._made.repair.n_flipped > 0
        image = self._target.image(found.f)
        if mean <= LARGEST_DEGREES and judge(
            self._made.mesh, image, degrees, closely=closely, known=self.known
        ):
            self._conformal, self.known = True, max(self.known, mean)
            return True
        return not self._conformal


def descended(
    problem: Problem[Kind], plain: Kind, *, last: bool = False, most: int | None = None
) -> Kind:
    """Lower the angular distortion of a valid map by as many steps as it gets, or at `most`.

    No step takes a map that is conformal to one that is not; where rounding at the end does, the
    plain one is returned. Where rounding flips faces, half of the steps are taken. If the map is
    the `last` one, no other start will need the factor.
    """
    steps, options = problem.steps(plain) if most is None else most, problem.options
    if steps == 0:
        return plain
    if last:
        problem.release()
    usual = steps == rules.MOST_USUAL_STEPS == rules.default_steps(plain, problem.coarse)
    given = problem.on_target(plain)
    accepted = _NoLessConformal(plain, given.target)
    patience, worth = (1, rules.WORTH_A_STEP) if usual else (PATIENCE, WORTH)
    limits = Limits(
        steps,
        least=options.refine or rules.FIRST_STEPS,
        patience=patience,
        worth=worth,
        error_ratio=plain.conformality.wanted,
        seconds=options.refine_seconds,
        trials=PATIENT if steps >= rules.MOST_STEPS else HALVINGS,
    )
    with problem.phase("refine") as advance:
        descent = Descent(plain.mesh, given.f, given.target, laplacian=given.laplacian)
        angles = Angles(plain.mesh, given.target, options.refine_norm, given.near)
        refinement = lower_angle_distortion(descent, angles, limits, accepted, advance)
    if usual and refinement.stopped == "little to gain":  # further ones had not been asked for
        refinement = replace(refinement, asked=refinement.steps, stopped="")
    if refinement.stopped:
        log.info("refinement: %s", refinement)
    if refinement.steps == 0:
        return replace(plain, refinement=refinement)
    better = problem.moved(plain, descent.f, accepted.known)
    if not better.valid and refinement.steps > 1:
        made = descended(problem, plain, most=refinement.steps // 2)
        if (told := made.refinement) is not None:
            told = replace(told, asked=refinement.asked, stopped="no certificate")
        return replace(made, refinement=told)
    if (better.valid, better.is_acceptable) < (plain.valid, plain.is_acceptable):
        stopped = "not conformal" if better.valid else "no certificate"
        return replace(plain, refinement=refinement.undone(stopped))
    repair = replace(plain.repair, n_moved=max(plain.repair.n_moved, better.repair.n_moved))
    return replace(better, refinement=refinement, repair=repair)
