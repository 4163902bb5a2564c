"""What is corrected of a harmonic map: common shear, and a place too small for doubles.

Straightening takes the shear out; recentering moves a tiny region deep inside to 0, where doubles
are denser.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..arrays import Complex, Floats, Ints, evenly_spaced_rows
from ..steps.circle import RESOLVED
from ..steps.least_distortion import pseudo_huber_corner
from ..surface.mesh import Mesh
from ..verdict.certificate import increments, is_around
from ..verdict.distortion import angles_between, plane_angles

FEW_FACES = 1_000  # enough to tell whether there is anything to correct
MANY_FACES = 30_000  # for what is gained by straightening
WORTH = 0.02  # of the mean angular distortion: a smaller gain is not worth two solves
STEPS = 8  # of Gauss-Newton; one is enough but for the strongest shear
# Rounds of reweighted least squares: to tell whether there is shear, and to take it out.
FEW_WEIGHTINGS, WEIGHTINGS = 4, 8
HALVINGS = 5
# Faces this small by their distance from 0, and from the circle, have angles with errors of 1e-4.
TOO_SMALL = 1e-12
FEW = 0.01  # of the faces, with which nothing needs to be done
ROUNDS = 3  # of extending again; the first finds most of the digits that f has not


@dataclass(frozen=True)
class Straightening:
    """What was done about the shear that all faces have in common.

    Attributes
    ----------
    shear : float
        Its Beltrami coefficient |mu|; 0 where it was not worth a correction.
    before, after : float
        Mean angular distortion in degrees, over at most 30,000 faces. 0 where nothing was done.
    """

    shear: float = 0.0
    before: float = 0.0
    after: float = 0.0

    def __str__(self) -> str:
        if not self.before:
            return "not needed"
        return (
            f"common shear {self.shear:.3f}, angular distortion from {self.before:.3f} to "
            f"{self.after:.3f} degrees"
        )


def straighten(
    mesh: Mesh, f: Complex, extend: Callable[[Complex], Complex]
) -> tuple[Complex, Straightening]:
    """Move the boundary along the circle such that the interior is not sheared as a whole.

    With boundary values ``sum_k c[k] zeta^k``, a harmonic map of the disk is the sum of
    ``c[k] z^k`` over k >= 0 and of ``c[-k] conj(z)^k``. Conformal are the first; of the others,
    conj(z) fades away from the boundary no faster than z does: ``c[-1]`` shears all of the
    interior by the same. On a boundary of many vertices it is nearly 0. On one of few vertices,
    such as the edge of one face taken out of a closed surface, it is not, and where most of the
    surface is mapped far inside, nearly all of its distortion is this. Moving the boundary along
    the circle by the angle theta = Re(a conj(zeta)^2) changes ``c[-1]`` by i a / 2 and, besides,
    ``c[3]`` alone; a is found by Gauss-Newton on the sum of the angle errors. `extend` extends
    boundary values harmonically; the map is returned as it is where less than 2 % of the errors
    can be gained, or where arcs are too short for positions on the circle to describe them well.
    """
    few = evenly_spaced_rows(len(mesh.F), FEW_FACES)
    shear, share = common_shear(f, mesh.F[few], mesh.angles[few])
    if share < WORTH or increments(f[mesh.loop]).min() < RESOLVED:
        return f, Straightening()
    sample = evenly_spaced_rows(len(mesh.F), MANY_FACES)
    faces, angles = mesh.F[sample], mesh.angles[sample]
    first = last = float(abs(plane_angles(f, faces) - angles).mean())
    for _ in range(STEPS):
        straight = _straighter(mesh, f, extend, faces, angles, last)
        if straight is None:
            break
        before, (f, last) = last, straight
        if last > (1 - WORTH) * before:
            break
    degrees = np.degrees([first, last])
    return f, Straightening(abs(shear), *degrees.tolist()) if last < first else Straightening()


def _straighter(
    mesh: Mesh,
    f: Complex,
    extend: Callable[[Complex], Complex],
    faces: Ints,
    angles: Floats,
    before: float,
) -> tuple[Complex, float] | None:
    """Take one step of Gauss-Newton: the map and its mean distortion; None if not lower."""
    boundary = f[mesh.loop]
    third = extend(boundary**3)
    # To first order in a = x + iy, i zeta theta = i (a conj(zeta) + conj(a) zeta^3) / 2, and
    # the extension of conj(zeta) is conj(f).
    moves = [(f.conj() + third) / 2 * 1j, (third - f.conj()) / 2]
    corners = f.take(faces.T)
    responses = [_angle_response(corners, move.take(faces.T)).imag for move in moves]
    a, _ = _least_errors(WEIGHTINGS, angles_between(*corners) - angles.T, *responses)
    for _ in range(HALVINGS):
        moved = boundary * np.exp(1j * (a * boundary.conj() ** 2).real)
        moved /= moved[0]
        moved /= abs(moved)
        if is_around(moved):
            straight = extend(moved)
            after = float(abs(plane_angles(straight, faces) - angles).mean())
            if after < before:
                return straight, after
        a /= 2
    return None


def is_sheared(f: Complex, F: Ints, angles: Floats) -> bool:
    """Whether these faces have so much shear in common that it is worth taking out."""
    return common_shear(f, F, angles)[1] >= WORTH


def common_shear(f: Complex, F: Ints, angles: Floats) -> tuple[complex, float]:
    """Find the shear f - mu conj(f) of the image that lowers the angular distortion most.

    Returns mu, and the share of the distortion of faces F, with these angles (k, 3) on the surface,
    that it would remove.
    """
    corners = f.take(F.T)
    errors = angles_between(*corners) - angles.T
    response = _angle_response(corners, -corners.conj())
    mu, after = _least_errors(FEW_WEIGHTINGS, errors, response.imag, response.real)
    before = abs(errors).mean()
    return mu, float(1 - after / before) if before > 0 else 0.0


def _angle_response(corners: Complex, move: Complex) -> Complex:
    """(3, k) change of the angles of plane triangles when their corners (3, k) move.

    An edge e that changes by de turns by Im(de / e). Edges that have collapsed do not count. The
    imaginary part is the change, and the real part that for i times the move.
    """
    edge, change = (x[[1, 2, 0]] - x for x in (corners, move))  # leaves its corner
    turn = np.divide(change, edge, out=np.zeros_like(edge), where=edge != 0)
    return turn[[2, 0, 1]] - turn


def _least_errors(
    weightings: int, errors: Floats, by_x: Floats, by_y: Floats
) -> tuple[complex, float]:
    """Find x + iy with the least mean of |errors + x by_x + y by_y|, and that mean."""
    x = y = 0.0
    terms = np.array([by_x.ravel(), by_y.ravel(), errors.ravel()])
    r = terms[2]
    soft = pseudo_huber_corner(r)
    for _ in range(weightings):
        weighted = terms[:2] / np.sqrt(r * r + soft * soft)
        (xx, xy, gx), (_, yy, gy) = np.einsum("ac,bc->ab", weighted, terms).tolist()
        determinant = xx * yy - xy * xy
        if not determinant > 0:
            break
        x, y = (xy * gy - yy * gx) / determinant, (xy * gx - xx * gy) / determinant
        r = np.einsum("a,ac->c", [x, y, 1], terms)
    return complex(x, y), float(abs(r).mean())


def recentered(
    mesh: Mesh, f: Complex, extend_again: Callable[[Complex], Complex]
) -> tuple[Complex, complex]:
    """Move a region that is too small for the doubles where it lies to 0.

    A surface that is closed but for a small hole, or that has its boundary at the end of a long
    arm, is mapped to a spot around a point w; a face of size s there has errors of
    1e-16 abs(w) / s. Differences from one of the vertices keep their digits, and psi_w, eq. (19),
    takes them to the disk again:

        psi_w(w + d) = d / (1 - abs(w)^2 - conj(w) d).

    `extend_again` computes the interior of a map again, by differences of neighbours, such that
    small parts have all their digits if they lie at 0; the boundary may be a translated circle.
    Returns the map, the argument itself if nothing is too small, and the point w that went to 0.
    """
    vertex = deep_vertex(mesh, f, mesh.F[evenly_spaced_rows(len(mesh.F), FEW_FACES)])
    if vertex is None:
        return f, 0j
    w, d = complex(f[vertex]), f - f[vertex]
    for _ in range(ROUNDS):
        d = extend_again(d)
        w, d = w + complex(d[vertex]), d - d[vertex]
    if not abs(w) < 1 - TOO_SMALL:  # the part lies at the circle, and not inside
        return f, 0j
    f = d / (1 - abs(w) ** 2 - np.conj(w) * d)
    f[mesh.loop] /= abs(f[mesh.loop])
    return f, w


def deep_vertex(mesh: Mesh, f: Complex, faces: Ints) -> int | None:
    """Find the interior vertex in the middle of the faces (k, 3) too small for their place.

    They are far from the circle and from 0. None in the ordinary case.
    """
    size, distance = extents(f.take(faces.T))
    small = size < TOO_SMALL * np.minimum(distance, 1 - distance)
    if np.count_nonzero(small) <= FEW * len(faces):
        return None
    corners = f[faces[small]]
    middle = complex(np.median(corners.real), np.median(corners.imag))
    inside: Ints = mesh.interior
    return int(inside[abs(f[inside] - middle).argmin()])


def extents(corners: Complex) -> tuple[Floats, Floats]:
    """(k,) longest edges of faces with these corners (3, k), and their largest distances from 0."""
    size = abs(corners - corners[[2, 0, 1]]).max(axis=0)
    return size, abs(corners).max(axis=0)
