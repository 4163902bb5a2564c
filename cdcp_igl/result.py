"""What `disk_map` returns: the map and everything one has to know about it."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from .arrays import Floats
from .certificate import Certificate
from .distortion import AngleDistortion
from .steps.center import Center
from .steps.circle import BoundaryMethod
from .steps.conformality import Conformality
from .steps.mobius import Normalization
from .steps.refine import Refinement
from .steps.repair import Repair

__all__ = ["DiskMap"]


@dataclass(frozen=True, eq=False)
class DiskMap:
    """A disk conformal map. Printing it gives a summary.

    Attributes
    ----------
    uv : (n, 2) float64
        Row i is the image of row i of V, in the closed unit disk. Faces are
        counterclockwise; what `align` named, or else the boundary vertex of smallest
        index at (1, 0), lies at angle 0.
    certificate : Certificate
        What was verified about `uv`.
    conformality : Conformality
        Whether the map is what a conformal map of this mesh should be; if not, the reasons
        and what would help.
    distortion : AngleDistortion
        Mean, SD and maximum of the angular distortion (7) in degrees.
    distortion_free : AngleDistortion
        The same without the faces that have all three corners on the boundary: the circle
        fixes their angles, whatever the method. Equal to `distortion` where there are
        none, or no others.
    center : Center
        The central face, sect. 4.1, and how it was found.
    trace : BoundaryMethod
        How the boundary got onto the circle, with all fallbacks.
    repair : Repair
        What was done about faces that the harmonic map had flipped.
    mobius : Normalization
        The Möbius transformation (19) that was applied, or why none was.
    refinement : Refinement or None
        How far the angular distortion was lowered beyond that of the harmonic map;
        None if that was not asked for.
    solver : str
        Sparse solver, version, ordering, mode and number of factorizations.
    timings : dict of str to float
        Seconds per phase.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F, exact = cdcp_igl.datasets.paraboloid(30)
    >>> result = cdcp_igl.disk_map(V, F, align=[1, 0, 0])
    >>> float(abs(result.uv - exact).max()) < 0.01
    True
    """

    uv: Floats
    certificate: Certificate
    conformality: Conformality
    distortion: AngleDistortion
    distortion_free: AngleDistortion
    center: Center
    trace: BoundaryMethod
    repair: Repair
    mobius: Normalization
    refinement: Refinement | None
    solver: str
    timings: dict[str, float]

    @property
    def valid(self) -> bool:
        """True for a bijection onto the polygon inscribed in the unit circle."""
        return self.certificate.valid

    @property
    def conformal(self) -> bool:
        """True for a map that is as conformal as the mesh lets it be, see `conformality`."""
        return bool(self.conformality)

    def __str__(self) -> str:
        phases = ", ".join(f"{name} {seconds:.2f}" for name, seconds in self.timings.items())
        free = self.distortion_free
        return "\n".join(
            [
                f"disk map of {len(self.uv):,} vertices: "
                + ("valid" if self.valid else "NOT VALID")
                + (", NOT CONFORMAL" if self.valid and not self.conformal else ""),
                f"  angular distortion  {self.distortion}",
                *([f"  of free faces       {free}"] if free != self.distortion else []),
                *([] if self.conformal else [f"  conformal           {self.conformality}"]),
                f"  certificate         {self.certificate}",
                f"  center              {self.center}",
                f"  boundary            {self.trace}",
                f"  repair              {self.repair}",
                f"  Möbius              {self.mobius}",
                f"  refinement          {self.refinement or 'not asked for'}",
                f"  solver              {self.solver}",
                f"  seconds             {sum(self.timings.values()):.2f} ({phases})",
            ]
        )

    def report(self) -> dict[str, Any]:
        """Everything but the coordinates, as JSON types."""
        certificate = self.certificate
        return {
            "vertices": len(self.uv),
            "valid": self.valid,
            "conformal": self.conformal,
            "not_conformal_because": list(self.conformality.reasons),
            "remedies": list(self.conformality.remedies),
            "angular_distortion_degrees": asdict(self.distortion),
            "angular_distortion_of_free_faces_degrees": asdict(self.distortion_free),
            "certificate": {
                "finite": certificate.finite,
                "boundary_error": certificate.boundary_error,
                "boundary_monotone": certificate.boundary_monotone,
                "winding_number": certificate.winding_number,
                "flipped_faces": certificate.flipped.tolist(),
                "faces_decided_exactly": certificate.n_exact,
            },
            "center": {"method": self.center.method, "face": self.center.face},
            "boundary": {
                "method": self.trace.name,
                "laplacian": self.trace.laplacian,
                "rejected": list(self.trace.rejected),
                "spread_faces": self.trace.n_spread,
            },
            "repair": {
                "flipped_faces": self.repair.n_flipped,
                "moved_vertices": self.repair.n_moved,
                "rounds": self.repair.rounds,
            },
            "mobius": {
                "method": self.mobius.method,
                "w": [self.mobius.w.real, self.mobius.w.imag],
                "rejected": self.mobius.rejected,
            },
            "refinement": self.refinement and asdict(self.refinement),
            "solver": self.solver,
            "seconds": self.timings,
        }
