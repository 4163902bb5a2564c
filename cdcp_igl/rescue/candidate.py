"""A map among others: certified, judged, and refined where it is due."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from time import perf_counter

from ..arrays import Complex, Floats, Ints, coordinates
from ..certificate import Certificate, certify
from ..distortion import disk_map_distortion
from ..steps.alignment import rotate
from ..steps.center import Center
from ..steps.mobius import Normalization
from ..steps.options import Options
from ..steps.phases import Phases
from ..surface.mesh import DiskMesh
from .boundary import BoundaryMethod
from .collapsed_faces import hold_open
from .conformality import STRETCHED, Conformality, judge
from .line_search import HALVINGS, THIN
from .refine import Refinement, lower_angle_distortion
from .repair import Repair, mend
from .straightening import Straightening
from .trimming import Trimmed

__all__ = ["SMALL", "Candidate", "judged", "refined"]

log = logging.getLogger("cdcp_igl")

# Where straightening removes more than this share of the distortion, the boundary is a polygon
# so coarse that the harmonic map is not near the conformal one;
COARSE = 0.2
# and so it is where the errors are more than this times what the scale explains. Such maps have
# steps of refinement even if none are asked for.
EXCESS = 1.05
STEPS_DUE = 2
# A map that is not conformal, or whose interior had to be replaced, has more of them, as long as
# one lowers the objective by a share that is worth its time: on a mesh that is not small, after
# a few steps, a larger share.
MUCH_REPAIRED = 0.1  # of the vertices
MOST_STEPS = 100
WORTH, WORTH_LATER = 0.001, 0.003
FEW_STEPS = 20
SMALL = 5_000  # vertices
PATIENT = 12  # halvings of their steps
# If the scale at the vertices explains so many more errors than there are, it jumps from one to
# the next, as that of a conformal map does not.
LEAST_EXCESS = 0.6


@dataclass(frozen=True, eq=False)
class Candidate:
    """A normalised map with what is known of it; `degrees` (m, 3) is its angular distortion."""

    f: Complex
    certificate: Certificate
    degrees: Floats
    conformality: Conformality
    center: Center
    trace: BoundaryMethod
    straightening: Straightening
    mobius: Normalization
    repair: Repair
    refinement: Refinement | None = None

    @property
    def rank(self) -> tuple[bool, float]:
        """Valid maps come first, then those of low mean distortion."""
        return not self.certificate.valid, float(self.degrees.mean())

    @property
    def steps_due(self) -> int:
        """Steps of refinement for a map that is measurably not near the conformal one."""
        replaced = self.repair.n_moved > MUCH_REPAIRED * len(self.f)
        replaced |= self.trace.laplacian == "constrained Delaunay"
        if not self.conformality or replaced:
            return MOST_STEPS
        unlike = self.straightening.gain > COARSE or self.conformality.excess > EXCESS
        return STEPS_DUE if unlike else 0

    def doubtful(self, mesh: DiskMesh) -> bool:
        """Whether another way to the circle may lead nearer to the conformal map.

        Errors that only the size of the faces explains do not say so. What does is shear,
        stretched needles, a scale that jumps, and a centre at the boundary, where a dipole has no
        room, as in a fan around one vertex.
        """
        verdict = self.conformality
        if verdict.sheared or verdict.stretch > STRETCHED or verdict.excess < LEAST_EXCESS:
            return True
        return bool(mesh.on_boundary[mesh.F[self.center.face]].any())

    def objection(self) -> str:
        """Why another map was sought after this one, or taken instead."""
        name = self.trace.name
        if not self.certificate.valid:
            return f"{name}: no certificate"
        verdict = "" if self.conformality else ", not conformal"
        return f"{name}: mean distortion {self.rank[1]:.2f} degrees{verdict}"


def judged(
    mesh: DiskMesh, f: Complex, phase: Phases, *, closely: bool
) -> tuple[Certificate, Floats, Conformality]:
    """Certify a map (n,), measure it, and judge it if it is valid; `closely` as in `judge`."""
    uv = coordinates(f)
    with phase("certificate"):
        certificate, degrees = certify(mesh, uv), disk_map_distortion(mesh, uv)
        if not certificate.valid:
            return certificate, degrees, Conformality(True, ("it is not valid",))
        return certificate, degrees, judge(mesh, f, degrees, closely=closely)


def refined(
    mesh: DiskMesh,
    candidate: Candidate,
    order: Ints,
    steps: int,
    options: Options,
    phase: Phases,
) -> Candidate:
    """Lower the angular distortion beyond that of the harmonic map.

    Where rounding turns faces over at the end, it is done again with steps that leave room.
    """
    deadline = perf_counter() + options.refine_seconds
    least, trimmed = max(options.refine, STEPS_DUE), Trimmed(mesh, candidate.f)

    def enough(taken: int, gain: float) -> bool:
        later = taken >= FEW_STEPS and len(mesh.V) > SMALL
        return taken >= least and gain < (WORTH_LATER if later else WORTH)

    def lowered(thin: float) -> tuple[Complex, Refinement]:
        with phase("refine") as advance:
            f, refinement = lower_angle_distortion(
                trimmed.mesh,
                trimmed.f,
                trimmed.order(order),
                steps,
                options.refine_norm,
                seconds=deadline - perf_counter(),
                halvings=HALVINGS if candidate.conformality else PATIENT,
                thin=thin,
                enough=enough,
                opened=lambda f: hold_open(trimmed.mesh, f)[0],
                advance=advance,
            )
            if refinement.steps:
                # Turned once, at the end: it rounds all coordinates, and small faces feel it.
                f, _ = hold_open(mesh, rotate(mesh, trimmed.completed(f), options.align))
        return f, refinement

    for thin in (0.0, THIN):
        f, refinement = lowered(thin)
        if refinement.stopped:
            log.info("refinement: %s", refinement)
        if refinement.steps == 0:
            return replace(candidate, refinement=refinement)
        with phase("repair"):
            f, repair = mend(mesh, f)
        closely = candidate.repair.n_flipped > 0
        certificate, degrees, conformality = judged(mesh, f, phase, closely=closely)
        if certificate.valid:
            break
    else:
        undone = replace(refinement, steps=0, stopped="no certificate", after=refinement.before)
        return replace(candidate, refinement=undone)
    if candidate.trace.reason and conformality:  # low errors do not undo the shortening
        shortened = ("remote parts are shortened",)
        conformality = replace(candidate.conformality, reasons=shortened)
    n_moved = max(candidate.repair.n_moved, repair.n_moved)
    return replace(
        candidate,
        f=f,
        certificate=certificate,
        degrees=degrees,
        conformality=conformality,
        refinement=refinement,
        repair=replace(candidate.repair, n_moved=n_moved),
    )
