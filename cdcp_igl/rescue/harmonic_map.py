"""A harmonic map before its normalisation, and the record of how a map came about."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from functools import partial
from typing import Any

from ..arrays import Complex, evenly_spaced_rows
from ..solve.factored import FactoredSurface, extended_again, harmonic_extension
from ..steps.center import Center
from ..steps.mobius import Normalization
from .boundary import BoundaryMethod
from .correction import FEW_FACES, Straightening, deep_vertex, is_sheared, recentered, straighten
from .repair import Repair


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
    """

    center: Center
    boundary: BoundaryMethod
    straightening: Straightening = field(default_factory=Straightening)
    mobius: Normalization = field(default_factory=Normalization)
    repair: Repair = field(default_factory=Repair)


def provenance(of: Provenance, **changed: Any) -> Provenance:
    """Return how a map came about, with some of it changed."""
    known = {field.name: getattr(of, field.name) for field in fields(Provenance)}
    return Provenance(**(known | changed))


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
        return is_sheared(f, faces, mesh.angles_of(few)) or deep_vertex(mesh, f, faces) is not None

    def corrected(self, *, straightened: bool) -> HarmonicMap:
        """Take the common shear out if asked to, and move a tiny region deep inside to 0."""
        surface, mesh = self.surface, self.surface.mesh
        f, straightening = self.f, Straightening()
        if straightened:
            f, straightening = straighten(mesh, f, partial(harmonic_extension, surface))
        f, w = recentered(mesh, f, partial(extended_again, surface))
        return HarmonicMap(surface, f, replace(self.done, straightening=straightening), w)
