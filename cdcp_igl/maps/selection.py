"""Which map is returned: that of Algorithm 1 if it is good, else the best that the rescue finds."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from ..arrays import Complex, marked
from ..descent.descent import from_tutte
from ..options import Options
from ..phases import Phases
from ..rescue.boundary import FALLBACKS, STARTS, BoundaryMethod, by_inscribed_angles
from ..rescue.collapsed_faces import open_collapsed_faces
from ..rescue.harmonic_map import HarmonicMap, Provenance
from ..rescue.means import embedding
from ..rescue.repair import Repair, repair_locally, repairable
from ..result.disk_map import DiskMap, judged
from ..solve.factored import FactoredSurface, extended_again, harmonic_extension
from ..steps.center import Center
from ..steps.circle import Rejected
from ..steps.mobius import (
    FREE,
    FREE_SHARE,
    MobiusMethod,
    Normalization,
    at_one,
    composed,
    normalized,
    rotate,
)
from ..surface.mesh import Mesh
from ..surface.triangles import flipped_faces

log = logging.getLogger("cdcp_igl")

# If a larger share of the faces is flipped, other maps are tried before repair: on slivers, those
# of the intrinsic Delaunay Laplacian have a hundredth of the flipped faces of the cotangent one.
MANY_FLIPPED = 0.003
# Even area, if it was asked for, may raise the angular distortion by this share.
PRICE_OF_AREA = 0.05

Repairing = Callable[[Mesh, Complex], tuple[Complex, Repair]]


def is_good(first: DiskMap, harmonic: HarmonicMap, options: Options) -> bool:
    """Whether the map of Algorithm 1 needs no rescue."""
    if options.preset == "paper":
        return not _is_doubtful(first, options)
    stopped = first.mobius.rejected == "flipped faces"  # which repair may mend
    return not (stopped or harmonic.needs_correction or _is_doubtful(first, options))


def _is_doubtful(candidate: DiskMap, options: Options) -> bool:
    """Whether another way to the circle may lead nearer to the conformal map.

    It may if the map is doubtful itself, or if the central face lies at the boundary, where a
    dipole has no room. Errors that the size of the faces explains are no reason.
    """
    if options.preset == "paper":
        return candidate.conformality.sheared
    mesh = candidate.mesh
    at_boundary = mesh.on_boundary[mesh.F[candidate.center.face]].any()
    return candidate.conformality.is_doubtful or bool(at_boundary)


def inscribed(surface: FactoredSurface, center: Center, options: Options, phase: Phases) -> DiskMap:
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
) -> DiskMap:
    """Find a better map than the one of Algorithm 1, or one where it has none.

    The boundary by the trace, else by harmonic measure, else by arc length; flipped faces are
    repaired. The best valid map is returned, or else the best that there is. If it will be refined,
    one other boundary is enough: maps from embeddings, which come next, are better than a third.
    """
    tried: list[tuple[HarmonicMap, DiskMap]] = []
    rejected: list[str] = []
    for harmonic in _harmonic_maps(surface, center, first, phase):
        if isinstance(harmonic, Rejected):
            rejected.append(str(harmonic))
            continue
        enough = options.preset is None and options.refine != 0 and harmonic is not first
        with phase("extension"):
            harmonic = harmonic.corrected(straightened=options.preset is None)
        candidate = _normalized(harmonic, options, phase)
        tried.append((harmonic, candidate))
        if enough or not _is_doubtful(candidate, options):
            break
    candidates = [candidate for _, candidate in tried]
    if all(candidate.conformality.sheared for candidate in candidates):
        for harmonic, failed in sorted(tried, key=lambda pair: pair[1].rank):
            if not (failed.valid or failed.repair.rounds):
                candidates.append(_repaired(harmonic, options, phase))
                if candidates[-1].conformal:
                    break
    if candidates[1:]:  # to rank one alone would take all angles
        candidates.sort(key=lambda candidate: candidate.rank)
    return chosen(candidates, tuple(rejected))


def chosen(candidates: list[DiskMap], rejected: tuple[str, ...]) -> DiskMap:
    """Take the first of several maps, which tells what has been `rejected`, the others included."""
    best, *others = candidates
    why = tuple(dict.fromkeys((*rejected, *map(_objection, others))))
    for objection in why:
        log.info("boundary by %s, rejected %s", best.boundary.name, objection)
    return replace(best, boundary=replace(best.boundary, rejected=why))


def _objection(made: DiskMap) -> str:
    """Say why another map was sought after this one, or taken instead."""
    name = made.boundary.name
    if not made.valid:
        return f"{name}: no certificate"
    verdict = "" if made.conformal else ", not conformal"
    return f"{name}: mean distortion {made.distortion.mean:.2f} degrees{verdict}"


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


def embedded(
    surface: FactoredSurface, center: Center, options: Options, phase: Phases
) -> Iterator[DiskMap | Rejected]:
    """Yield maps that no flipped face keeps from coming near: from embeddings, by lower shear."""
    mesh = surface.mesh
    for name, boundary in STARTS.items():
        f = np.zeros(len(mesh.V), dtype=complex)
        try:
            with phase("circle"):
                f[mesh.loop] = boundary(surface, center.face)
        except Rejected as reason:
            yield reason
            continue
        with phase("repair"):
            start, w = embedding(mesh, f, on_disk=True)
            if len(flipped_faces(start, mesh.F)[0]):
                yield Rejected(f"{name}: it crowds the mean values too much for double precision")
                continue
            f = _sheared_less(mesh, start)
        method = BoundaryMethod(name, laplacian="mean value")
        done = Provenance(center=center, boundary=method)
        # Repair would take long, and an embedding has no need of it.
        yield _normalized(HarmonicMap(surface, f, done, w), options, phase, repaired=0)


def _sheared_less(mesh: Mesh, start: Complex) -> Complex:
    """Lower the shear of an embedding (n,) so that no face is flipped when the map is turned.

    That puts the first boundary vertex at 1, and rounds all coordinates. Where it flips faces that
    are very small, this vertex stays at 1 from the beginning, and nothing is left to turn.
    """
    f, first = from_tutte(mesh, start), mesh.loop[0]
    if len(flipped_faces(at_one(mesh, f, first), mesh.F)[0]):
        f = from_tutte(mesh, at_one(mesh, start, first), marked(len(f), first))
    return f


def _normalized(
    harmonic: HarmonicMap, options: Options, phase: Phases, repaired: float = MANY_FLIPPED
) -> DiskMap:
    """Apply the Möbius transformation, unless the map is better without it; repair, and judge.

    A transformed map that repair was tried on, which may be in vain, or that has moved a small part
    of the surface away from 0, is held against the map without the transformation; but not if few
    vertices were moved, and would be there, too: then the transformation lowers the distortion.
    No more than the share `repaired` of the faces is, or one of few, unless it is 0.
    """
    mesh = harmonic.surface.mesh
    repairing = partial(repair_locally, most=repairable(mesh, repaired) if repaired else 0)
    method = options.mobius_method
    candidate = _finished(harmonic, method, options, phase, repairing)
    moved = candidate.mobius.w != harmonic.w
    if not (moved and (harmonic.w or candidate.repair.rounds)):
        return candidate
    little = candidate.valid and not (harmonic.w or candidate.is_much_repaired)
    if method != "area" and little and len(flipped_faces(harmonic.f, mesh.F)[0]):
        return candidate
    plain = _finished(harmonic, None, options, phase, repairing)
    share = PRICE_OF_AREA if method == "area" else FREE_SHARE
    price = max(share * plain.distortion.mean, np.degrees(FREE))
    if (*plain.rank[:2], plain.distortion.mean + price) < candidate.rank:
        given = candidate.mobius
        rejected = replace(given, w=harmonic.w, rejected=given.rejected or "repair", reached=0.0)
        return replace(plain, mobius=rejected)
    return candidate


def _repaired(harmonic: HarmonicMap, options: Options, phase: Phases) -> DiskMap:
    """Repair also many flipped faces, and do without a Möbius transformation."""
    repairing = partial(repair_locally, most=repairable(harmonic.surface.mesh))
    candidate = _finished(harmonic, None, options, phase, repairing)
    if options.mobius_method is not None:
        rejected = Normalization(options.mobius_method, 0j, "repair", 0.0)
        candidate = replace(candidate, mobius=rejected)
    return candidate


def _finished(
    harmonic: HarmonicMap,
    method: MobiusMethod | None,
    options: Options,
    phase: Phases,
    repairing: Repairing,
) -> DiskMap:
    """Do the last step of Algorithm 1 and what rounding asks for, repair the map, and judge it."""
    mesh = harmonic.surface.mesh

    def placed(f: Complex) -> tuple[Complex, tuple[int, Repair]]:
        f, n_opened = open_collapsed_faces(mesh, rotate(mesh, f, options.align))
        f, repair = repairing(mesh, f)
        return f, (n_opened, repair)

    with phase("mobius"):
        given = mesh, harmonic.f, method, placed
        f, (n_opened, repair), mobius = normalized(*given, repaired=True)  # (19), (20)
    mobius = replace(mobius, w=composed(harmonic.w, mobius.w))
    if repair.n_flipped:
        log.info("%s", repair)
    boundary = replace(harmonic.done.boundary, n_opened=n_opened)
    done = replace(harmonic.done, boundary=boundary, mobius=mobius, repair=repair)
    return judged(mesh, f, done, harmonic.surface.solver, phase)
