"""What `rectangle_map` returns: a map onto a rectangle, with its modulus."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..arrays import Ints
from ..errors import counted
from ..verdict.certificate import Certificate
from .made import PlaneMap


@dataclass(frozen=True, eq=False, repr=False)
class RectangleMap(PlaneMap):
    """A conformal map onto a rectangle. Printing it gives a summary.

    Attributes
    ----------
    uv : (n, 2) float64
        Row i is the image of row i of V, in the rectangle from (0, 0) to (width, 1).
    mesh : DiskMesh
        The surface.
    modulus : float
        Width by height of the exact map, a conformal invariant of the surface with its corners.
    modulus_bounds : (float, float)
        Between which the modulus of the polyhedral surface lies, but for rounding: both
        coordinates are trial functions in Dirichlet's principle. `modulus` is their
        geometric mean.
    width : float
        Of the rectangle: the modulus, or as lower shear and refinement have left it.
    corners : tuple of int
        The vertices at (0, 0), (width, 0), (width, 1) and (0, 1).
    split : (k, 2) int64
        The edges that were split at their middles. `mesh` and `uv` have these after the rows of V,
        and the further halves of faces after those of F; ``to_given`` leaves them out.
    certificate : Certificate
        As of a `DiskMap`, with the sides of the rectangle in place of the circle.
    conformality, distortion, timings
        As of every `Result`; the seconds include those of maps that were not taken, "circle" is
        the map onto the disk.
    boundary : str
        ``"sliding"``: there is no flux across the sides along which a coordinate varies. Or,
        where that does not lead to a conformal map and this distorts less, ``"disk map"``: the
        sides are placed as `disk_map` and elliptic integrals tell, for obtuse faces at a side may
        make vertices on it change places.
    laplacian : str
        ``"cotangent"``; or, where that flipped faces, or its map is not conformal, and this
        distorts less, ``"intrinsic Delaunay"``; or, where no map is conformal, ``"mean value"``:
        shear was lowered from an embedding.
    repair, refinement, solver
        As of a `DiskMap`.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.square(5)
    >>> ends = [-1, -1], [1, -1], [1, 1], [-1, 1]
    >>> corners = [abs(V[:, :2] - end).sum(axis=1).argmin() for end in ends]
    >>> cdcp_igl.rectangle_map(V, F, corners)
    RectangleMap(121 vertices: valid, modulus 1)
    """

    certificate: Certificate
    modulus: float
    modulus_bounds: tuple[float, float]
    width: float
    corners: tuple[int, ...]
    split: Ints = field(default_factory=lambda: np.empty((0, 2), np.int64))

    _kind = "rectangle"
    _plane = "Rectangle"
    _reported = ("modulus", "modulus_bounds", "width", "corners")

    @property
    def change(self) -> str:
        """What was done to the surface, or nothing."""
        edges = counted(len(self.split), "edge", "edges")
        return f"split {edges} between two vertices of a side" if len(self.split) else ""

    def _key_figure(self) -> str:
        return f"modulus {self.modulus:.6g}"

    def _steps(self) -> list[tuple[str, str]]:
        low, high = self.modulus_bounds
        return [
            ("modulus", f"{self.modulus:.8g}, from {low:.8g} to {high:.8g}"),
            ("width", f"{self.width:.6g}"),
            ("boundary", f"{self.boundary}, {self.laplacian} Laplacian"),
            *([("change", self.change)] if self.change else []),
            *super()._steps(),
        ]
