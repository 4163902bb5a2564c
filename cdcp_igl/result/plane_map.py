"""Maps onto a figure in the plane that is as large as it is: a rectangle, a free outline."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

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

    _plane: ClassVar[str]  # what the image is called

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
        return Layout(
            V=mesh.V,
            F=mesh.F,
            uv=(self.uv - [x, y]) / scale,
            vertices=np.arange(len(mesh.V)),
            faces=np.arange(len(mesh.F)),
            plane=self._plane,
            middle=(x, y),
            scale=scale,
            origin=(across, up),
            distortion=self.distortion,
            flipped=len(self.certificate.flipped),
            facts=self._facts(self._subject(), self._key_figure()),
        )
