"""Möbius transformations of the disk, eq. (19), as far as they do no harm, and its rotations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Complex, Floats, Ints
from ..surface.mesh import Mesh
from ..surface.triangles import flipped_faces
from ..verdict.certificate import is_around
from .least_distortion import (
    AngleErrors,
    faces_to_judge_by,
    least_angle_distortion,
    least_angle_distortion_nelder_mead,
)

Moved = TypeVar("Moved")
MobiusMethod = Literal["angle", "area", "nelder-mead"]

MAX_STEPS = 30  # towards the conformal barycentre
HALVINGS = 10  # of w, until no face is flipped


@dataclass(frozen=True)
class Normalization:
    """The Möbius transformation that was applied.

    Attributes
    ----------
    method : str
        What chose it: ``"angle"``, ``"nelder-mead"``, ``"area"`` or ``"none"``.
    w : complex
        The point that went to 0, eq. (19); 0 where nothing was applied. With ``"none"`` too, if
        a part of the surface was too small for double precision anywhere else.
    rejected : str
        Why the method's result was not used; empty where it was.
    """

    method: str = "none"
    w: complex = 0j
    rejected: str = ""

    def __str__(self) -> str:
        note = f" (rejected: {self.rejected})" if self.rejected else ""
        moved = f", moves a point w to the centre, |w| = {abs(self.w):.4f}" if self.w else ""
        return f"{self.method}{moved}{note}"


def normalize(
    mesh: Mesh,
    f: Complex,
    method: MobiusMethod | None,
    finished: Callable[[Complex], Complex] = lambda f: f,
) -> tuple[Complex, Normalization]:
    """Apply the best Möbius transformation that does no harm.

    psi_w flips a face exactly when 1 / conj(w) lies in its circumdisk. A transformation
    that does so, or that crowds the boundary beyond double precision, is halved until it does
    not: what can be gained on the way is gained. It is not applied where it does not lower
    the angular distortion.

    The first boundary vertex of the map f (n,) lies at 1. `finished` is what is done to the map
    after psi_w, before its flipped faces are counted.
    """
    if method is None:
        return finished(f), Normalization("none", 0j)
    faces = faces_to_judge_by(len(mesh.F))
    errors = AngleErrors.of(mesh.F[faces], f, mesh.angles_of(faces))
    before = errors.mean(0j)
    if method == "angle":
        w = least_angle_distortion(errors)
    elif method == "nelder-mead":
        w = least_angle_distortion_nelder_mead(mesh.F, f, mesh.angles)
    else:
        w = conformal_barycenter(f, mesh.vertex_areas)

    def attempt(w: complex) -> tuple[Complex, Ints] | None:
        moved = at_one(mesh, mobius_transformation(f, w), mesh.loop[0])
        if not is_around(moved[mesh.loop]):
            return None
        moved = finished(moved)
        return moved, flipped_faces(moved, mesh.F)[0]

    w, moved, reason = harmless(
        w,
        lambda w: method == "area" or errors.mean(w) < before,
        attempt,
        lambda: flipped_faces(finished(f), mesh.F)[0],
    )
    return finished(f) if moved is None else moved, Normalization(method, w, reason)


def harmless(
    w: complex,
    improves: Callable[[complex], bool],
    attempt: Callable[[complex], tuple[Moved, Ints] | None],
    flipped_without: Callable[[], Ints],
) -> tuple[complex, Moved | None, str]:
    """Halve w until psi_w does no harm: the point, the moved map, and why it was not found.

    An attempt gives the moved map and its flipped faces, None where the boundary is crowded. Those
    faces are allowed that are flipped without psi_w, too.
    """
    allowed: Ints | None = None
    reason = "no improvement"
    for _ in range(HALVINGS):
        if not improves(w):
            break
        if (tried := attempt(w)) is None:
            reason = "crowding"
        else:
            moved, flipped = tried
            if len(flipped) and allowed is None:
                allowed = flipped_without()
            if allowed is None or np.isin(flipped, allowed).all():
                return w, moved, ""
            reason = "flipped faces"
        w /= 2
    return 0j, None, reason


def mobius_transformation(z: Complex, w: complex) -> Complex:
    """Apply psi_w(z) = (z - w) / (1 - conj(w) z), eq. (19): the disk onto itself, w to 0."""
    return (z - w) / (1 - np.conj(w) * z)


def composed(first: complex, w: complex) -> complex:
    """Find the point that goes to 0 when psi_first comes before psi_w."""
    return (w + first) / (1 + first.conjugate() * w)


def conformal_barycenter(z: Complex, mass: Floats) -> complex:
    """Find w that puts the centre of mass of psi_w o f at 0, by Newton's method.

    This evens out the area; it is canonical, so that maps of different meshes of one
    surface agree up to a rotation. `mass` (n,) are positive weights, areas on the surface.

    References
    ----------
    J. Cantarella, H. Schumacher. Computing the conformal barycenter. SIAM J. Appl.
    Algebra Geometry 6(3), 2022.
    """
    mass = mass / mass.sum()

    def moments(w: complex) -> tuple[complex, complex]:
        moved = mobius_transformation(z, w)
        return complex(mass @ moved), complex(mass @ (moved * moved))

    return barycenter_by_moments(moments)


def barycenter_by_moments(moments: Callable[[complex], tuple[complex, complex]]) -> complex:
    """Do what `conformal_barycenter` does, by the means of psi_w o f and of its square, for w."""
    w = 0j
    for _ in range(MAX_STEPS):
        c, q = moments(w)
        # To first order psi_d moves the centre of mass by -d + q conj(d).
        d = (c + q * c.conjugate()) / max(1 - abs(q) ** 2, np.finfo(float).eps)
        d /= max(1, 2 * abs(d))  # stay well inside the disk
        w = (d + w) / (1 + w.conjugate() * d)  # psi_d o psi_w, up to a rotation
        if abs(d) < 1e-14:
            break
    return w


def rotate(
    mesh: Mesh, f: Complex, align: int | ArrayLike | None, *, on_circle: bool = True
) -> Complex:
    """Turn a map (n,) about 0.

    `align` is a boundary vertex, to go to 1, or if not `on_circle` to the right; or a direction d
    in space: the height x.d of the surface, as a function in the plane, has its moment
    sum_v m_v x_v.d f_v about the mean height, m_v the area at a vertex, at angle 0. None is the
    first boundary vertex. ValueError if the height has no moment.
    """
    if align is None:
        align = mesh.loop[0]
    if isinstance(align, int | np.integer):
        if on_circle:
            return at_one(mesh, f, int(align))
        return f * (abs(f[align]) / f[align] if f[align] else 1)
    direction = np.asarray(align)
    mass = mesh.vertex_areas
    height = mesh.V @ direction
    moment = complex((mass * (height - np.average(height, weights=mass)) * f).sum())
    check_slope(align, moment, mass.sum() * np.ptp(height))
    f = f * (abs(moment) / moment)
    if on_circle:
        f[mesh.loop] /= abs(f[mesh.loop])
    return f


def check_slope(align: ArrayLike, moment: complex, most: float) -> None:
    """Raise ValueError if the moment of the height is negligible beside what it may be."""
    if not abs(moment) > 1e-12 * most:
        raise ValueError(f"align={align!r}: the surface has no slope in this direction")


def at_one(mesh: Mesh, f: Complex, vertex: int) -> Complex:
    """Put a boundary vertex at 1, and the boundary on the circle to the last bit."""
    f = f / f[vertex]
    f[mesh.loop] /= abs(f[mesh.loop])
    return f
