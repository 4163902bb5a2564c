"""The certificate that a map is a bijection: onto the disk, a ring, or the sphere."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import numpy as np

from .. import libigl
from ..arrays import Complex, Floats, Ints, as_complex, shifted
from ..errors import counted
from ..surface.mesh import Mesh
from ..surface.triangles import EPS, flipped_faces

BOUNDARY_TOLERANCE = 1e-12
# Neighbours on the boundary must be this far apart, in radians, to stay in order when rounding
# has moved them.
SMALLEST_ARC = 1e-14
SMALLEST_RADIUS = 1e-140
# As `ORIENTATION_BOUND`, of three points and the centre of the sphere; with some to spare.
VOLUME_BOUND = 8 * EPS
# What a report calls what has another name here.
KEYS = {"flipped": "flipped_faces", "meeting": "meeting_edges", "n_exact": "faces_decided_exactly"}


class Verified(ABC):
    """What all certificates have: printing one says what was found, in a line.

    `finite`, `flipped` and `n_exact` are as in `Certificate`.
    """

    finite: bool
    flipped: Ints
    n_exact: int

    def report(self) -> dict[str, Any]:
        """Return it as JSON types."""
        plain = {n: x.tolist() if isinstance(x, np.ndarray) else x for n, x in vars(self).items()}
        return {KEYS.get(name, name): value for name, value in plain.items()}

    def __str__(self) -> str:
        if not self.finite:
            return "not finite"
        flipped = counted(len(self.flipped), "flipped face", "flipped faces")
        return f"{flipped} ({self.n_exact:,} decided exactly), {self._said()}"

    @property
    @abstractmethod
    def valid(self) -> bool:
        """True for a bijection."""

    @abstractmethod
    def _said(self) -> str:
        """Say what else was verified."""


@dataclass(frozen=True, eq=False)
class Certificate(Verified):
    """What was verified on the coordinates as they are returned.

    If the boundary runs once around the circle, strictly monotone, and every face is
    positively oriented, the map is a bijection onto the polygon inscribed in the circle.

    Attributes
    ----------
    finite : bool
        All coordinates are finite.
    boundary_error : float
        Largest deviation of a boundary vertex from the unit circle.
    boundary_monotone : bool
        Each boundary vertex lies strictly counterclockwise of the one before and the
        loop goes around once.
    winding_number : int
        Turns of the boundary, arcs between neighbours taken counterclockwise.
    flipped : (k,) ndarray of int64
        Faces that are not positively oriented, collapsed ones included.
    n_exact : int
        Faces whose sign was in doubt and decided in exact arithmetic.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.spherical_cap(20)
    >>> certificate = cdcp_igl.disk_map(V, F).certificate
    >>> certificate.valid, certificate.winding_number, len(certificate.flipped)
    (True, 1, 0)
    """

    finite: bool
    boundary_error: float
    boundary_monotone: bool
    winding_number: int
    flipped: Ints
    n_exact: int

    @property
    def valid(self) -> bool:
        """True for a bijection onto the polygon inscribed in the unit circle."""
        return self.on_circle and len(self.flipped) == 0

    @property
    def on_circle(self) -> bool:
        """True if the boundary runs once around the unit circle, whatever is inside."""
        return (
            self.finite
            and self.boundary_error <= BOUNDARY_TOLERANCE
            and self.boundary_monotone
            and self.winding_number == 1
        )

    def _said(self) -> str:
        return (
            f"boundary error {self.boundary_error:.1e}, "
            f"boundary {'monotone' if self.boundary_monotone else 'not monotone'}, "
            f"winding number {self.winding_number}"
        )


@dataclass(frozen=True, eq=False)
class SphereCertificate(Verified):
    """What was verified on a map onto the unit sphere, as it is returned.

    If every spherical triangle, with great arcs as sides, is positively oriented, and they cover
    the sphere once, the map is a bijection onto the sphere.

    Attributes
    ----------
    radius_error : float
        Largest deviation of a vertex from the unit sphere.
    degree : int
        How many times the triangles cover the sphere.
    finite, flipped, n_exact
        As in `Certificate`, faces seen from outside.

    Examples
    --------
    >>> import cdcp_igl
    >>> V = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    >>> F = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]
    >>> certificate = cdcp_igl.sphere_map(V, F).certificate
    >>> certificate.valid, certificate.degree
    (True, 1)
    """

    finite: bool
    radius_error: float
    degree: int
    flipped: Ints
    n_exact: int

    @property
    def valid(self) -> bool:
        """True for a bijection onto the unit sphere."""
        on_sphere = self.finite and self.radius_error <= BOUNDARY_TOLERANCE
        return on_sphere and self.degree == 1 and len(self.flipped) == 0

    def _said(self) -> str:
        return f"radius error {self.radius_error:.1e}, degree {self.degree}"


def certify_sphere(F: Ints, P: Floats, known: tuple[Ints, int] | None = None) -> SphereCertificate:
    """Verify a map (n, 3) of a closed surface with faces F onto the unit sphere.

    What `flipped_on_sphere` finds may be `known`.
    """
    if not np.isfinite(P).all():
        return SphereCertificate(False, np.inf, 0, np.arange(len(F)), 0)
    flipped, n_exact = known or flipped_on_sphere(P, F)
    radius_error = float(abs(np.linalg.norm(P, axis=1) - 1).max())
    degree = round(solid_angles(P, F).sum() / (4 * np.pi))
    return SphereCertificate(True, radius_error, degree, flipped, n_exact)


def flipped_on_sphere(P: Floats, F: Ints) -> tuple[Ints, int]:
    """Find what `flipped_faces` does, of spherical triangles seen from outside."""
    x, y, z = P.T.take(F.T, axis=1)  # by coordinate, then by corner
    products = [(z[k - 2] * x[k - 1] * y[k], z[k - 2] * x[k] * y[k - 1]) for k in range(3)]
    volume = sum(left - right for left, right in products)
    size = sum(abs(left) + abs(right) for left, right in products)
    in_doubt = np.flatnonzero(abs(volume) <= VOLUME_BOUND * size)
    flipped = volume < 0
    flipped[in_doubt] = ~libigl.is_seen_from_outside(P[F[in_doubt]])
    return np.flatnonzero(flipped), len(in_doubt)


def solid_angles(P: Floats, F: Ints) -> Floats:
    """(m,) signed solid angles of spherical triangles.

    A. van Oosterom, J. Strackee. The solid angle of a plane triangle. IEEE Trans. Biomed. Eng.
    30(2), 1983.
    """
    x, y, z = P.T.take(F.T, axis=1)
    cosines = sum(x[k] * x[k - 1] + y[k] * y[k - 1] + z[k] * z[k - 1] for k in range(3))
    volume = sum(z[k - 2] * (x[k - 1] * y[k] - x[k] * y[k - 1]) for k in range(3))
    return 2 * np.arctan2(volume, 1 + cosines)


Kind = TypeVar("Kind", bound=Verified)

# How what was verified of several maps makes one certificate of them all.
TOGETHER: dict[str, Callable[[list[Any]], Any]] = {
    "finite": all,
    "boundary_error": max,
    "boundary_monotone": all,
    "winding_number": partial(max, key=lambda turns: abs(turns - 1)),
    "meeting": np.concatenate,
    "flipped": np.concatenate,
    "n_exact": sum,
}


def together(each: Sequence[Kind]) -> Kind:
    """Make one certificate of those of several maps, valid if each of them is."""
    names = vars(each[0])
    return type(each[0])(**{n: TOGETHER[n]([getattr(one, n) for one in each]) for n in names})


def certify(mesh: Mesh, uv: Floats) -> Certificate:
    """Verify a map (n, 2) of a mesh onto the unit disk."""
    return certify_disk(mesh, as_complex(uv))


def certify_disk(mesh: Mesh, f: Complex, known: tuple[Ints, int] | None = None) -> Certificate:
    """Verify a map (n,) of a mesh onto the unit disk; `flipped_faces` of it may be `known`."""
    if not np.isfinite(f).all():
        return not_finite(mesh)
    return certificate_of(f[mesh.loop], *(known or flipped_faces(f, mesh.F)))


def certificate_of(boundary: Complex, flipped: Ints, n_exact: int) -> Certificate:
    """Verify the boundary (nB,) of a finite map whose faces are verified."""
    turns, monotone = around(boundary)
    return Certificate(
        finite=True,
        boundary_error=float(abs(abs(boundary) - 1).max()),
        boundary_monotone=monotone,
        winding_number=turns,
        flipped=flipped,
        n_exact=n_exact,
    )


def certify_ring(mesh: Mesh, f: Complex, known: tuple[Ints, int] | None = None) -> Certificate:
    """Verify a map (n,) onto a ring; errors at its inner circle are relative to the radius.

    `flipped_faces` of it may be `known`.
    """
    if not np.isfinite(f).all():
        return not_finite(mesh)
    outer, inner = f[mesh.loops[0]], f[mesh.loops[1]][::-1]
    inner = inner / max(abs(inner).mean(), SMALLEST_RADIUS)
    # Orientations are not exact where products of coordinates underflow.
    flipped = known or flipped_faces(np.where(abs(f) < SMALLEST_RADIUS, 0, f), mesh.F)
    none = np.empty(0, dtype=np.int64)
    return together([certificate_of(outer, *flipped), certificate_of(inner, none, 0)])


def certify_rectangle(
    mesh: Mesh, sides: Sequence[Ints], f: Complex, known: tuple[Ints, int] | None = None
) -> Certificate:
    """Verify a map (n,) onto a rectangle with the corners 0 and i, as `certify` onto the disk.

    Its width is where the third corner lies. `flipped_faces` of it may be `known`.
    """
    if not np.isfinite(f).all():
        return not_finite(mesh)
    bottom, right, top, left = sides
    width = f.real[top[0]]
    off = f.imag[bottom], f.real[right] - width, f.imag[top] - 1, f.real[left]
    from_middle = f[mesh.loop] - (width + 1j) / 2
    turns = np.angle(shifted(from_middle) * from_middle.conj())
    flipped, n_exact = known or flipped_faces(f, mesh.F)
    return Certificate(
        finite=True,
        boundary_error=float(abs(np.concatenate(off)).max()),
        boundary_monotone=along_sides(sides, f),
        winding_number=round(turns.sum() / (2 * np.pi)),
        flipped=flipped,
        n_exact=n_exact,
    )


def along_sides(sides: Sequence[Ints], f: Complex) -> bool:
    """Whether each side of a rectangle is run through forwards, no two vertices in one place."""
    return all((np.diff((f[side] * (-1j) ** k).real) > 0).all() for k, side in enumerate(sides))


def not_finite(mesh: Mesh) -> Certificate:
    """Return the certificate of a map that is not finite: all faces count as flipped."""
    return Certificate(False, np.inf, False, 0, np.arange(len(mesh.F)), 0)


def around(boundary: Complex) -> tuple[int, bool]:
    """Winding number about 0, and whether it is 1 with every arc forward."""
    arcs = increments(boundary)
    turns = round(arcs.sum() / (2 * np.pi))
    # Rounding may give an arc of zero either sign, so the exact orientation of the triangles
    # with 0 decides. Only arcs of more than a half turn have clockwise triangles, too.
    n = len(boundary)
    fan = np.column_stack([np.full(n, n), np.arange(n), shifted(np.arange(n))])
    not_forward, _ = flipped_faces(np.append(boundary, 0), fan)
    return turns, turns == 1 and bool((arcs[not_forward] > 1).all())


def increments(z: Complex) -> Floats:
    """(N,) angle from each point of a closed curve about 0 to the next, in [0, 2 pi)."""
    return np.angle(shifted(z) * z.conj()) % (2 * np.pi)


def is_around(f_B: Complex) -> bool:
    """Whether points run once around the circle, counterclockwise, no arc too short."""
    arcs = increments(f_B)
    return bool((arcs > SMALLEST_ARC).all()) and round(arcs.sum() / (2 * np.pi)) == 1
