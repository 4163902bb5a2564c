"""Maps onto a figure in the plane that is as large as it is: a rectangle, a free outline."""

from __future__ import annotations

from dataclasses import dataclass

from ..arrays import Floats, Ints
from ..plot.layout import Layout
from ..rescue.repair import Repair
from ..surface.mesh import DiskMesh
from .base import Result


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
