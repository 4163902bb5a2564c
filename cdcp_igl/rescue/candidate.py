"""A map among others: what was done for it, its certificate, and how conformal it is."""

from __future__ import annotations

import logging
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from ..arrays import Complex, Floats, Ints, evenly_spaced_rows
from ..certificate import Certificate, certify_disk
from ..distortion import map_distortion
from ..solve.factored import FactoredSurface, extended_again, harmonic_extension
from ..steps.center import Center
from ..steps.mobius import Normalization, rotate
from ..steps.options import Options
from ..steps.phases import Phases
from ..surface.mesh import DiskMesh
from .boundary import BoundaryMethod
from .collapsed_faces import open_collapsed_faces
from .conformality import LARGEST_DEGREES, Conformality, judge
from .correction import FEW_FACES, Straightening, deep_vertex, is_sheared, recentered, straighten
from .refine import HALVINGS, STEPS_DUE, Refinement, lower_angle_distortion
from .repair import Repair, repair_locally

log = logging.getLogger("cdcp_igl")

# A harmonic map is refined, even if no steps are asked for, where it is not near the conformal one:
# straightening has removed more than the share COARSE of the distortion, as the boundary has few
# vertices, or the errors are more than EXCESS times what the scale explains.
COARSE = 0.2
EXCESS = 1.05
# A map that is not conformal, or in which repair has moved more than this share of the vertices,
# is refined by up to MOST_STEPS, each halved up to PATIENT times. They are counted, not timed, as
# equal inputs have equal outputs; they take most of the time of a surface that is hard.
MUCH_REPAIRED = 0.1
MOST_STEPS = 60
PATIENT = 12


@dataclass(frozen=True, kw_only=True)
class Provenance:
    """How a map came about.

    Attributes
    ----------
    center : Center
        The central face, sect. 4.1, and how it was found.
    boundary : BoundaryMethod
        How the boundary got onto the circle, with all fallbacks.
    straightening : Straightening
        What was done about the shear that all faces have in common.
    mobius : Normalization
        The Möbius transformation (19) that was applied, or why none was.
    repair : Repair
        What was done about faces that the harmonic map had flipped.
    refinement : Refinement or None
        How far the angular distortion was lowered beyond that of the harmonic map;
        None if no step was asked for and none was due.
    """

    center: Center
    boundary: BoundaryMethod
    straightening: Straightening = field(default_factory=Straightening)
    mobius: Normalization = field(default_factory=Normalization)
    repair: Repair = field(default_factory=Repair)
    refinement: Refinement | None = None


@dataclass(frozen=True, eq=False)
class HarmonicMap:
    """A map before its Möbius transformation.

    Attributes
    ----------
    surface : FactoredSurface
        Whose Laplacian it is harmonic for.
    f : (n,) complex128
    done : Provenance
    w : complex
        The point that has gone to 0, lest what is around it be too small; 0 if none has.
    """

    surface: FactoredSurface
    f: Complex
    done: Provenance
    w: complex = 0j

    @property
    def needs_correction(self) -> bool:
        """Whether `corrected` has anything to do."""
        mesh, f = self.surface.mesh, self.f
        few = evenly_spaced_rows(len(mesh.F), FEW_FACES)
        faces = mesh.F[few]
        return is_sheared(f, faces, mesh.angles[few]) or deep_vertex(mesh, f, faces) is not None

    def corrected(self, *, straightened: bool) -> HarmonicMap:
        """Take the common shear out if asked to, and move a tiny region deep inside to 0."""
        surface, mesh = self.surface, self.surface.mesh
        f, straightening = self.f, Straightening()
        if straightened:
            f, straightening = straighten(mesh, f, partial(harmonic_extension, surface))
        f, w = recentered(mesh, f, partial(extended_again, surface))
        return HarmonicMap(surface, f, replace(self.done, straightening=straightening), w)


