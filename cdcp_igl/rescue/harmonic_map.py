"""The first half of Algorithm 1: a harmonic map onto the disk, before its normalisation."""

from __future__ import annotations

from dataclasses import dataclass

from ..arrays import Complex
from ..steps.center import Center
from ..steps.mobius import composed
from ..surface.mesh import DiskMesh
from .boundary import CircleMap
from .recentering import recentered
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
    w : complex
        The point that has gone to 0, lest what is around it be too small; 0 if none has.
    """

    f: Complex
    boundary: CircleMap
    remote: Remote | None
    center: Center
    straightening: Straightening
    w: complex = 0j

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
        w = 0j
        if boundary.settle:
            f, w = recentered(mesh, f, boundary.settle)
        return cls(f, boundary, remote, center, straightening, w)

    def placed(self, f: Complex, w: complex) -> Complex:
        """(n,) put remote parts of psi_w o f, turned about 0, where they are to the last digit."""
        return self.remote.placed(f, composed(self.w, w)) if self.remote else f
