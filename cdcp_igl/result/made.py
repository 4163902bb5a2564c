"""Results of one mesh: what they have in common, and what is common of those in the plane."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..arrays import Complex, Floats, Ints, as_complex, coordinates, size_exponent
from ..cached import cached_property
from ..plot.layout import Layout
from ..records import BoundaryMethod, Refinement, Repair
from ..surface.mesh import Mesh
from ..verdict.distortion import AngleDistortion, reported_distortion
from .base import how_made
from .bijection import Bijection


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class MadeMap(Bijection):
    """A map of one mesh, with what was done about flipped faces, and about the distortion."""

    mesh: Mesh
    repair: Repair
    refinement: Refinement | None = None
    solver: str

    _reported: ClassVar[tuple[str, ...]] = ()  # attributes that only this kind of map has

    @property
    @abstractmethod
    def _from_tutte(self) -> bool:
        """Whether the map began with a Tutte embedding."""

    @property
    def _straightened(self) -> bool:
        """Whether a common shear was taken out of the map."""
        return False

    @cached_property
    def distortion(self) -> AngleDistortion:
        """Mean, SD and maximum of the angular distortion of the given faces."""
        return AngleDistortion.of(self._degrees())

    def _degrees(self) -> Floats:
        """(m, 3) angular distortion of the given faces."""
        F = self._surface()[1]
        flipped = self.certificate.flipped
        return reported_distortion(self.mesh.scaled, F, self._images, flipped[flipped < len(F)])

    @property
    def side(self) -> str:
        """As of every `Result`; of an open surface in space nothing can be known."""
        return "" if self.mesh.loops and np.ptp(self.mesh.scaled[:, 2]) else super().side

    @property
    def _faces(self) -> Ints:
        return self.mesh.F

    def _steps(self) -> list[tuple[str, str]]:
        return [
            ("repair", str(self.repair)),
            ("refinement", str(self.refinement or "not asked for")),
            ("solver", self.solver),
        ]

    def _details(self) -> dict[str, Any]:
        plain = {name: getattr(self, name) for name in self._reported}
        return {name: list(x) if isinstance(x, tuple) else x for name, x in plain.items()}


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class ComplexMap(MadeMap):
    """A map of one mesh into the plane: complex inside, in the unit of the engine."""

    _f: Complex

    @cached_property
    def uv(self) -> Floats:  # type: ignore[override]
        """(n, 2) the images of the vertices."""
        return coordinates(self._f)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class PlaneMap(ComplexMap):
    """A map (n, 2) of a disk, scaled into the unit square by its larger side where it is packed."""

    boundary: str
    laplacian: str

    _inscribed = False

    @property
    def _from_tutte(self) -> bool:
        return self.laplacian == "mean value"

    def _made(self) -> dict[str, Any]:
        return how_made(self, BoundaryMethod(self.boundary, laplacian=self.laplacian), "none")

    def packed(self) -> Floats:
        """Return the image scaled into the unit square, (n, 2): texture coordinates."""
        low, size = self._box
        return (self.uv - low) / size.max()

    @property
    def _box(self) -> tuple[Floats, Floats]:
        """Lower left corner and size of the image."""
        low = self.uv.min(axis=0)
        return low, self.uv.max(axis=0) - low

    def _in_plane(self, points: Floats) -> Complex:
        # In a unit in which the coordinates of the map are at most 1, exactly.
        return as_complex(np.ldexp(points, -size_exponent(self.uv)))

    def _surface(self) -> tuple[Floats, Ints]:
        return self.mesh.V, self.mesh.F

    def _layout(self) -> Layout:
        mesh, (low, size) = self.mesh, self._box
        scale = float(size.max() / 2)
        x, y = (low + size / 2).tolist()
        across, up = (size / (4 * scale)).tolist()
        uv, place = (self.uv - [x, y]) / scale, {"middle": (x, y), "origin": (across, up)}
        F = self._upward_faces
        return self._drawn(mesh.scaled, F, uv, self._key_figure(), scale=scale, **place)

    @property
    def _upward_faces(self) -> Ints:
        """The faces, counterclockwise in the image."""
        return self.mesh.F
