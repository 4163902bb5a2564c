"""What a surface is mapped onto, as refinement sees it: the disk, a free outline, the sphere."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from ..arrays import Bools, Complex, Floats, Ints
from ..certificate import (
    certificate_of,
    flipped_on_sphere,
    outline_certificate_of,
    sphere_certificate_of,
)
from ..distortion import angle_errors, sphere_angle_errors
from ..surface.mesh import DiskMesh
from ..surface.triangles import flipped_faces, twice_areas
from .collapsed_faces import open_collapsed_faces
from .recentering import extents

NONE = np.empty(0, np.int64)  # of the faces
AT_INFINITY = 1e12  # the place of the pole of the sphere in the plane, 2e-12 from it


class Figure(ABC):
    """What a surface is mapped onto; here in the plane, and every vertex may go anywhere."""

    @abstractmethod
    def holds(self, mesh: DiskMesh, f: Complex) -> bool:
        """Whether a map f (n,) without flipped faces is a bijection onto the figure."""

    def errors(self, mesh: DiskMesh, f: Complex) -> Floats:
        """(m, 3) angle errors in radians of a map without flipped faces."""
        return angle_errors(mesh, f)

    def flipped(self, F: Ints, f: Complex) -> Ints:
        """Faces that are not positively oriented, exactly."""
        return flipped_faces(f, F)[0]

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

    def lower(self, F: Ints, f: Complex, height: float) -> Bools:
        """(m,) whether faces are less high than that by their distance from 0; none if it is 0."""
        if height == 0:
            return np.zeros(len(F), dtype=bool)
        corner = f[F]
        e = corner - corner[:, [2, 0, 1]]
        size, distance = extents(corner)
        return np.asarray(twice_areas(e) < height * distance * size)


class Disk(Figure):
    """The unit disk: boundary vertices slide on the circle."""

    def holds(self, mesh: DiskMesh, f: Complex) -> bool:
        """Whether the boundary runs once around the circle."""
        return certificate_of(f[mesh.loop], NONE, 0).valid

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


class Outline(Figure):
    """A free outline: every vertex moves, as long as the outline is simple."""

    def holds(self, mesh: DiskMesh, f: Complex) -> bool:
        """Whether the outline is a simple polygon."""
        return outline_certificate_of(f[mesh.loop], mesh.loop, NONE, 0).valid


class Sphere(Figure):
    """The unit sphere, by stereographic projection from the image of one vertex, which stays.

    Vector fields on the sphere have the same shear in this plane, and its coordinate has no
    singularity but at the pole: so the Laplacian of all others preconditions their displacements.
    The faces are straight, their corners on the sphere.
    """

    def __init__(self, P: Floats, pole: int) -> None:
        axes = np.linalg.svd(P[pole][None])[2]  # the first one is along P[pole], or against it
        axes *= np.sign(axes[0] @ P[pole])
        axes[2] *= -np.linalg.det(axes)  # seen from outside, opposite the pole
        self._axes, self._pole = axes, pole

    def plane(self, P: Floats) -> Complex:
        """(n,) coordinates of points (n, 3)."""
        height, x, y = self._axes @ P.T
        # Near the pole 1 - height has no digits, near the other point 1 + height has none.
        outside = (x * x + y * y) / np.maximum(1 + height, 1)
        z: Complex = (x + 1j * y) / np.where(height > 0, np.maximum(outside, 1e-300), 1 - height)
        z[self._pole] = AT_INFINITY
        return z

    def points(self, z: Complex) -> Floats:
        """(n, 3) points with these coordinates."""
        square = abs(z) ** 2
        P = np.column_stack([square - 1, 2 * z.real, 2 * z.imag]) / (1 + square)[:, None]
        return P @ self._axes

    def flipped(self, F: Ints, f: Complex) -> Ints:
        """Faces that are not positively oriented, exactly."""
        return flipped_on_sphere(self.points(f), F)[0]

    def errors(self, mesh: DiskMesh, f: Complex) -> Floats:
        """(m, 3) angle errors in radians of a map without flipped faces."""
        return sphere_angle_errors(mesh, self.points(f), NONE)

    def holds(self, mesh: DiskMesh, f: Complex) -> bool:
        """Whether the faces cover the sphere once."""
        return sphere_certificate_of(mesh.F, self.points(f), NONE, 0).valid

    def tangential(self, mesh: DiskMesh, f: Complex, x: Complex) -> Complex:
        """Let the pole stay."""
        x[self._pole] = 0
        return x

    def corners(self, f: Complex, F: Ints) -> tuple[Complex, Complex | float]:
        """Corners (3, k) of faces in their own planes, and what turns dz into these.

        A tangent plane is tilted against the plane of the face; what is linear in conj(dz), of the
        second order in the length of edges, is left out.
        """
        P, z = self.points(f[F].ravel()).reshape(*F.shape, 3), f[F]
        u, v = P[:, 1] - P[:, 0], P[:, 2] - P[:, 0]
        normal = np.cross(u, v)
        along = u / np.linalg.norm(u, axis=1)[:, None]
        across = np.cross(normal, along) / np.linalg.norm(normal, axis=1)[:, None]
        frame = along + 1j * across
        corner = np.zeros(F.shape, dtype=complex)
        corner[:, 1], corner[:, 2] = (u * frame).sum(axis=1), (v * frame).sum(axis=1)
        # The derivative of a point by x less i times that by y: these are tangents of equal length.
        scale = 2 / (1 + abs(z) ** 2)
        toward = scale * z.conj()
        tangents = np.stack([toward, 1 - toward * z.real, -1j - toward * z.imag], axis=2)
        turn = np.einsum("fkc,fc->fk", tangents, frame @ self._axes.T)
        return corner.T, (scale * turn / 2).T
