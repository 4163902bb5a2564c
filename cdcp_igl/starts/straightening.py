"""The shear that all faces of a harmonic map have in common, taken out of its boundary."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..arrays import Complex, Floats, Ints, evenly_spaced_rows
from ..records import Straightening
from ..steps.circle import RESOLVED
from ..steps.least_distortion import pseudo_huber_corner
from ..surface.mesh import Mesh
from ..verdict.certificate import increments, is_around
from ..verdict.distortion import angles_between, plane_angles
from .recentring import FEW_FACES

MANY_FACES = 30_000  # for what is gained by straightening
WORTH = 0.02  # of the mean angular distortion: a smaller gain is not worth two solves
STEPS = 8  # of Gauss-Newton; one is enough but for the strongest shear
# Rounds of reweighted least squares: to tell whether there is shear, and to take it out.
FEW_WEIGHTINGS, WEIGHTINGS = 4, 8
HALVINGS = 5


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
