"""What a surface is mapped onto, as refinement sees it: disk, outline, ring, rectangle, sphere."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from ..arrays import Complex, Floats, Ints, coordinates
from ..steps.stereographic import axes_along, from_plane
from ..surface.mesh import Mesh
from ..surface.triangles import flipped_faces
from ..verdict.certificate import (
    Certificate,
    SphereCertificate,
    Verified,
    certificate_of,
    certify_rectangle,
    certify_ring,
    certify_sphere,
    flipped_on_sphere,
)
from ..verdict.distortion import angle_errors, sphere_angle_errors
from ..verdict.outline import OutlineCertificate, certify_outline
from .collapsed_faces import open_collapsed_faces

Flipped = tuple[Ints, int]


class Target(ABC):
    """What a surface is mapped onto; here in the plane, and every vertex may go anywhere."""

    slides: ClassVar[bool] = False  # whether boundary vertices do: the Laplacian is of the others

    @abstractmethod
    def certificate(self, mesh: Mesh, f: Complex, flipped: Flipped) -> Verified:
        """Verify a map f (n,) whose `flipped` faces are known."""

    def image(self, f: Complex) -> Complex | Floats:
        """Points of the target, (n,) in the plane or (n, 3) in space, of a map f (n,)."""
        return f

    def errors(self, mesh: Mesh, f: Complex, flipped: Flipped) -> Floats:
        """(m, 3) signed angle errors in radians of a map f (n,) whose `flipped` faces are known."""
        return angle_errors(mesh, f)

    def flipped(self, F: Ints, f: Complex) -> Flipped:
        """Faces that are not positively oriented, exactly, and how many were in doubt."""
        return flipped_faces(f, F)

    def moved(self, mesh: Mesh, f: Complex, step: Complex) -> Complex:
        """Move a map by a displacement (n,)."""
        return f + step

    def tangential(self, mesh: Mesh, f: Complex, x: Complex) -> Complex:
        """Project displacements x (n,), in place, to those that are possible."""
        return x

    def corners(self, f: Complex, F: Ints) -> tuple[Complex, Complex | float, Complex | None]:
        """Corners (3, k) of faces, each in a plane of its own; what takes dz into that plane.

        That is one factor of dz for each corner, or for all, and one of conj(dz), if there is one.
        """
        return f.take(F.T), 1.0, None


class Disk(Target):
    """The unit disk: boundary vertices slide on the circle."""

    slides = True

    def certificate(self, mesh: Mesh, f: Complex, flipped: Flipped) -> Certificate:
        """Verify a map f (n,) whose `flipped` faces are known."""
        return certificate_of(f[mesh.loop], *flipped)

    def moved(self, mesh: Mesh, f: Complex, step: Complex) -> Complex:
        """Move a map by a displacement; the boundary by its angle, so that it stays on the circle.

        What has no displacement stays to the last bit.
        """
        moved, sliding = f + step, mesh.loop[step[mesh.loop] != 0]
        boundary = f[sliding]
        boundary = boundary * np.exp(step[sliding] / boundary)  # by i times a real number
        moved[sliding] = boundary / abs(boundary)
        return open_collapsed_faces(mesh, moved)[0]

    def tangential(self, mesh: Mesh, f: Complex, x: Complex) -> Complex:
        """Project displacements x (n,), in place, to those that are possible."""
        tangent = 1j * f[mesh.loop]
        x[mesh.loop] = (x[mesh.loop] * tangent.conj()).real * tangent
        return x


class Outline(Target):
    """A free outline: every vertex moves, as long as the outline is simple."""

    def certificate(self, mesh: Mesh, f: Complex, flipped: Flipped) -> OutlineCertificate:
        """Verify a map f (n,) whose `flipped` faces are known."""
        return certify_outline(mesh, coordinates(f), flipped)


DISK, PLANE = Disk(), Outline()


class Ring(Target):
    """A ring around 0, by the logarithm of the map: its circles are the edges of a strip.

    Boundary vertices slide on both, and the inner one is as large as refinement makes it. Where the
    strip is cut open does not matter.
    """

    slides = True

    def certificate(self, mesh: Mesh, f: Complex, flipped: Flipped) -> Certificate:
        """Verify a map f (n,) whose `flipped` faces are known."""
        return certify_ring(mesh, np.exp(f), flipped)

    def image(self, f: Complex) -> Complex:
        """Points of the ring, (n,)."""
        return np.exp(f)

    def errors(self, mesh: Mesh, f: Complex, flipped: Flipped) -> Floats:
        """(m, 3) signed angle errors in radians."""
        return angle_errors(mesh, np.exp(f))

    def flipped(self, F: Ints, f: Complex) -> Flipped:
        """Faces that are not positively oriented, exactly, and how many were in doubt."""
        with np.errstate(over="ignore", invalid="ignore"):  # of a step that is far too long
            return flipped_faces(np.exp(f), F)

    def moved(self, mesh: Mesh, f: Complex, step: Complex) -> Complex:
        """Move a map by a displacement (n,), if all of the inner circle moves by the same.

        Three corners of a hole may lie on one half of their circle, and 0 outside of the hole: no
        vertex goes there, where the logarithm ends.
        """
        moved, inner = f + step, mesh.loops[1]
        moved.real[inner] = radius = moved.real[inner].mean()
        moved.real = np.maximum(moved.real, radius - INSIDE)
        return moved

    def tangential(self, mesh: Mesh, f: Complex, x: Complex) -> Complex:
        """Project displacements x (n,), in place, to those that are possible."""
        outer, inner = mesh.loops
        x.real[outer], x.real[inner] = 0, x.real[inner].mean()
        return x

    def corners(self, f: Complex, F: Ints) -> tuple[Complex, Complex | float, Complex | None]:
        """Corners (3, k) of faces in planes of their own size; these turn dz into them, too."""
        log = f[F.T]
        corner = np.exp(log - log.real.max(axis=0))
        return corner, corner, None


class Rectangle(Target):
    """A rectangle of height 1 with its first corner at 0, as wide as refinement makes it.

    Boundary vertices slide on their `sides`, the first of which is the lower one; corners stay.
    """

    slides = True

    def __init__(self, sides: Sequence[Ints]) -> None:
        self._sides = sides

    def certificate(self, mesh: Mesh, f: Complex, flipped: Flipped) -> Certificate:
        """Verify a map f (n,) whose `flipped` faces are known."""
        return certify_rectangle(mesh, self._sides, f, flipped)

    def moved(self, mesh: Mesh, f: Complex, step: Complex) -> Complex:
        """Move a map by a displacement (n,), if all of the right side moves by the same."""
        moved, right = f + step, self._sides[1]
        moved.real[right] = moved.real[right].mean()
        return moved

    def tangential(self, mesh: Mesh, f: Complex, x: Complex) -> Complex:
        """Project displacements x (n,), in place, to those that are possible."""
        bottom, right, top, left = self._sides
        x.imag[bottom] = x.imag[top] = x.real[left] = 0
        x.real[right] = x.real[right].mean()
        return x


INSIDE = 1.0  # the logarithm of how much nearer than the inner circle a vertex may come to 0
COARSE = 2_000  # vertices: on more, what is of second order in the length of edges can be left out
AT_INFINITY = 1e12  # the place of the pole of the sphere in the plane, 2e-12 from it


class Sphere(Target):
    """The unit sphere, by stereographic projection from the image of one vertex, which stays.

    Vector fields on the sphere have the same shear in this plane, and its coordinate has no
    singularity but at the pole: so the Laplacian of all others preconditions their displacements.
    The faces are straight, their corners on the sphere.
    """

    def __init__(self, P: Floats, pole: int) -> None:
        axes = axes_along(P[pole])
        axes[2] *= -1  # seen from outside, opposite the pole
        self._axes, self._pole, self._coarse = axes, pole, len(P) < COARSE

    def plane(self, P: Floats) -> Complex:
        """(n,) coordinates of points (n, 3)."""
        height, x, y = self._axes @ P.T
        # Near the pole 1 - height has no digits, near the other point 1 + height has none.
        outside = (x * x + y * y) / np.maximum(1 + height, 1)
        z: Complex = (x + 1j * y) / np.where(height > 0, np.maximum(outside, 1e-300), 1 - height)
        z[self._pole] = AT_INFINITY
        return z

    def image(self, f: Complex) -> Floats:
        """Points of the sphere, (n, 3)."""
        return self.points(f)

    def points(self, z: Complex) -> Floats:
        """(n, 3) points with these coordinates."""
        return from_plane(z.conj(), -1)[:, [2, 0, 1]] @ self._axes

    def flipped(self, F: Ints, f: Complex) -> Flipped:
        """Faces that are not positively oriented, exactly, and how many were in doubt."""
        return flipped_on_sphere(self.points(f), F)

    def errors(self, mesh: Mesh, f: Complex, flipped: Flipped) -> Floats:
        """(m, 3) signed angle errors in radians."""
        return sphere_angle_errors(mesh, self.points(f), flipped[0])

    def certificate(self, mesh: Mesh, f: Complex, flipped: Flipped) -> SphereCertificate:
        """Verify a map f (n,) whose `flipped` faces are known."""
        return certify_sphere(mesh.F, self.points(f), flipped)

    def tangential(self, mesh: Mesh, f: Complex, x: Complex) -> Complex:
        """Let the pole stay."""
        x[self._pole] = 0
        return x

    def corners(self, f: Complex, F: Ints) -> tuple[Complex, Complex | float, Complex | None]:
        """Corners (3, k) of faces in their own planes; what takes dz, and conj(dz), into these.

        A tangent plane is tilted against the plane of the face: the second is not 0, but of the
        second order in the length of edges, and left out of fine meshes.
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
        frame = frame @ self._axes.T / 2
        turn = scale * np.einsum("fkc,fc->fk", tangents, frame)
        if not self._coarse:
            return corner.T, turn.T, None
        mirror = scale * np.einsum("fkc,fc->fk", tangents.conj(), frame)
        return corner.T, turn.T, mirror.T
