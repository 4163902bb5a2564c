"""Algorithm 1, the constructive disk conformal parameterization of Yueh et al."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial

from .arrays import Complex
from .options import Options
from .phases import Phases
from .rescue.boundary import BoundaryMethod
from .rescue.harmonic_map import HarmonicMap, Provenance
from .solve.factored import FactoredSurface, harmonic_extension
from .steps.center import Center, central_face
from .steps.circle import onto_circle
from .steps.mobius import MobiusMethod, Normalization, normalize
from .steps.trace import boundary_trace, conjugate_trace
from .steps.zipper import geodesic_map


@dataclass(frozen=True)
class Steps:
    """The steps of Algorithm 1 that can be taken in more than one way.

    They are the central face, sect. 4.1; the boundary trace (nB,) for a surface and its central
    face, Theorem 1; the trace onto the circle, eqs. (1)-(6), which raises `Rejected` where that
    fails; and what the Möbius transformation minimises, eqs. (19)-(20).
    """

    center: Callable[[FactoredSurface], Center] = central_face
    trace: Callable[[FactoredSurface, int], Complex] = conjugate_trace
    circle: Callable[[Complex], Complex] = onto_circle
    mobius: MobiusMethod | None = "angle"

    @classmethod
    def of(cls, options: Options) -> Steps:
        """Choose the steps that the options of `disk_map` ask for."""
        if options.preset == "paper":
            coldest = cache(partial(central_face, center="heat", well_shaped=False))
            circle = partial(onto_circle, zipper=geodesic_map)
            return cls(coldest, boundary_trace, circle, "nelder-mead")
        center = cache(partial(central_face, center=options.center))
        return cls(center, mobius=options.mobius_method)


def algorithm_1(
    surface: FactoredSurface,
    steps: Steps,
    phase: Phases | None = None,
    harmonic: HarmonicMap | None = None,
) -> tuple[HarmonicMap, Complex, Normalization]:
    """Algorithm 1 as it stands: no fallback, no repair, no certificate.

    `harmonic` is what the first four steps give, if that is known. Returns it, f (n,) after the
    Möbius transformation, and what that was. Raises `Rejected` if the trace gives no map of the
    boundary onto the circle.
    """
    phase = phase or Phases()
    if harmonic is None:
        with phase("center"):
            center = steps.center(surface)  # (13)-(15)
        with phase("trace"):
            h_B = steps.trace(surface, center.face)  # Theorem 1, (18)
        with phase("circle"):
            f_B = steps.circle(h_B)  # (1)-(6)
        with phase("extension"):
            f = harmonic_extension(surface, f_B)  # (10)
        done = Provenance(center=center, boundary=BoundaryMethod("geodesic"))
        harmonic = HarmonicMap(surface, f, done)
    with phase("mobius"):
        f, mobius = normalize(surface.mesh, harmonic.f, steps.mobius)  # (19), (20)
    return harmonic, f, mobius
