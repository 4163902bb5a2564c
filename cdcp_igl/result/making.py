"""How results are made, onto whatever target: judged, the best of several, and refined."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any, ClassVar, TypeVar

import numpy as np

from ..arrays import Complex, Floats, Ints, as_complex, size_exponent
from ..cached import cached_property
from ..descent.descent import Descent, Limits
from ..descent.energies import Angles, Measured
from ..descent.preconditioning import WeightedLaplacian
from ..descent.refinement import HALVINGS, PATIENCE, WORTH, Refinement, lower_angle_distortion
from ..descent.schedules import GOOD
from ..descent.targets import Target
from ..errors import MapError, SolverError
from ..options import Options
from ..phases import Phases
from ..plot.layout import Layout
from ..rescue.boundary import BoundaryMethod
from ..rescue.repair import Repair
from ..solve.cholesky import Cholesky
from ..surface.mesh import Mesh
from ..verdict.conformality import LARGEST_DEGREES, judge
from ..verdict.distortion import AngleDistortion, reported_distortion
from .base import how_made
from .bijection import Bijection

log = logging.getLogger("cdcp_igl")

# A harmonic map is refined, even if no steps are asked for, where it is not near the conformal one:
# its errors are more than EXCESS times what the scale explains; or, as on coarse meshes, more than
# so many degrees. It has STEPS_DUE, and up to FURTHER while each gains a share of GAINING.
EXCESS, COARSE = 1.05, 6.0
STEPS_DUE, FURTHER, GAINING = 2, 9, 0.02
# A map that is not conformal, that comes from an embedding by mean values, or in which repair has
# moved more than this share of the vertices, as less shows in no mean, is refined by up to
# MOST_STEPS, each halved up to PATIENT times. They are counted, not timed, as equal inputs have
# equal outputs; they take most of the time of a surface that is hard.
REPAIRED = 0.01
MOST_STEPS = 60
PATIENT = 12
# Where repair has moved more than this share, faces that it has barely opened may hold steps up.
MUCH_REPAIRED = 0.05
# By so much a map that is not conformal has to be better than one that is, where both are refined.
MARGIN = 1.05


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class MadeMap(Bijection):
    """A map of one mesh, with what was done about flipped faces, and about the distortion."""

    mesh: Mesh
    repair: Repair
    refinement: Refinement | None = None
    solver: str

    _reported: ClassVar[tuple[str, ...]] = ()  # attributes that only this kind of map has
    _coarse: ClassVar[float] = COARSE  # a free outline has no such bound

    @property
    def is_embedded(self) -> bool:
        """Whether the map comes from an embedding by mean values."""
        return False

    @cached_property
    def distortion(self) -> AngleDistortion:
        """Mean, SD and maximum of the angular distortion of the given faces."""
        return AngleDistortion.of(self._degrees())

    def _degrees(self) -> Floats:
        """(m, 3) angular distortion of the given faces."""
        F = self._surface()[1]
        flipped = self.certificate.flipped
        return reported_distortion(self.mesh.V, F, self._images, flipped[flipped < len(F)])

    @property
    def side(self) -> str:
        """As of every `Result`; of an open surface in space nothing can be known."""
        return "" if self.mesh.loops and np.ptp(self.mesh.V[:, 2]) else super().side

    @property
    def _faces(self) -> Ints:
        return self.mesh.F

    @property
    def rank(self) -> tuple[bool, bool, float]:
        """Valid maps come first, of these the conformal ones, then those of low mean distortion."""
        return not self.valid, not self.conformal, self.distortion.mean

    @property
    def refined_rank(self) -> tuple[bool, float]:
        """Where maps are refined the lowest is first, one not conformal if it is so by `MARGIN`."""
        return not self.valid, self.distortion.mean * (1 if self.conformal else MARGIN)

    @property
    def repaired_share(self) -> float:
        """The share of the vertices that repair has moved."""
        return self.repair.n_moved / len(self.mesh.V)

    @property
    def is_repaired(self) -> bool:
        """Whether so many vertices were moved that it shows in the mean."""
        return self.repaired_share > REPAIRED

    @property
    def is_much_repaired(self) -> bool:
        """Whether so many vertices were moved that the map is another one."""
        return self.repaired_share > MUCH_REPAIRED

    @property
    def is_far_from_mended(self) -> bool:
        """Whether refinement may go farther from an embedding than from what repair has left.

        Not where what is left of the errors belongs to single faces.
        """
        return self.is_much_repaired and self.conformality.mean > GOOD

    @property
    def steps_due(self) -> int:
        """Steps of refinement for a map that is measurably not near the conformal one."""
        if self.conformality.reasons or self.is_repaired or self.is_embedded:
            return MOST_STEPS
        is_far = self.conformality.excess > EXCESS or self.conformality.mean > self._coarse
        return FURTHER if is_far else 0

    def _steps(self) -> list[tuple[str, str]]:
        return [
            ("repair", str(self.repair)),
            ("refinement", str(self.refinement or "not asked for")),
            ("solver", self.solver),
        ]

    def _details(self) -> dict[str, Any]:
        plain = {name: getattr(self, name) for name in self._reported}
        return {name: list(x) if isinstance(x, tuple) else x for name, x in plain.items()}


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class PlaneMap(MadeMap):
    """A map (n, 2) of a disk, scaled into the unit square by its larger side where it is packed."""

    uv: Floats
    boundary: str
    laplacian: str

    _inscribed = False

    def _made(self) -> dict[str, Any]:
        return how_made(self, BoundaryMethod(self.boundary, laplacian=self.laplacian), "none")

    def packed(self) -> Floats:
        """Return the image scaled into the unit square, (n, 2): texture coordinates."""
        low, size = self._box
        return (self.uv - low) / size.max()

    @property
    def _box(self) -> tuple[Floats, Floats]:
        """Lower left corner and size of the image."""
        low = self.uv.min(axis=0)
        return low, self.uv.max(axis=0) - low

    def _in_plane(self, points: Floats) -> Complex:
        # In a unit in which the coordinates of the map are at most 1, exactly.
        return as_complex(np.ldexp(points, -size_exponent(self.uv)))

    def _surface(self) -> tuple[Floats, Ints]:
        return self.mesh.positions, self.mesh.F

    def _layout(self) -> Layout:
        mesh, (low, size) = self.mesh, self._box
        scale = float(size.max() / 2)
        x, y = (low + size / 2).tolist()
        across, up = (size / (4 * scale)).tolist()
        uv, place = (self.uv - [x, y]) / scale, {"middle": (x, y), "origin": (across, up)}
        F = self._upward_faces
        return self._drawn(mesh.V, F, uv, self._key_figure(), scale=scale, **place)

    @property
    def _upward_faces(self) -> Ints:
        """The faces, counterclockwise in the image."""
        return self.mesh.F


def fields_of(
    mesh: Mesh,
    f: Complex | Floats,
    degrees: Floats,
    certificate: Any,
    repair: Repair,
    *,
    known: float = 0.0,
) -> dict[str, Any]:
    """Judge a map with angular distortion `degrees` (m, 3): the fields of a result that say so.

    For `known` see `judge`.
    """
    how: dict[str, Any] = {"closely": repair.n_flipped > 0, "known": known}
    return {
        "mesh": mesh,
        "certificate": certificate,
        "conformality": judge(mesh, f, degrees, valid=certificate.valid, **how),
        "repair": repair,
    }


Kind = TypeVar("Kind", bound=MadeMap)


def best_of(
    ways: Iterable[Callable[[], Kind]],
    enough: Callable[[Kind], bool] = lambda made: made.conformal,
) -> Kind:
    """Try one way after the other until a map is good enough; the best one, valid or not.

    A way without a map (SolverError, MapError) is passed over, unless there is no other.
    """
    found, failure = list[Kind](), None
    for way in ways:
        try:
            found.append(way())
        except (SolverError, MapError) as error:
            failure = error
            continue
        if enough(found[-1]):
            break
    if failure and not found:
        raise failure
    return min(found, key=lambda made: made.refined_rank) if found[1:] else found[0]


def steps_of(plain: MadeMap, options: Options, *, due: bool = True) -> int:
    """Count the steps of refinement of a map: as many as are asked for, or are due."""
    if not plain.valid or options.refine == 0 or options.kept:
        return 0
    return max(options.refine or 0, plain.steps_due if due else 0)


def refined(
    plain: Kind,
    f: Complex,
    target: Target,
    order: Ints,
    steps: int,
    finished: Callable[[Complex, float], Kind],
    options: Options,
    phase: Phases,
    analysis: Cholesky | None = None,
    *,
    near: bool = False,
) -> Kind:
    """Lower the angular distortion of a valid map by so many steps.

    It is f (n,) in the coordinate of its `target`; `finished` repairs, certifies and judges such a
    map, the mean error that is no shear being known. For `order` and `analysis` see
    `WeightedLaplacian`, for `near` see `Angles`. No step takes a map that is conformal to one that
    is not; where rounding at the end does, the plain one is returned. Where that flips faces, half
    of the steps are taken.
    """
    mesh, verdict, repair = plain.mesh, plain.conformality, plain.repair
    few = steps == plain.steps_due == FURTHER
    conformal, known = plain.conformal, 0.0 if verdict.sheared else verdict.mean

    def no_less_conformal(found: Measured) -> bool:
        nonlocal conformal, known
        degrees = np.degrees(abs(found.errors))
        mean, closely = float(degrees.mean()), repair.n_flipped > 0
        is_now = mean <= LARGEST_DEGREES and bool(
            judge(mesh, target.image(found.f), degrees, closely=closely, known=known)
        )
        if is_now:
            conformal, known = True, max(known, mean)
        return is_now or not conformal

    with phase("refine") as advance:
        patience, worth = (1, GAINING) if few else (PATIENCE, WORTH)
        limits = Limits(
            steps,
            least=options.refine or STEPS_DUE,
            patience=patience,
            worth=worth,
            error_ratio=verdict.wanted,
            seconds=options.refine_seconds,
            trials=PATIENT if steps >= MOST_STEPS else HALVINGS,
        )
        laplacian = WeightedLaplacian(mesh, order, analysis)
        descent = Descent(mesh, f, target, laplacian=laplacian)
        angles = Angles(mesh, target, options.refine_norm, near)
        refinement = lower_angle_distortion(descent, angles, limits, no_less_conformal, advance)
    if few and refinement.stopped == "little to gain":  # further ones had not been asked for
        refinement = replace(refinement, asked=refinement.steps, stopped="")
    if refinement.stopped:
        log.info("refinement: %s", refinement)
    if refinement.steps == 0:
        return replace(plain, refinement=refinement)
    better = finished(descent.f, known)
    if not better.valid and refinement.steps > 1:
        fewer = refinement.steps // 2
        how = options, phase, analysis
        made = refined(plain, f, target, order, fewer, finished, *how, near=near)
        if (told := made.refinement) is not None:
            told = replace(told, asked=refinement.asked, stopped="no certificate")
        return replace(made, refinement=told)
    if (better.valid, better.conformal) < (plain.valid, plain.conformal):
        stopped = "not conformal" if better.valid else "no certificate"
        return replace(plain, refinement=refinement.undone(stopped))
    repair = replace(repair, n_moved=max(repair.n_moved, better.repair.n_moved))
    return replace(better, refinement=refinement, repair=repair)
