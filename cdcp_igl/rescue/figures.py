"""What a surface is mapped onto, as refinement sees it: here the disk."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from ..arrays import Complex, Floats, Ints
from ..certificate import Certificate, Verified, certificate_of
from ..distortion import angle_errors
from ..surface.mesh import DiskMesh
from ..surface.triangles import flipped_faces
from .collapsed_faces import open_collapsed_faces

Flipped = tuple[Ints, int]


class Figure(ABC):
    """What a surface is mapped onto; here in the plane, and every vertex may go anywhere."""

    @abstractmethod
    def certificate(self, mesh: DiskMesh, f: Complex, flipped: Flipped) -> Verified:
        """Verify a map f (n,) whose `flipped` faces are known."""

    def image(self, f: Complex) -> Complex | Floats:
        """Points of the figure, (n,) in the plane or (n, 3) in space, of a map f (n,)."""
        return f

    def errors(self, mesh: DiskMesh, f: Complex, flipped: Flipped) -> Floats:
        """(m, 3) signed angle errors in radians of a map f (n,) whose `flipped` faces are known."""
        return angle_errors(mesh, f)

    def flipped(self, F: Ints, f: Complex) -> Flipped:
        """Faces that are not positively oriented, exactly, and how many were in doubt."""
        return flipped_faces(f, F)

    def moved(self, mesh: DiskMesh, f: Complex, step: Complex) -> Complex:
        """Move a map by a displacement (n,)."""
        return f + step

    def tangential(self, mesh: DiskMesh, f: Complex, x: Complex) -> Complex:
        """Project displacements x (n,), in place, to those that are possible."""
        return x

    def corners(self, f: Complex, F: Ints) -> tuple[Complex, Complex | float]:
        """Corners (3, k) of faces, each in a plane of its own, and what turns dz into that plane.

        That is one factor for each corner, or for all.
        """
        return f.take(F.T), 1.0


class Disk(Figure):
    """The unit disk: boundary vertices slide on the circle."""

    def certificate(self, mesh: DiskMesh, f: Complex, flipped: Flipped) -> Certificate:
        """Verify a map f (n,) whose `flipped` faces are known."""
        return certificate_of(f[mesh.loop], *flipped)

    def moved(self, mesh: DiskMesh, f: Complex, step: Complex) -> Complex:
        """Move a map by a displacement; the boundary by its angle, so that it stays on the circle.

        What has no displacement stays to the last bit.
        """
        moved, sliding = f + step, mesh.loop[step[mesh.loop] != 0]
        boundary = f[sliding]
        boundary = boundary * np.exp(step[sliding] / boundary)  # by i times a real number
        moved[sliding] = boundary / abs(boundary)
        return open_collapsed_faces(mesh, moved)[0]

    def tangential(self, mesh: DiskMesh, f: Complex, x: Complex) -> Complex:
        """Project displacements x (n,), in place, to those that are possible."""
        tangent = 1j * f[mesh.loop]
        x[mesh.loop] = (x[mesh.loop] * tangent.conj()).real * tangent
        return x
