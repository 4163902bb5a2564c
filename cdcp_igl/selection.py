"""Of the maps that were tried, the best: normalised, certified, judged and refined."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from .arrays import Complex, coordinates
from .distortion import AngleDistortion
from .errors import MapError
from .rescue.boundary import BoundaryMethod, Rejected
from .rescue.candidate import SMALL, Candidate, judged, refined
from .rescue.collapsed_faces import hold_open
from .rescue.harmonic_map import HarmonicMap
from .rescue.repair import MANY, Repair, embed, mend, unfold
from .rescue.unfolding import keep_faces
from .result.disk_map import DiskMap
from .solve.factored import FactoredSurface
from .steps.alignment import rotate
from .steps.mobius import MobiusMethod, Normalization, composed, normalize
from .steps.options import Options
from .steps.phases import Phases
from .surface.mesh import DiskMesh

__all__ = ["best_map"]

log = logging.getLogger("cdcp_igl")

# If a larger share of the faces is flipped, other maps come first: those of the intrinsic
# Delaunay Laplacian have a hundredth of the flipped faces of the cotangent one on slivers.
MANY_FLIPPED = 0.003
# A map with so many times the distortion of another may still be the better one after refinement.
HANDICAP = 2
# Even area, if it was asked for, may raise the angular distortion by so much.
PRICE_OF_AREA = 1.05
REPAIRED_SHARE = 0.01  # of the vertices; less than that shows in no mean


Way = Callable[[Phases], HarmonicMap]  # to a harmonic map; raises Rejected where there is none


def best_map(
    surface: FactoredSurface,
    ways: Iterable[Way],
    options: Options,
    phase: Phases,
    *,
    keep_factor: bool,
) -> DiskMap:
    """Try one way after the other until a map is near the conformal one, and refine the best.

    Parameters
    ----------
    surface : FactoredSurface
    ways : iterable of callable
        They make harmonic maps, the one to be preferred first; the last always does.
    options : Options
    phase : Phases
    keep_factor : bool
        Whether the surface will be mapped again. If not, refinement, which makes a factor of
        its own, begins by giving back the memory of this one.

    Returns
    -------
    DiskMap

    Raises
    ------
    MapError
        If no map is valid.
    """
    mesh, candidates, rejected, known = surface.mesh, [], [], []
    for way in ways:
        try:
            harmonic = way(phase)
        except Rejected as reason:
            rejected.append(str(reason))
            continue
        known.append(harmonic)
        candidates.append(_normalized(mesh, harmonic, options, phase, MANY_FLIPPED))
        latest = candidates[-1]
        if not (latest.conformality.sheared if options.paper else latest.doubtful(mesh)):
            break
    if all(candidate.conformality.sheared for candidate in candidates):
        candidates += [
            unfolded
            for harmonic, candidate in zip(known, tuple(candidates), strict=True)
            if not candidate.certificate.valid
            for unfolded in _unfolded(mesh, harmonic, candidate, options, phase)
        ]
    first = candidates[0]
    candidates.sort(key=lambda candidate: candidate.rank)
    rivals = _rivals(candidates, first)
    due = [max(options.refine, 0 if options.paper else rival.steps_due) for rival in rivals]
    if any(due) and candidates[0].certificate.valid:
        if not keep_factor:
            surface.release()
        lowered = [
            refined(mesh, rival, surface.order, steps, options, phase) if steps else rival
            for rival, steps in zip(rivals, due, strict=True)
        ]
        # The others are no choice any more: the mean of a refined map may be above theirs, as it
        # is the power mean that was lowered.
        candidates[: len(rivals)] = sorted(lowered, key=lambda candidate: candidate.rank)
    best, *others = candidates
    rejected += dict.fromkeys(other.objection() for other in others)
    for objection in rejected:
        log.info("boundary by %s, rejected %s", best.trace.name, objection)
    best = replace(best, trace=replace(best.trace, rejected=tuple(rejected)))
    result = _disk_map(surface, best, phase)
    if not result.valid:
        raise MapError(
            f"The map is not a bijection onto the disk: {result.certificate}. "
            f"Boundary: {result.trace}. Parts of it may be too small on the disk for double "
            "precision: cut the surface where it is long or branches (cdcp_igl.cut)",
            result,
        )
    if not result.conformal:
        log.warning("the map is not conformal: %s", "; ".join(result.conformality.reasons))
    phase.done()
    return result


def _rivals(candidates: list[Candidate], first: Candidate) -> list[Candidate]:
    """Those of the candidates, best first, that are refined: the best, or all that are near it.

    Which of several bad maps of a coarse mesh leads to the best one shows in the end only.
    """
    best = candidates[0]
    if (best.conformality and first.conformality) or len(best.f) > SMALL:
        return [best]
    worst = (False, HANDICAP * best.rank[1])
    return [candidate for candidate in candidates if candidate.rank <= worst] or [best]


def _normalized(
    mesh: DiskMesh, harmonic: HarmonicMap, options: Options, phase: Phases, share: float
) -> Candidate:
    """Do the second half of Algorithm 1, the Möbius transformation; then repair and judge.

    A transformed map that had to be repaired, or that has moved a small part of the surface away
    from 0, is held against the map without the transformation, and the better one is taken. What
    cannot be repaired cannot without it either: it has the same flipped faces.
    Nothing is repaired if a larger share of the faces is flipped.
    """
    method, repair = options.mobius_method, partial(mend, most=share * len(mesh.F))
    plain = None
    if harmonic.w and method:
        plain = _repaired(mesh, harmonic, options, None, repair, phase)
    if plain and plain.certificate.valid:
        repair = partial(mend, most=0)  # what needs repair now is no improvement
    candidate = _repaired(mesh, harmonic, options, method, repair, phase)
    repaired = candidate.repair.rounds > 0 and candidate.certificate.valid
    if repaired and candidate.mobius.w != harmonic.w and not plain:
        plain = _repaired(mesh, harmonic, options, None, repair, phase)
    price = PRICE_OF_AREA if method == "area" else 1
    if plain and (plain.rank[0], price * plain.rank[1]) < candidate.rank:
        reason = candidate.mobius.rejected or "repair"
        rejected = Normalization(candidate.mobius.method, harmonic.w, reason)
        return replace(plain, mobius=rejected)
    return candidate


def _unfolded(
    mesh: DiskMesh, harmonic: HarmonicMap, failed: Candidate, options: Options, phase: Phases
) -> Iterator[Candidate]:
    """Find valid maps with this boundary at whatever cost, and judge them.

    The interior is replaced, without a Möbius transformation, if the faces that are turned over
    cannot be kept. It is replaced as well if the mesh is small: slivers that are kept may shear
    what is around them.
    """
    with phase("extension"):
        kept = keep_faces(mesh, harmonic, straightened=not options.paper)
    if kept is not harmonic:
        candidate = _normalized(mesh, kept, options, phase, share=MANY)
        yield candidate
        if candidate.certificate.valid and len(mesh.V) > SMALL:
            return
    repaired = embed if failed.repair.rounds else unfold
    candidate = _repaired(mesh, harmonic, options, None, repaired, phase)
    if options.mobius_method is not None:
        rejected = Normalization(options.mobius_method, 0j, "repair")
        candidate = replace(candidate, mobius=rejected)
    yield candidate


def _repaired(
    mesh: DiskMesh,
    harmonic: HarmonicMap,
    options: Options,
    method: MobiusMethod | None,
    repaired: Callable[[DiskMesh, Complex], tuple[Complex, Repair]],
    phase: Phases,
) -> Candidate:
    n_held = 0

    def finished(f: Complex, w: complex) -> Complex:
        nonlocal n_held
        f = rotate(mesh, f, options.align)
        f = harmonic.placed(f, w)
        f, n_held = hold_open(mesh, f)
        return f

    with phase("mobius"):
        f, normalization = normalize(mesh, harmonic.f, method, finished)  # (19), (20)
    normalization = replace(normalization, w=composed(harmonic.w, normalization.w))
    with phase("repair"):
        f, repair = repaired(mesh, f)
    if repair.n_flipped:
        log.info("%s", repair)
    trace = replace(harmonic.boundary.method, n_spread=n_held)
    # What repair leaves behind is in few places.
    known = judged(mesh, f, phase, closely=repair.n_flipped > 0)
    return Candidate(
        f, *known, harmonic.center, trace, harmonic.straightening, normalization, repair
    )


def _disk_map(surface: FactoredSurface, best: Candidate, phase: Phases) -> DiskMap:
    mesh = surface.mesh
    with phase("distortion"):
        distortion = free = AngleDistortion.of(best.degrees)
        if 0 < len(mesh.inscribed) < len(mesh.F):
            free = AngleDistortion.of(np.delete(best.degrees, mesh.inscribed, axis=0))
    conformality = best.conformality
    if not conformality:
        causes = tuple(_causes(best.trace, best.repair, len(mesh.V)))
        conformality = replace(conformality, reasons=conformality.reasons + causes)
    return DiskMap(
        uv=coordinates(best.f),
        mesh=mesh,
        certificate=best.certificate,
        conformality=conformality,
        distortion=distortion,
        distortion_free=free,
        center=best.center,
        trace=best.trace,
        repair=best.repair,
        straightening=best.straightening,
        mobius=best.mobius,
        refinement=best.refinement,
        solver=surface.solver,
        timings=phase.seconds,
    )


def _causes(trace: BoundaryMethod, repair: Repair, n: int) -> Iterator[str]:
    """Say what may have kept a map from being conformal."""
    if trace.name == "arc length":
        yield "the boundary lies by arc length"
        yield from (reason for reason in trace.rejected if "crowding" in reason)
    if trace.reason:
        yield trace.reason
    if repair.n_moved > REPAIRED_SHARE * n:
        yield f"repair of flipped faces moved {repair.n_moved / n:.0%} of the vertices"
