"""Möbius transformations of the disk, eq. (19), as far as they do no harm, and its rotations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Literal, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Complex, Floats, Ints
from ..surface.mesh import Mesh
from ..surface.triangles import blocks, flipped_faces
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
# What it may cost, in radians of the mean angular distortion or as a share of it, that w is nearer
# to the conformal barycentre than where the distortion is least.
FREE, FREE_SHARE = np.radians(0.05), 0.01


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
        Why the method's result was not used, or not all of it; empty where it was.
    reached : float
        How far w is from 0, by how far the method wanted it: 1, or 1/2, 1/4 ... where faces would
        have been flipped that no repair mends, or the boundary crowded; 0 where it was not used.
    """

    method: str = "none"
    w: complex = 0j
    rejected: str = ""
    reached: float = 1.0

    def __str__(self) -> str:
        note = f" (rejected: {self.rejected})" if self.rejected else ""
        if 0 < self.reached < 1:
            note = f", {self.reached:.3g} of the way ({self.rejected})"
        moved = f", moves a point w to the centre, |w| = {abs(self.w):.4f}" if self.w else ""
        return f"{self.method}{moved}{note}"


@dataclass(frozen=True, eq=False)
class Placed:
    """A map f (n,) where it is to lie, and its flipped faces, as `flipped_faces` finds them."""

    f: Complex
    flipped: tuple[Ints, int]

    @classmethod
    def of(cls, mesh: Mesh, f: Complex) -> Self:
        """Take a map as it is."""
        return cls(f, flipped_faces(f, mesh.F))


Put = TypeVar("Put", bound=Placed)


def normalize(mesh: Mesh, f: Complex, method: MobiusMethod | None) -> tuple[Complex, Normalization]:
    """Apply the best Möbius transformation that does no harm to a map (n,), see `normalized`."""
    placed, done = normalized(mesh, f, method, partial(Placed.of, mesh))
    return placed.f, done


def normalized(
    mesh: Mesh,
    f: Complex,
    method: MobiusMethod | None,
    place: Callable[[Complex], Put],
    *,
    repaired: bool = False,
) -> tuple[Put, Normalization]:
    """Apply the best Möbius transformation that does no harm.

    psi_w flips a face exactly when 1 / conj(w) lies in its circumdisk. A transformation
    that does so, or that crowds the boundary beyond double precision, is halved until it does
    not: what can be gained on the way is gained. It is not applied where it costs angles.

    The first boundary vertex of the map f (n,) lies at 1. `place` is what is done to the map after
    psi_w, before its flipped faces are counted. For maps that it has `repaired` see `harmless`.
    """
    if method is None:
        return place(f), Normalization("none", 0j)
    faces = faces_to_judge_by(len(mesh.F))
    errors = AngleErrors.of(mesh.F[faces], f, mesh.angles_of(faces))
    if method == "nelder-mead":
        most = np.nextafter(errors.mean(0j), 0)
        w = least_angle_distortion_nelder_mead(mesh.F, f, mesh.angles)
    else:
        w, most = conformal_barycenter(f, mesh.vertex_areas), np.inf
        if method == "angle":
            w, most = nearest_to(w, errors)

    def attempt(w: complex) -> tuple[Put, Ints] | None:
        moved = at_one(mesh, mobius_transformation(f, w), mesh.loop[0])
        return with_flipped(moved) if is_around(moved[mesh.loop]) else None

    def with_flipped(f: Complex) -> tuple[Put, Ints]:
        placed = place(f)
        return placed, placed.flipped[0]

    def improves(w: complex) -> bool:
        return errors.mean(w) <= most

    return harmless(method, w, improves, attempt, lambda: with_flipped(f), repaired=repaired)


def nearest_to(barycenter: complex, errors: AngleErrors) -> tuple[complex, float]:
    """Of the transformations that cost next to nothing, find the one nearest to the barycentre.

    The angular distortion hardly depends on where in a long surface w lies: there the noise of a
    scan, or the rounding of another unit, would choose it. So w goes from where the distortion is
    least along the geodesic towards the conformal barycentre, which hardly depends on either, as
    far as the price allows: all the way, or, as the distortion is convex along it, by that share
    of it. Returns w, and the mean distortion in radians that it may have.
    """
    best = least_angle_distortion(errors)
    least = errors.mean(best)
    most = least + min(max(FREE, FREE_SHARE * least), least)  # what is exact stays so
    price = errors.mean(barycenter) - least
    share = 1.0 if price <= most - least else (most - least) / price
    way = (best - barycenter) / (1 - barycenter.conjugate() * best)  # as `mobius_transformation`
    for _ in range(HALVINGS):
        w = composed(barycenter, (1 - share) * way)
        if errors.mean(w) <= most:
            return w, most
        share /= 2
    return best, most


def harmless(
    method: str,
    w: complex,
    improves: Callable[[complex], bool],
    attempt: Callable[[complex], tuple[Moved, Ints] | None],
    without: Callable[[], tuple[Moved, Ints]],
    *,
    repaired: bool = False,
) -> tuple[Moved, Normalization]:
    """Halve w until psi_w does no harm: the map, moved or as it is without, and what was done.

    An attempt gives the moved map and its flipped faces, None where the boundary is crowded. Those
    faces are allowed that are flipped `without` psi_w, too. If they have been `repaired` in vain
    there, and psi_w leaves others, no part of the way is sought, as repair takes long.
    """
    plain: tuple[Moved, Ints] | None = None
    reason = ""
    for halvings in range(HALVINGS):
        if not improves(w):
            reason = reason or "no improvement"
            break
        if (tried := attempt(w)) is None:
            reason = "crowding"
        else:
            moved, flipped = tried
            if len(flipped) and plain is None:
                plain = without()
            if plain is None or np.isin(flipped, plain[1]).all():
                return moved, Normalization(method, w, reason, 0.5**halvings)
            reason = "flipped faces"
            if repaired and len(plain[1]):
                break
        w /= 2
    return (plain or without())[0], Normalization(method, 0j, reason, 0.0)


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
        c = q = 0j
        for part in blocks(len(z)):
            moved = mobius_transformation(z[part], w)
            weighted = mass[part] * moved
            # In an order of summation that no number of threads changes.
            c += complex(weighted.sum())
            q += complex((weighted * moved).sum())
        return c, q

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
    height = mesh.scaled @ direction
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
    f[vertex] = 1  # where it stays, to the last bit, when it is turned again
    return f
