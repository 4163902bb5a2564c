"""The certificate that a map is a bijection onto the polygon inscribed in the circle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from . import libigl
from .arrays import Complex, Floats, Ints, as_complex, blocks
from .errors import counted
from .surface.mesh import DiskMesh
from .surface.triangles import oriented_areas

BOUNDARY_TOLERANCE = 1e-12
# Neighbours on the boundary must be this far apart, in radians, to stay in order when rounding
# has moved them.
SMALLEST_ARC = 1e-14


@dataclass(frozen=True, eq=False)
class Certificate:
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

    def report(self) -> dict[str, Any]:
        """Return it as JSON types."""
        return {
            "finite": self.finite,
            "boundary_error": self.boundary_error,
            "boundary_monotone": self.boundary_monotone,
            "winding_number": self.winding_number,
            "flipped_faces": self.flipped.tolist(),
            "faces_decided_exactly": self.n_exact,
        }

    def __str__(self) -> str:
        if not self.finite:
            return "not finite"
        flipped = counted(len(self.flipped), "flipped face", "flipped faces")
        return (
            f"{flipped} ({self.n_exact:,} decided exactly), "
            f"boundary error {self.boundary_error:.1e}, "
            f"boundary {'monotone' if self.boundary_monotone else 'not monotone'}, "
            f"winding number {self.winding_number}"
        )


def certify(mesh: DiskMesh, uv: Floats) -> Certificate:
    """Verify a map (n, 2) of a mesh onto the unit disk."""
    if not np.isfinite(uv).all():
        return not_finite(mesh)
    f = as_complex(uv)
    return certificate_of(f[mesh.loop], *flipped_faces(f, mesh.F))


def certificate_of(boundary: Complex, flipped: Ints, n_exact: int) -> Certificate:
    """Verify the boundary (nB,) of a finite map whose faces are verified."""
    turns, monotone = _around(boundary)
    return Certificate(
        finite=True,
        boundary_error=float(abs(abs(boundary) - 1).max()),
        boundary_monotone=monotone,
        winding_number=turns,
        flipped=flipped,
        n_exact=n_exact,
    )


def not_finite(mesh: DiskMesh) -> Certificate:
    """Return the certificate of a map that is not finite: all faces count as flipped."""
    return Certificate(False, np.inf, False, 0, np.arange(len(mesh.F)), 0)


def _around(boundary: Complex) -> tuple[int, bool]:
    """Winding number about 0, and whether it is 1 with every arc forward."""
    arcs = increments(boundary)
    turns = round(arcs.sum() / (2 * np.pi))
    # Rounding may give an arc of zero either sign, so the exact orientation of the triangles
    # with 0 decides. Only arcs of more than a half turn have clockwise triangles, too.
    n = len(boundary)
    fan = np.column_stack([np.full(n, n), np.arange(n), np.roll(np.arange(n), -1)])
    not_forward, _ = flipped_faces(np.append(boundary, 0), fan)
    return turns, turns == 1 and bool((arcs[not_forward] > 1).all())


def increments(z: Complex) -> Floats:
    """(N,) angle from each point of a closed curve about 0 to the next, in [0, 2 pi)."""
    return np.angle(np.roll(z, -1) * z.conj()) % (2 * np.pi)


def is_around(f_B: Complex) -> bool:
    """Whether points run once around the circle, counterclockwise, no arc too short."""
    arcs = increments(f_B)
    return bool((arcs > SMALLEST_ARC).all()) and round(arcs.sum() / (2 * np.pi)) == 1


def flipped_faces(f: Complex, F: Ints) -> tuple[Ints, int]:
    """Faces that are not positively oriented, exactly, and how many were in doubt."""
    positive = np.empty(len(F), dtype=bool)
    for part in blocks(len(F)):
        area, error = oriented_areas(f, F[part])
        np.greater(area, error, out=positive[part])
    others = np.flatnonzero(~positive)
    area, error = oriented_areas(f, F[others])
    in_doubt = abs(area) <= error
    corners = f[F[others[in_doubt]]]
    flipped = np.ones(len(others), dtype=bool)
    flipped[in_doubt] = ~libigl.is_counterclockwise(np.stack([corners.real, corners.imag], axis=-1))
    return others[flipped], int(np.count_nonzero(in_doubt))
