"""The first half of Algorithm 1: a harmonic map onto the disk, before its normalisation."""

from __future__ import annotations

from dataclasses import dataclass

from ..arrays import Complex
from ..surface.mesh import DiskMesh
from .center import Center
from .circle import CircleMap
from .remote import Remote, remote_parts
from .straightening import Straightening, straighten

__all__ = ["HarmonicMap"]


@dataclass(frozen=True, eq=False)
class HarmonicMap:
    """The map before its normalisation, and where it comes from.

    Attributes
    ----------
    f : (n,) complex128
    boundary : CircleMap
    remote : Remote or None
        What is too close to the circle for f to tell its vertices apart.
    center : Center
    straightening : Straightening
    """

    f: Complex
    boundary: CircleMap
    remote: Remote | None
    center: Center
    straightening: Straightening

    @classmethod
    def of(
        cls, mesh: DiskMesh, boundary: CircleMap, center: Center, *, straightened: bool
    ) -> HarmonicMap:
        """Extend a boundary harmonically, eq. (10), and take the common shear out if asked to."""
        f = boundary.extend(boundary.f_B)  # (10)
        straightening = Straightening()
        if straightened and not boundary.is_crowded:
            f, straightening = straighten(mesh, f, boundary.extend)
            if straightening.before:
                boundary = boundary.turned(f[mesh.loop])
        remote = remote_parts(mesh, boundary.steps, boundary.f_B, boundary.extend)
        return cls(f, boundary, remote, center, straightening)

    @property
    def placed(self) -> Complex:
        """(n,) the map, remote parts as accurate as complex numbers can be."""
        return self.remote.placed(self.f, 0j) if self.remote else self.f
