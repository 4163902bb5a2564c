"""A part of a map that is too small for double precision is moved to 0, where it is denser."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..arrays import Complex, Ints, evenly_spaced_rows
from ..surface.mesh import Mesh
from ..surface.triangles import extents

FEW_FACES = 1_000  # enough to tell whether there is anything to move
# Faces this small by their distance from 0, and from the circle, have angles with errors of 1e-4.
TOO_SMALL = 1e-12
FEW = 0.01  # of the faces, with which nothing needs to be done
ROUNDS = 3  # of extending again; the first finds most of the digits that f has not


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