@dataclass(frozen=True, eq=False)
class Candidate:
    """A normalised map with what is known of it; `degrees` (m, 3) is its angular distortion."""

    f: Complex
    done: Provenance
    certificate: Certificate
    degrees: Floats
    conformality: Conformality

    @property
    def mean(self) -> float:
        """Mean angular distortion in degrees."""
        return float(self.degrees.mean())

    @property
    def rank(self) -> tuple[bool, bool, float]:
        """Valid maps come first, of these the conformal ones, then those of low mean distortion."""
        return not self.certificate.valid, not self.conformality, self.mean

    @property
    def steps_due(self) -> int:
        """As `steps_due`."""
        share = self.done.repair.n_moved / len(self.f)
        return steps_due(self.conformality, share, self.done.straightening.gain)

    def objection(self) -> str:
        """Why another map was sought after this one, or taken instead."""
        name = self.done.boundary.name
        if not self.certificate.valid:
            return f"{name}: no certificate"
        verdict = "" if self.conformality else ", not conformal"
        return f"{name}: mean distortion {self.mean:.2f} degrees{verdict}"


def steps_due(conformality: Conformality, repaired: float, straightened: float = 0.0) -> int:
    """Count the steps for a map that is measurably not near the conformal one.

    Repair has moved the share `repaired` of its vertices; straightening has taken out the share
    `straightened` of its distortion.
    """
    if conformality.reasons or repaired > MUCH_REPAIRED:
        return MOST_STEPS
    return STEPS_DUE if straightened > COARSE or conformality.excess > EXCESS else 0


def judged(
    mesh: DiskMesh,
    f: Complex,
    done: Provenance,
    phase: Phases,
    *,
    closely: bool = False,
    known: float = 0.0,
) -> Candidate:
    """Certify a map (n,), measure it, and judge it; the options as in `judge`."""
    with phase("certificate"):
        certificate, degrees = certify_disk(mesh, f), map_distortion(mesh, f)
        valid = certificate.valid
        conformality = judge(mesh, f, degrees, valid=valid, closely=closely, known=known)
        return Candidate(f, done, certificate, degrees, conformality)


def refined(
    surface: FactoredSurface,
    candidate: Candidate,
    steps: int,
    options: Options,
    phase: Phases,
) -> Candidate:
    """Lower the angular distortion beyond that of the harmonic map.

    No step takes a map that is conformal to one that is not. Where rounding at the end does, or
    flips faces, the candidate stays.
    """
    mesh = surface.mesh
    f, done, verdict = candidate.f, candidate.done, candidate.conformality
    conformal, known = bool(verdict), 0.0 if verdict.sheared else candidate.mean
    closely = done.repair.n_flipped > 0

    def no_less_conformal(f: Complex, r: Floats) -> bool:
        nonlocal conformal, known
        degrees, before = np.degrees(abs(r)), conformal
        mean = float(degrees.mean())
        conformal = mean <= LARGEST_DEGREES and bool(
            judge(mesh, f, degrees, closely=closely, known=known)
        )
        if conformal:
            known = max(known, mean)
        return conformal or not before

    f, refinement = angles_lowered(
        *(mesh, f, verdict, surface.rows, steps, options, phase),
        analysis=surface.analysis,
        near=not candidate.steps_due,
        accepted=no_less_conformal,
    )
    if refinement.stopped:
        log.info("refinement: %s", refinement)
    if refinement.steps == 0:
        return replace(candidate, done=replace(done, refinement=refinement))
    with phase("repair"):
        # Rotated only once, at the end: a rotation rounds all coordinates.
        f, _ = open_collapsed_faces(mesh, rotate(mesh, f, options.align))
        f, repair = repair_locally(mesh, f)
    n_moved = max(done.repair.n_moved, repair.n_moved)
    lowered = replace(done, refinement=refinement, repair=replace(done.repair, n_moved=n_moved))
    better = judged(mesh, f, lowered, phase, closely=closely, known=known)
    if better.rank[:2] <= candidate.rank[:2]:
        return better
    stopped = "not conformal" if better.certificate.valid else "no certificate"
    return replace(candidate, done=replace(done, refinement=refinement.undone(stopped)))


def angles_lowered(
    mesh: DiskMesh,
    f: Complex,
    conformality: Conformality,
    order: Ints,
    steps: int,
    options: Options,
    phase: Phases,
    **more: Any,
) -> tuple[Complex, Refinement]:
    """Call `lower_angle_distortion` by the options and the verdict on a map (n,), and as told."""
    with phase("refine") as advance:
        by_options: dict[str, Any] = {
            "seconds": options.refine_seconds,
            "halvings": PATIENT if steps >= MOST_STEPS else HALVINGS,
            "least": options.refine or STEPS_DUE,
            "wanted": conformality.wanted,
            "advance": advance,
        }
        return lower_angle_distortion(
            mesh, f, order, steps, options.refine_norm, **(by_options | more)
        )
