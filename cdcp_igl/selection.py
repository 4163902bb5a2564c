"""Which map is returned: that of Algorithm 1 if it is good, else the best that the rescue finds."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from .arrays import Complex, coordinates
from .distortion import AngleDistortion
from .rescue.boundary import FALLBACKS, BoundaryMethod, by_inscribed_angles
from .rescue.candidate import Candidate, HarmonicMap, Provenance, judged, refined
from .rescue.collapsed_faces import open_collapsed_faces
from .rescue.repair import Repair, repair_locally, repaired, replace_interior
from .result.base import valid_map
from .result.disk_map import DiskMap
from .solve.factored import FactoredSurface, extended_again, harmonic_extension
from .steps.center import Center
from .steps.circle import Rejected
from .steps.mobius import MobiusMethod, Normalization, composed, normalize, rotate
from .steps.options import Options
from .steps.phases import Phases
from .surface.mesh import DiskMesh

log = logging.getLogger("cdcp_igl")

# If a larger share of the faces is flipped, other maps are tried before repair: on slivers, those
# of the intrinsic Delaunay Laplacian have a hundredth of the flipped faces of the cotangent one.
MANY_FLIPPED = 0.003
# Even area, if it was asked for, may raise the angular distortion by so much.
PRICE_OF_AREA = 1.05
REPAIRED_SHARE = 0.01  # of the vertices; less than that shows in no mean
REMEDY = (
    "Boundary: {0.boundary}. Parts of it may be too small on the disk for double precision: cut "
    "the surface where it is long or branches (cdcp_igl.cut)"
)

Repairing = Callable[[DiskMesh, Complex], tuple[Complex, Repair]]


def is_good(first: Candidate, harmonic: HarmonicMap, options: Options) -> bool:
    """Whether the map of Algorithm 1 needs no rescue."""
    done = options.preset == "paper" or not harmonic.needs_correction
    return done and not _is_doubtful(first, options, harmonic.surface.mesh)


def _is_doubtful(candidate: Candidate, options: Options, mesh: DiskMesh) -> bool:
    """Whether another way to the circle may lead nearer to the conformal map.

    It may if the map is doubtful itself, or if the central face lies at the boundary, where a
    dipole has no room. Errors that the size of the faces explains are no reason.
    """
    if options.preset == "paper":
        return candidate.conformality.sheared
    at_boundary = mesh.on_boundary[mesh.F[candidate.done.center.face]].any()
    return candidate.conformality.is_doubtful or bool(at_boundary)


def inscribed(
    surface: FactoredSurface, center: Center, options: Options, phase: Phases
) -> Candidate:
    """Map a surface without interior vertices, all of whose faces are inscribed in the circle."""
    with phase("circle"):
        f = by_inscribed_angles(surface.mesh)
    done = Provenance(center=center, boundary=BoundaryMethod("inscribed angles"))
    harmonic = HarmonicMap(surface, f, done)
    return _finished(harmonic, options.mobius_method, options, phase, repair_locally)


def rescue(
    surface: FactoredSurface,
    center: Center,
    first: HarmonicMap | Rejected,
    options: Options,
    phase: Phases,
) -> Candidate:
    """Find a better map than the one of Algorithm 1, or one where it has none.

    The boundary by the trace, else by harmonic measure, else by arc length; then the interior
    without flipped faces. The best valid map is returned, or else the best that there is.
    """
    tried: list[tuple[HarmonicMap, Candidate]] = []
    rejected: list[str] = []
    for harmonic in _harmonic_maps(surface, center, first, phase):
        if isinstance(harmonic, Rejected):
            rejected.append(str(harmonic))
            continue
        with phase("extension"):
            harmonic = harmonic.corrected(straightened=options.preset is None)
        candidate = _normalized(harmonic, options, phase)
        tried.append((harmonic, candidate))
        if not _is_doubtful(candidate, options, surface.mesh):
            break
    candidates = [candidate for _, candidate in tried]
    if all(candidate.conformality.sheared for candidate in candidates):
        for harmonic, failed in sorted(tried, key=lambda pair: pair[1].rank):
            if not failed.certificate.valid:
                candidates.append(_repaired_at_any_cost(harmonic, failed, options, phase))
                if candidates[-1].conformality:
                    break
    candidates.sort(key=lambda candidate: candidate.rank)
    best, *others = candidates
    rejected += dict.fromkeys(other.objection() for other in others)
    for objection in rejected:
        log.info("boundary by %s, rejected %s", best.done.boundary.name, objection)
    boundary = replace(best.done.boundary, rejected=tuple(rejected))
    return replace(best, done=replace(best.done, boundary=boundary))


def _harmonic_maps(
    surface: FactoredSurface, center: Center, first: HarmonicMap | Rejected, phase: Phases
) -> Iterator[HarmonicMap | Rejected]:
    """Yield the map of Algorithm 1, then those of other boundaries on the Delaunay Laplacian."""
    yield first
    for name, boundary in FALLBACKS.items():
        try:
            with phase("circle"):
                f_B = boundary(surface, center.face)
        except Rejected as reason:
            yield reason
            continue
        with phase("extension"):
            f = harmonic_extension(surface.delaunay, f_B)  # (10)
            f = extended_again(surface.delaunay, f)
        method = BoundaryMethod(name, laplacian="intrinsic Delaunay")
        yield HarmonicMap(surface.delaunay, f, Provenance(center=center, boundary=method))


def _normalized(harmonic: HarmonicMap, options: Options, phase: Phases) -> Candidate:
    """Apply the Möbius transformation, unless the map is better without it; repair, and judge.

    A transformed map that repair was tried on, which may be in vain, or that has moved a small part
    of the surface away from 0, is held against the map without the transformation.
    """
    repairing = partial(repair_locally, most=MANY_FLIPPED * len(harmonic.surface.mesh.F))
    method = options.mobius_method
    candidate = _finished(harmonic, method, options, phase, repairing)
    if method is None or not (harmonic.w or candidate.done.repair.rounds):
        return candidate
    plain = _finished(harmonic, None, options, phase, repairing)
    price = PRICE_OF_AREA if method == "area" else 1
    if (*plain.rank[:2], price * plain.mean) < candidate.rank:
        given = candidate.done.mobius
        rejected = replace(given, w=harmonic.w, rejected=given.rejected or "repair")
        return replace(plain, done=replace(plain.done, mobius=rejected))
    return candidate


def _repaired_at_any_cost(
    harmonic: HarmonicMap, failed: Candidate, options: Options, phase: Phases
) -> Candidate:
    """Find a valid map with this boundary, without a Möbius transformation."""
    repairing = replace_interior if failed.done.repair.rounds else repaired
    candidate = _finished(harmonic, None, options, phase, repairing)
    if options.mobius_method is not None:
        rejected = Normalization(options.mobius_method, 0j, "repair")
        candidate = replace(candidate, done=replace(candidate.done, mobius=rejected))
    return candidate


def _finished(
    harmonic: HarmonicMap,
    method: MobiusMethod | None,
    options: Options,
    phase: Phases,
    repairing: Repairing,
) -> Candidate:
    """Do the last step of Algorithm 1 and what rounding asks for, repair the map, and judge it."""
    mesh, n_opened = harmonic.surface.mesh, 0

    def placed(f: Complex) -> Complex:
        nonlocal n_opened
        f, n_opened = open_collapsed_faces(mesh, rotate(mesh, f, options.align))
        return f

    with phase("mobius"):
        f, mobius = normalize(mesh, harmonic.f, method, placed)  # (19), (20)
    mobius = replace(mobius, w=composed(harmonic.w, mobius.w))
    with phase("repair"):
        f, repair = repairing(mesh, f)
    if repair.n_flipped:
        log.info("%s", repair)
    boundary = replace(harmonic.done.boundary, n_opened=n_opened)
    done = replace(harmonic.done, boundary=boundary, mobius=mobius, repair=repair)
    return judged(mesh, f, done, phase, closely=repair.n_flipped > 0)


def finish(
    surface: FactoredSurface,
    best: Candidate,
    options: Options,
    phase: Phases,
    *,
    keep_factor: bool,
) -> DiskMap:
    """Refine a map if that is asked for or needed, and say what it is; MapError if it is not valid.

    Unless `keep_factor`, refinement, which makes a factor of its own, begins by giving back the
    memory of the surface's.
    """
    mesh = surface.mesh
    steps = options.refine or 0
    if options.refine != 0 and options.preset is None and len(mesh.interior):
        steps = max(steps, best.steps_due)
    if steps and best.certificate.valid:
        if not keep_factor:
            surface.release()
        best = refined(surface, best, steps, options, phase)
    result = _disk_map(surface, best, phase)
    result = valid_map(result, " onto the disk", REMEDY)
    phase.done()
    return result


def _disk_map(surface: FactoredSurface, best: Candidate, phase: Phases) -> DiskMap:
    mesh, conformality = surface.mesh, best.conformality
    with phase("distortion"):
        distortion = of_free_faces = AngleDistortion.of(best.degrees)
        if 0 < len(mesh.inscribed) < len(mesh.F):
            of_free_faces = AngleDistortion.of(np.delete(best.degrees, mesh.inscribed, axis=0))
    if conformality.reasons:
        causes = tuple(_causes(best.done, len(mesh.V)))
        conformality = replace(conformality, reasons=conformality.reasons + causes)
    return DiskMap(
        uv=coordinates(best.f),
        mesh=mesh,
        certificate=best.certificate,
        conformality=conformality,
        distortion=distortion,
        distortion_of_free_faces=of_free_faces,
        solver=surface.solver,
        timings=phase.seconds,
        **vars(best.done),
    )


def _causes(done: Provenance, n: int) -> Iterator[str]:
    """Say what may have kept a map from being conformal."""
    if done.boundary.name == "arc length":
        yield "the boundary lies by arc length"
        yield from (reason for reason in done.boundary.rejected if "crowding" in reason)
    if done.repair.n_moved > REPAIRED_SHARE * n:
        yield f"repair of flipped faces moved {done.repair.n_moved / n:.0%} of the vertices"
