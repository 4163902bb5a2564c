"""Flipped faces of a map onto the sphere: repaired in charts, then one vertex after the other."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from ..arrays import Floats, coordinates, marked
from ..records import Repair
from ..steps.stereographic import axes_along
from ..surface.mesh import Mesh
from ..verdict.certificate import flipped_on_sphere
from .repair import grow, repair_locally, repairable

HEMISPHERE = 0.5  # cosine of the radius of a chart in which flipped faces are repaired
CHARTS = 200  # of them
# Flipped faces that are untangled, rings around them, moves of a vertex, and planes for each.
FEW, MOST_RINGS, MOST_MOVES, MOST_PLANES = 100, 6, 20_000, 20


def repaired_on_sphere(mesh: Mesh, P: Floats) -> tuple[Floats, Repair]:
    """Repair flipped faces by moving vertices near them, one part of the sphere after the other.

    A part is seen in central projection, which keeps the orientation of its triangles.
    """
    n_flipped = len(flipped := flipped_on_sphere(P, mesh.F)[0])
    if n_flipped > repairable(mesh):
        return P, Repair(n_flipped)
    moved, rounds = np.zeros(len(P), dtype=bool), 0
    tried = np.zeros(len(mesh.F), dtype=bool)
    while len(left := flipped[~tried[flipped]]) and rounds < CHARTS:
        axes = axes_along(P[mesh.F[left[0]]].sum(axis=0))
        height = P @ axes[0]
        faces = np.flatnonzero((height[mesh.F] > HEMISPHERE).all(axis=1))
        tried[left[0]], rounds = True, rounds + 1
        if len(faces) == 0:
            continue
        part, rows = mesh.part(faces)
        z = (P[rows] @ axes[1] + 1j * (P[rows] @ axes[2])) / height[rows]
        f, _ = repair_locally(part, z)
        there = rows[f != z]
        direction = axes[0] + coordinates(f[f != z]) @ axes[1:]
        P = P.copy()
        P[there] = direction / np.linalg.norm(direction, axis=1)[:, None]
        moved[there] = True
        tried[faces] = True
        flipped = flipped_on_sphere(P, mesh.F)[0]
    Q = _untangled(mesh, P) if len(flipped) else P
    moved |= (Q != P).any(axis=1)
    return Q, Repair(n_flipped, int(moved.sum()), rounds)


def _untangled(mesh: Mesh, P: Floats) -> Floats:
    """Move vertices at flipped faces to where they see their neighbours best, one by one.

    All faces of a vertex are positively oriented if it lies on one side of planes through 0 and the
    edges opposite: of all places, in the one farthest from the nearest plane. More rings of
    vertices move where that repairs nothing.

    References
    ----------
    L. A. Freitag, P. Plassmann. Local optimization-based simplicial mesh untangling and
    improvement. Int. J. Numer. Methods Eng. 49, 2000.
    """
    P, F = P.copy(), mesh.F
    by_vertex = np.argsort(F, axis=None, kind="stable")
    start = np.append(0, np.cumsum(np.bincount(F.ravel())))
    flipped, rings, moves = flipped_on_sphere(P, F)[0], 0, 0
    while len(flipped) <= FEW:
        moving = grow(F, marked(len(P), F[flipped]), rings)
        for vertex in np.flatnonzero(moving):
            face, corner = np.divmod(by_vertex[start[vertex] : start[vertex + 1]], 3)
            planes = np.cross(P[F[face, corner - 2]], P[F[face, corner - 1]])
            planes /= np.maximum(np.linalg.norm(planes, axis=1), 1e-300)[:, None]
            place = _deepest(planes)
            if (planes @ place).min() > (planes @ P[vertex]).min():
                P[vertex] = place
        before, flipped = len(flipped), flipped_on_sphere(P, F)[0]
        moves += int(moving.sum())
        if len(flipped) == 0 or moves > MOST_MOVES:
            break
        rings = min(rings + (len(flipped) >= before), MOST_RINGS)
    return P


def _deepest(normals: Floats) -> Floats:
    """Point (3,) of the sphere that is farthest above the lowest of planes, of normals (k, 3).

    It is the centre of the smallest cap around the normals, which two or three of them determine.
    """
    chosen = normals[:MOST_PLANES]
    i, j = np.triu_indices(len(chosen), 1)
    a, b, c = (chosen[list(t)] for t in zip(*combinations(range(len(chosen)), 3), strict=True))
    circumcenters = np.cross(b - a, c - a)
    centers = np.vstack([chosen[i] + chosen[j], circumcenters, -circumcenters])
    centers /= np.maximum(np.linalg.norm(centers, axis=1), 1e-300)[:, None]
    return centers[(centers @ normals.T).min(axis=1).argmax()]
