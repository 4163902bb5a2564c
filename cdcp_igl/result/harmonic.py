"""Bases of results other than those onto the disk, and how their maps are refined."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Any, ClassVar, TypeVar

from ..arrays import Complex, Floats, Ints
from ..distortion import AngleDistortion
from ..plot.layout import Layout
from ..rescue.candidate import angles_lowered, steps_due
from ..rescue.conformality import judge
from ..rescue.figures import Figure
from ..rescue.refine import Refinement
from ..rescue.repair import Repair
from ..steps.options import Options
from ..steps.phases import Phases
from ..surface.mesh import DiskMesh
from .base import Result


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class RefinedMap(Result):
    """A harmonic map, with what was done about flipped faces, and about the distortion."""

    mesh: DiskMesh
    repair: Repair
    refinement: Refinement | None
    solver: str

    _reported: ClassVar[tuple[str, ...]] = ()  # attributes that only this kind of map has

    def _steps(self) -> list[tuple[str, str]]:
        return [
            ("repair", str(self.repair)),
            ("refinement", str(self.refinement or "not asked for")),
            ("solver", self.solver),
        ]

    def _details(self) -> dict[str, Any]:
        return {
            **{name: getattr(self, name) for name in self._reported},
            "repair": asdict(self.repair),
            "refinement": self.refinement and asdict(self.refinement),
            "solver": self.solver,
        }


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class PlaneMap(Result):
    """A map (n, 2) of a disk, scaled into the unit square by its larger side where it is packed."""

    uv: Floats
    mesh: DiskMesh
    boundary: str
    laplacian: str
    repair: Repair
    solver: str

    def packed(self) -> Floats:
        """Return the image scaled into the unit square, (n, 2): texture coordinates."""
        low, size = self._box
        return (self.uv - low) / size.max()

    @property
    def _box(self) -> tuple[Floats, Floats]:
        """Lower left corner and size of the image."""
        low = self.uv.min(axis=0)
        return low, self.uv.max(axis=0) - low

    def _surface(self) -> tuple[Floats, Ints]:
        return self.mesh.positions, self.mesh.F

    def _layout(self) -> Layout:
        mesh, (low, size) = self.mesh, self._box
        scale = float(size.max() / 2)
        x, y = (low + size / 2).tolist()
        across, up = (size / (4 * scale)).tolist()
        uv, place = (self.uv - [x, y]) / scale, {"middle": (x, y), "origin": (across, up)}
        return self._drawn(mesh.V, mesh.F, uv, self._key_figure(), scale=scale, **place)


def fields_of(
    mesh: DiskMesh,
    f: Complex | Floats,
    degrees: Floats,
    certificate: Any,
    repair: Repair,
    given: int | None = None,
) -> dict[str, Any]:
    """Judge a map with angular distortion `degrees` (m, 3): the fields of a result that say so.

    The distortion is that of the first faces, as many as were `given`, if others fill holes.
    """
    closely = repair.n_flipped > 0
    return {
        "mesh": mesh,
        "certificate": certificate,
        "distortion": AngleDistortion.of(degrees[:given]),
        "conformality": judge(mesh, f, degrees, valid=certificate.valid, closely=closely),
        "repair": repair,
    }


Kind = TypeVar("Kind", bound=RefinedMap)


def steps_of(plain: RefinedMap, options: Options) -> int:
    """Count the steps of refinement of a map: as many as are asked for, or are due."""
    if not plain.valid or options.refine == 0:
        return 0
    due = steps_due(plain.conformality, plain.repair.n_moved / len(plain.mesh.V))
    return max(options.refine or 0, due)


def refined(
    plain: Kind,
    f: Complex,
    figure: Figure,
    order: Ints,
    steps: int,
    finished: Callable[[Complex], Kind],
    options: Options,
    phase: Phases,
) -> Kind:
    """Lower the angular distortion of a valid map by so many steps.

    It is f (n,) in the coordinate of its `figure`; `finished` repairs and certifies such a map. If
    that is not valid, the plain one is returned. For `order` see `lower_angle_distortion`.
    """
    f, refinement = angles_lowered(
        plain.mesh, f, plain.conformality, order, steps, options, phase, figure=figure
    )
    if refinement.steps == 0:
        return replace(plain, refinement=refinement)
    lowered = finished(f)
    if not lowered.valid:
        return replace(plain, refinement=refinement.undone("no certificate"))
    n_moved = max(plain.repair.n_moved, lowered.repair.n_moved)
    return replace(lowered, refinement=refinement, repair=replace(plain.repair, n_moved=n_moved))
