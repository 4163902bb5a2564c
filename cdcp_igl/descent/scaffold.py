"""A scaffold: triangles around a map that keep its boundary from overlapping itself.

Between the boundary and a circle around it, which stays, lies a triangulation whose faces are at
rest as they are, and count little. Map and scaffold together map a disk onto a disk: where no face
is flipped, that is a bijection. After a few steps the scaffold is triangulated anew.

References
----------
Z. Jiang, S. Schaefer, D. Panozzo. Simplicial complex augmentation framework for bijective maps. ACM
Trans. Graph. 36(6), 2017.
"""

from __future__ import annotations

import numpy as np

from .. import libigl
from ..arrays import Complex, Floats, Ints, coordinates, marked
from ..surface.delaunay import intrinsic_delaunay
from ..surface.mesh import Mesh
from .descent import ISOMETRIC, Descent, Limits
from .energies import HALF, SymmetricDirichlet

SHARE = 1e-3  # what all of the scaffold counts, by the energy of the map
ROOM, RING = 2.0, 48  # radius of the circle by that of the map, and its corners
STEPS, FAR_STEPS = 6, 2  # a round; far from the minimum the scaffold is soon in the way
WORTH, LITTLE = 3e-3, 0.1  # a round that gains less is the last, near the minimum and far from it
FAR = 0.9  # above this t, first to 1/2

NONE = np.empty(0, np.int64)


def keeping_apart(mesh: Mesh, f: Complex, t: float, *, near: bool = False) -> tuple[Complex, int]:
    """Let a map f (n,) keep t, and its boundary simple, as it is; return it, and the steps."""
    taken = 0
    if t > FAR and not near:
        f, taken = keeping_apart(mesh, f, HALF)
        near = True
    energy = SymmetricDirichlet.of(mesh, t)
    for far in (False,) if near else (True, False):
        now = energy.softened if far else energy
        f, steps = lowered_with_scaffold(mesh, f, now, far=far)
        taken += steps
    return f, taken


def lowered_with_scaffold(
    mesh: Mesh, f: Complex, energy: SymmetricDirichlet, held: Ints = NONE, *, far: bool = False
) -> tuple[Complex, int]:
    """Lower the energy of a map f (n,), its boundary simple, as it is; count the steps."""
    taken, before, value = 0, np.inf, energy.value(f)
    while ISOMETRIC < value < (1 - (LITTLE if far else WORTH)) * before:
        descent, joined = with_scaffold(mesh, f, energy, held, far=far)
        descent.lower(joined, Limits(FAR_STEPS, worth=LITTLE) if far else Limits(STEPS))
        f, taken = descent.f[: len(f)], taken + descent.steps
        before, value = value, energy.value(f)
    return f, taken


def with_scaffold(
    mesh: Mesh, f: Complex, energy: SymmetricDirichlet, held: Ints = NONE, *, far: bool = False
) -> tuple[Descent, SymmetricDirichlet]:
    """Return a descent of a map f (n,) and a scaffold around it, and the energy of both.

    Vertices that are `held` stay. The energy of a scaffold is soft, too, while a map is `far` from
    the minimum.
    """
    ring, S = triangulated_around(f, mesh.loop)
    z, G = np.append(f, ring), np.concatenate([mesh.F, S])
    of_scaffold = SymmetricDirichlet.of(Mesh(in_space(z), S, S[:0, 0]), HALF)
    share = SHARE * min(max(energy.value(f), SHARE), 1)
    joined = energy.joined(of_scaffold.softened if far else of_scaffold, share)
    stay = marked(len(z), np.append(held, np.arange(len(f), len(z))))
    return Descent(Mesh(in_space(z), G, S[:0, 0]), z, held=stay), joined


def triangulated_around(f: Complex, loop: Ints) -> tuple[Complex, Ints]:
    """Triangulate the outside of the boundary of a map (n,): corners of a circle, and faces.

    The corners are rows n, n + 1, ... of the faces. It is the constrained Delaunay triangulation.
    """
    import mapbox_earcut  # by few maps alone

    boundary = f[loop]
    low, high = (extreme(coordinates(boundary), axis=0) for extreme in (np.min, np.max))
    middle = complex(*((low + high) / 2))
    turns = np.exp(2j * np.pi * np.arange(RING) / RING)
    ring = middle + ROOM * abs(boundary - middle).max() * turns
    z = np.concatenate([ring, boundary])
    points = coordinates(z)
    ends = np.array([RING, len(points)], dtype=np.uint32)
    F = mapbox_earcut.triangulate_float64(points, ends).reshape(-1, 3).astype(np.int64)
    area = libigl.double_areas(points, F)
    F[area < 0] = F[area < 0, ::-1]
    F, _ = intrinsic_delaunay(Mesh(in_space(z), F, F[:0, 0]))
    return ring, np.concatenate([len(f) + np.arange(RING), loop])[F]


def in_space(z: Complex) -> Floats:
    """(n, 3) points of the plane with height 0."""
    return np.column_stack([z.real, z.imag, np.zeros(len(z))])
