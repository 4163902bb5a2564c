"""What `annulus_map` returns: a map onto a ring, with its modulus."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..arrays import Floats, Ints, coordinates
from ..cached import cached_property
from ..errors import counted
from ..plot.layout import Layout
from ..records import BoundaryMethod
from ..surface.mesh import AnnulusMesh
from ..verdict.certificate import Certificate
from .base import how_made
from .made import ComplexMap


@dataclass(frozen=True, eq=False, repr=False)
class AnnulusMap(ComplexMap):
    """A conformal map onto a ring around 0. Printing it gives a summary.

    Attributes
    ----------
    uv : (n, 2) float64
        Row i is the image of row i of V, between the circles of radius `radius` and 1; few corners
        of a hole may lie on one half of its circle, and vertices between that and their chords.
        The vertex of smallest index of the loop that reaches farthest lies at (1, 0).
    mesh : AnnulusMesh
        The surface; holes that were filled come last.
    modulus : float
        log(1 / inner radius) / (2 pi) of the exact map, a conformal invariant of the surface: of
        a cylinder, its length by its circumference.
    modulus_bounds : (float, float)
        Between which the modulus of the polyhedral surface lies, but for rounding: the logarithm
        of the radius and the angle are trial functions in Dirichlet's principle. `modulus` is
        their geometric mean.
    radius : float
        Of the inner circle. Its logarithm is near -2 pi times the modulus: such that all that flows
        through the one flows around the other, or as refinement has left it.
    boundary : str
        ``"flux"``: angles on the loops are what flows through them. Where that leaves flipped
        faces, or is not conformal even if refined, the outer loop begins by arc length, in an
        embedding of the disk that is there when the hole is filled: ``"arc length, hole filled"``.
        The best one is taken.
    filled : int
        Boundary loops beyond two that were filled; those faces are not in the results.
    certificate : Certificate
        As of a `DiskMap`, with both circles in place of one: errors are relative to the radius.
    conformality, distortion, repair, refinement, solver, timings
        As of a `DiskMap`.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.spherical_cap(10)
    >>> cdcp_igl.annulus_map(V[1:], F[F.min(axis=1) > 0] - 1).filled
    0
    """

    mesh: AnnulusMesh
    modulus: float
    modulus_bounds: tuple[float, float]
    radius: float
    boundary: str
    filled: int
    certificate: Certificate
    _size_given: tuple[int, int]

    _kind = "annulus"
    _plane = "Ring"
    _reported = ("modulus", "modulus_bounds", "radius", "filled")

    @cached_property
    def uv(self) -> Floats:  # type: ignore[override]
        """(n, 2) the images of the vertices that were given; others fill holes."""
        return coordinates(self._f[: self._size_given[0]])

    @property
    def _from_tutte(self) -> bool:
        return "filled" in self.boundary

    def _made(self) -> dict[str, Any]:
        return how_made(self, BoundaryMethod(self.boundary), "none")

    def packed(self) -> Floats:
        """Return the square around the ring, scaled to the unit square: texture coordinates."""
        return (self.uv + 1) / 2

    def _key_figure(self) -> str:
        return f"modulus {self.modulus:.6g}"

    def _steps(self) -> list[tuple[str, str]]:
        low, high = self.modulus_bounds
        filled = [("change", f"filled {counted(self.filled, 'hole', 'holes')}")]
        return [
            ("modulus", f"{self.modulus:.8g}, from {low:.8g} to {high:.8g}"),
            ("inner radius", f"{self.radius:.6g}"),
            ("boundary", self.boundary),
            *(filled if self.filled else []),
            *super()._steps(),
        ]

    def _surface(self) -> tuple[Floats, Ints]:
        return self.mesh.V[: len(self.uv)], self._faces

    @property
    def _faces(self) -> Ints:
        return self.mesh.F[: self._size_given[1]]

    def _layout(self) -> Layout:
        V = self.mesh.scaled[: len(self.uv)]
        return self._drawn(V, self._faces, self.uv, self._key_figure())
