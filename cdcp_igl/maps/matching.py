"""One surface laid over another by landmarks, and a bijection in which pairs of vertices meet."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import typed
from ..arrays import Floats, Ints, as_complex, coordinates, marked
from ..cached import cached_property
from ..errors import MapError
from ..refine.balance import Energy, Newton
from ..refine.collapsed_faces import open_collapsed_faces
from ..refine.repair import repair_locally
from ..refine.sphere_repair import repaired_on_sphere
from ..refine.targets import DISK
from ..result.bijection import DiskBijection, Registered
from ..result.disk_map import DiskMap
from ..result.sphere_map import SphereMap
from ..steps.stereographic import moved_to_center, rotation, spherical_barycenter
from ..surface.mesh import Mesh
from ..verdict.certificate import BOUNDARY_TOLERANCE, Certificate, certify_disk, certify_sphere
from ..verdict.distortion import face_dilatation
from .landmarks import landmark_automorphism

STEEP = 4.0  # the cost of shear grows so that the largest counts: a point that is held is a spike
RELEASED = 6  # steps without a pair, to see what that gains
SUSPECT = 3.0  # times the median gain


@dataclass(frozen=True, eq=False)
class Match:
    """A bijection of two surfaces by their disks, in which pairs of vertices meet.

    Attributes
    ----------
    uv : (n, 2) float64
        The vertices of the first surface in the disk of the other.
    certificate : Certificate
        What was verified about `uv`.
    stretch : (m,) float64
        Of each face of the first surface, how many times more it is stretched one way than the
        other from the best Möbius transformation to here.
    pairs : (k, 2) int64
        Vertices of the first surface and of the other, as they were given.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.spherical_cap(6)
    >>> one, other = cdcp_igl.disk_map(V, F), cdcp_igl.disk_map(V * [1, 1.2, 1], F)
    >>> match = one.match(other, [[5, 5], [30, 40], [80, 80]])
    >>> match.certificate.valid, bool((match.uv[30] == other.uv[40]).all())
    (True, True)
    >>> heights = match.pull_back(V[:, 2])
    """

    uv: Floats
    certificate: Certificate
    stretch: Floats
    pairs: Ints
    _disk: Mesh = field(repr=False)
    _energy: Energy = field(repr=False)
    _to: DiskBijection = field(repr=False)

    @typed
    def pull_back(self, values: ArrayLike) -> Floats:
        """Carry values at the vertices of the other surface to those of the first.

        Parameters
        ----------
        values : (k, ...) array_like
            As of ``to.interpolate``.

        Returns
        -------
        (n, ...) float64
        """
        return self._to.interpolate(values, self.uv)

    @cached_property
    def gains(self) -> Floats:
        """(k,) which share of the shear each pair costs: what is saved if it is left out.

        A pair that is false stands out.
        """
        f, rows = as_complex(self.uv), self.pairs[:, 0]
        whole = self._energy.value(f)
        gains = np.zeros(len(rows))
        for pair in range(len(rows)):
            held = marked(len(f), np.delete(rows, pair))
            without = Newton(self._disk, f, DISK, held)
            gains[pair] = 1 - without.descend(self._energy, RELEASED) / whole if whole else 0
        return gains

    @property
    def suspects(self) -> Ints:
        """Pairs that may be false: `gains` of three times the median, and half the largest.

        Those around a false pair give way to it, and would gain a little, too.
        """
        least = max(SUSPECT * np.median(self.gains), self.gains.max() / 2)
        return np.flatnonzero(self.gains > least)


def registered_disk(one: DiskMap, to: DiskMap, landmarks: ArrayLike) -> Registered:
    """Do what `DiskMap.register` does."""
    here, there = map(as_complex, one._landmarks(to, landmarks))
    mesh, f = one.mesh, landmark_automorphism(here, there)(one._f)
    # Only what left the circle is normalised again, and faces that this flips are reopened.
    radius = abs(f[mesh.loop])
    f[mesh.loop] /= np.where(abs(radius - 1) < BOUNDARY_TOLERANCE / 10, 1, radius)
    f, _ = open_collapsed_faces(mesh, f)
    f, _ = repair_locally(mesh, f)
    certificate = certify_disk(mesh, f)
    if not certificate.valid:
        raise MapError(
            f"Moved to the landmarks, the map is not a bijection onto the disk: {certificate}. "
            "Faces are too large for this transformation, or too small: choose other landmarks",
            replace(one, _f=f, certificate=certificate),
        )

    def fitted(here: Floats, there: Floats) -> Floats:
        z, target = as_complex(here), as_complex(there)
        return coordinates(landmark_automorphism(z, target)(z))

    return one._registered(coordinates(f), to, landmarks, fitted)


def registered_sphere(one: SphereMap, to: SphereMap, landmarks: ArrayLike) -> Registered:
    """Do what `SphereMap.register` does."""

    def fitted(here: Floats, there: Floats, points: Floats | None = None) -> Floats:
        w, v = (
            spherical_barycenter(P, np.ones(len(P))) if len(P) > 2 else np.zeros(3)
            for P in (here, there)
        )
        turn = rotation(moved_to_center(here, w), moved_to_center(there, v))
        moved = moved_to_center(here if points is None else points, w)
        return moved_to_center(moved @ turn, -v)

    P = fitted(*one._landmarks(to, landmarks), one.points)
    P, _ = repaired_on_sphere(one.mesh, P / np.linalg.norm(P, axis=1)[:, None])
    certificate = certify_sphere(one.mesh.F, P)
    if not certificate.valid:
        raise MapError(
            "Moved to the landmarks, the map is not a bijection onto the sphere: "
            f"{certificate}. Choose other landmarks",
            replace(one, points=P, certificate=certificate),
        )
    return one._registered(P, to, landmarks, fitted)


def matched(one: DiskMap, to: DiskMap, pairs: ArrayLike) -> Match:
    """Do what `DiskMap.match` does."""
    one._landmarks(to, pairs)
    chosen = np.asarray(pairs, dtype=np.int64)
    for column, mesh in zip(chosen.T, (one.mesh, to.mesh), strict=True):
        rows, counts = np.unique(column, return_counts=True)
        if counts.max() > 1:
            raise ValueError(f"vertex {rows[counts.argmax()]} of {mesh!r} is in several pairs")
    at_boundary = one.mesh.on_boundary[chosen[:, 0]] != to.mesh.on_boundary[chosen[:, 1]]
    if at_boundary.any():
        here, there = chosen[at_boundary][0]
        raise ValueError(
            f"of the pair {here}, {there} only one is on the boundary: the boundaries meet"
        )
    near = registered_disk(one, to, chosen)
    disk = Mesh(np.column_stack([near, np.zeros(len(near))]), one.mesh.F, one.mesh.loop)
    rows, goal = chosen[:, 0], to._f[chosen[:, 1]]
    energy = Energy.of(disk, 0.0, STEEP, DISK)
    newton = Newton(disk, as_complex(near), DISK, marked(len(near), rows))
    reached = newton.pull(energy, rows, goal)
    certificate = certify_disk(one.mesh, newton.f)
    uv, stretch = coordinates(newton.f), face_dilatation(disk.V, disk.F, newton.f)
    made = Match(uv, certificate, stretch, chosen, disk, energy, to)
    if not (reached and certificate.valid):
        left = abs(newton.f[rows] - goal)
        raise MapError(
            f"The pairs do not all meet: pair {left.argmax()} is {left.max():.2g} off. They go "
            "around one another, or faces are too large there: leave pairs out, or subdivide",
            made,
        )
    return made
