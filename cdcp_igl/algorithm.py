"""Algorithm 1, the constructive disk conformal parameterization of Yueh et al."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from .arrays import Complex
from .phases import Phases
from .solve.factored import FactoredSurface, harmonic_extension
from .steps.center import Center, central_face
from .steps.circle import onto_circle
from .steps.mobius import MobiusMethod, normalize
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


def as_printed() -> Steps:
    """Return the steps that follow the paper to the letter."""

    def coldest(surface: FactoredSurface) -> Center:
        return central_face(surface, "heat", well_shaped=False)

    def not_whitened(trace: Complex) -> Complex:
        return onto_circle(trace, zipper=geodesic_map)

    return Steps(coldest, boundary_trace, not_whitened, "nelder-mead")


def harmonic_map(surface: FactoredSurface, steps: Steps, phase: Phases) -> tuple[Center, Complex]:
    """Take all steps of Algorithm 1 but the last: the central face, and the map (n,)."""
    with phase("center"):
        center = steps.center(surface)  # (13)-(15)
    with phase("trace"):
        h_B = steps.trace(surface, center.face)  # Theorem 1, (18)
    with phase("circle"):
        f_B = steps.circle(h_B)  # (1)-(6)
    with phase("extension"):
        return center, harmonic_extension(surface, f_B)  # (10)


def algorithm_1(surface: FactoredSurface, steps: Steps) -> Complex:
    """Map a surface by Algorithm 1 as it stands, (n,): no fallback, no repair, no certificate.

    Raises `Rejected` if the trace gives no map of the boundary onto the circle.
    """
    _, f = harmonic_map(surface, steps, Phases())
    f, _ = normalize(surface.mesh, f, steps.mobius)  # (19), (20)
    return f
