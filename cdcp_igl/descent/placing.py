"""A map that has been moved is placed again: repaired, certified and judged."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ..arrays import Complex, Floats, coordinates
from ..phases import Phases
from ..records import Repair
from ..surface.mesh import Mesh
from ..verdict.certificate import certify_disk
from ..verdict.conformality import judge
from ..verdict.distortion import map_distortion
from ..verdict.outline import OutlineCertificate, certify_outline, meeting_edges
from .collapsed_faces import open_collapsed_faces
from .repair import repair_locally

# A boundary that touches itself, or nearly so, as both sides of a slit do, is set apart by so much
# of its size: the least that rounding lets be, in a square in which there are other charts.
APART = (1e-12, 1e-11, 1e-10)


def judged(
    mesh: Mesh,
    f: Complex | Floats,
    degrees: Floats,
    certificate: Any,
    repair: Repair,
    known: float = 0.0,
) -> dict[str, Any]:
    """Judge a map with angular distortion `degrees` (m, 3): the fields of a result that say so.

    For `known` see `judge`.
    """
    closely = repair.n_flipped > 0
    verdict = judge(mesh, f, degrees, valid=certificate.valid, closely=closely, known=known)
    return {"mesh": mesh, "certificate": certificate, "conformality": verdict, "repair": repair}


def moved_on_disk(
    mesh: Mesh, f: Complex, before: Repair, phase: Phases, known: float = 0.0
) -> dict[str, Any]:
    """Place a map onto the disk that has been moved to f (n,): fields of a result.

    They tell of the repair `before`, and of the vertices that have been moved by either.
    """
    with phase("repair"):
        f, _ = open_collapsed_faces(mesh, f)
        f, again = repair_locally(mesh, f)
        repair = replace(before, n_moved=max(before.n_moved, again.n_moved))
    with phase("certificate"):
        degrees, certificate = map_distortion(mesh, f), certify_disk(mesh, f)
        fields = judged(mesh, f, degrees, certificate, repair, known)
    return {**fields, "_f": f, "timings": phase.seconds}


def moved_in_plane(mesh: Mesh, f: Complex, phase: Phases, *, pinned: bool) -> dict[str, Any]:
    """Place a map into the plane that has been moved to f (n,): fields of a result.

    Its centroid is moved to 0, unless vertices are `pinned`.
    """
    with phase("repair"):
        f, certificate = set_apart(mesh, f if pinned else centered(mesh, f))
        f, repair = repair_locally(mesh, f, len(mesh.F) if len(certificate.flipped) else 0)
        if repair.n_flipped and not pinned:
            f = centered(mesh, f)
    return judged_in_plane(mesh, f, certify_outline(mesh, coordinates(f)), repair, phase)


def judged_in_plane(
    mesh: Mesh,
    f: Complex,
    certificate: OutlineCertificate,
    repair: Repair,
    phase: Phases,
    known: float = 0.0,
) -> dict[str, Any]:
    """Measure and judge a map (n,) with a free boundary: fields of a result."""
    with phase("certificate"):
        fields = judged(mesh, f, map_distortion(mesh, f), certificate, repair, known)
        outline = f[mesh.loop]
        area = (outline.conj() * np.roll(outline, -1)).imag.sum() / 2
    ratio = float(area / mesh.vertex_areas.sum())
    return {**fields, "_f": f, "area_ratio": ratio, "timings": phase.seconds}


def centered(mesh: Mesh, f: Complex) -> Complex:
    """Move a map (n,) until the centroid of the surface is at 0."""
    return f - np.average(f, weights=mesh.vertex_areas)


def set_apart(mesh: Mesh, f: Complex) -> tuple[Complex, OutlineCertificate]:
    """Certify a map (n,); one whose outline only touches itself, its sides set apart.

    So near as to touch are sides that rounding may let cross when the map is moved.
    """
    certificate = touching = certify_outline(mesh, coordinates(f))
    if not touching.finite:
        return f, touching
    outline = f[mesh.loop]
    along = np.exp(1j * np.angle(np.roll(outline, -1) - outline))
    inward = 1j * (along + np.roll(along, 1)) / 2 * abs(outline).max()
    if not (len(touching.meeting) or len(meeting_edges(outline - APART[0] * inward))):
        return f, touching
    for share in APART:
        apart = f.copy()
        apart[mesh.loop] += share * inward
        certificate = certify_outline(mesh, coordinates(apart))
        if certificate.simple:
            return apart, certificate
    return f, touching
