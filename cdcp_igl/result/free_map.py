"""What `free_map` returns: a map with a free boundary, in the unit of the surface."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..arrays import Bools, Complex, Floats, Ints, coordinates, marked
from ..cached import cached_property
from ..descent.placing import moved_in_plane
from ..descent.targets import PLANE
from ..errors import counted
from ..phases import Phases
from ..verdict.outline import OutlineCertificate
from .keeping import KeepingMap
from .made import PlaneMap


@dataclass(frozen=True, eq=False, repr=False)
class FreeMap(KeepingMap, PlaneMap):
    """A conformal map with a free outline. Printing it gives a summary.

    Attributes
    ----------
    uv : (n, 2) float64
        Row i is the image of row i of V, in the unit of V. The outline is as long as the boundary,
        or as the lengths that were asked for; a map that keeps lengths has a size of its own. The
        centroid of the surface is at (0, 0), unless pins hold vertices; what `align` named lies to
        its right.
    mesh : DiskMesh
        The surface.
    mirrored : bool
        True of a plane mesh that is clockwise: what is flat keeps its shape, and its faces are
        clockwise in the map, too.
    certificate : OutlineCertificate
        What was verified about `uv`, or its mirror image: no face is flipped, the outline is
        simple.
    conformality, distortion, timings
        As of every `Result`; the seconds include those of maps that were not taken.
    area_ratio : float
        Area of the image by that of the surface.
    pins : (k,) int64
        Vertices that are where they were told to be; `continued` leaves them there.
    boundary : str
        ``"own lengths"``, ``"given scale"`` or ``"given angles"``. Where the outline would
        overlap itself, or flipped faces be left: ``"eased by 25%"``, so far towards the lengths
        that it has on the disk; or ``"eased from the disk"``, from which shear was lowered with
        the outline free.
    laplacian : str
        ``"cotangent"``; or, where that gives no valid map, or none that is conformal,
        ``"intrinsic Delaunay"``.
    repair : Repair
        What was done about flipped faces.
    refinement : Refinement or None
        How far the angular distortion was lowered, with the outline free to change; None if no
        step was asked for and none was due.
    solver : str
        Sparse solver, version and ordering.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.spherical_cap(20)
    >>> result = cdcp_igl.free_map(V, F)
    >>> result.valid, result.boundary
    (True, 'own lengths')
    """

    certificate: OutlineCertificate
    area_ratio: float
    mirrored: bool = False
    pins: Ints = field(default_factory=lambda: np.empty(0, np.int64))

    _kind = "free"
    _plane = "Plane"
    _reported = ("area_ratio",)

    _target = PLANE

    def _moved(self, f: Complex, phase: Phases) -> FreeMap:
        return replace(self, **moved_in_plane(self.mesh, f, phase, pinned=len(self.pins) > 0))

    @property
    def _held(self) -> Bools | None:
        return marked(len(self.mesh.scaled), self.pins) if len(self.pins) else None

    def _unfolded(self) -> tuple[Floats, Ints, Floats]:
        return self.mesh.V, self._upward_faces, self.uv

    @property
    def _upward_faces(self) -> Ints:
        return self.mesh.F[:, :: -1 if self.mirrored else 1]

    def _in_plane(self, points: Floats) -> Complex:
        return self._upwards(super()._in_plane(points))

    @cached_property
    def uv(self) -> Floats:  # type: ignore[override]
        """(n, 2) the images of the vertices, in the unit of V."""
        return self.mesh.in_given_unit(coordinates(self._upwards(self._f)))

    def _upwards(self, f: Complex) -> Complex:
        """Go from the plane of `uv` to the one in which faces are counterclockwise, or back."""
        return f.conj() if self.mirrored else f

    @property
    def _turned(self) -> bool:
        return self.mirrored

    def _steps(self) -> list[tuple[str, str]]:
        return [
            *self._kept_pairs(),
            ("boundary", f"{self.boundary}, {self.laplacian} Laplacian"),
            ("area", f"{self.area_ratio:.4g} times that of the surface"),
            *[("pins", counted(len(self.pins), "vertex", "vertices"))] * bool(len(self.pins)),
            *super()._steps(),
        ]

    def _details(self) -> dict[str, Any]:
        return {**self._kept_details(), **super()._details()}
