"""An outline that cannot overlap itself: the air around a map is triangulated, too.

Between the outline and a circle around it, which stays, lies a triangulation whose faces are at
rest as they are, and count little. Map and air together map a disk onto a disk: where no face is
flipped, that is a bijection. After a few steps the air is triangulated anew.

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
from .balance import HALF, Energy, Newton

AIR = 1e-3  # what all air counts, by the energy of the map
ROOM, RING = 2.0, 48  # radius of the circle by that of the map, and its corners
STEPS, FAR_STEPS = 6, 2  # a round; far from the minimum the air is soon in the way
WORTH, LITTLE = 3e-3, 0.1  # a round that gains less is the last, near the minimum and far from it
FAR = 0.9  # above this t, first to 1/2


def kept_apart(
    mesh: Mesh, f: Complex, t: float, *, k: float = 1.0, near: bool = False
) -> tuple[Complex, int]:
    """Let a map f (n,) whose outline is simple keep t, and its outline simple; count the steps."""
    taken = 0
    if t > FAR and not near:
        f, taken = kept_apart(mesh, f, HALF, k=k)
        near = True
    of_map = Energy.of(mesh, t, k)
    for far in (False,) if near else (True, False):
        now = of_map.softened if far else of_map
        before, value = np.inf, now.value(f)
        # It falls by that share each time, and is bounded below.
        while value < (1 - (LITTLE if far else WORTH)) * before:
            f, steps = _one_round(mesh, f, now, AIR * min(max(value, AIR), 1), far)
            taken, before, value = taken + steps, value, now.value(f)
    return f, taken


def _one_round(
    mesh: Mesh, f: Complex, energy: Energy, share: float, far: bool
) -> tuple[Complex, int]:
    """Take a few steps, with air (n,) around the map that counts so much."""
    ring, S = air(f, mesh.loop)
    z, G = np.append(f, ring), np.concatenate([mesh.F, S])
    ring_rows = np.arange(len(f), len(z))
    of_air = Energy.of(Mesh(_in_space(z), S, S[:0, 0]), HALF)
    joined = energy.joined(of_air.softened if far else of_air, share)
    newton = Newton(Mesh(_in_space(z), G, S[:0, 0]), z, held=marked(len(z), ring_rows))
    newton.descend(joined, *(FAR_STEPS, LITTLE) if far else (STEPS,))
    return newton.f[: len(f)], newton.steps


def air(f: Complex, loop: Ints) -> tuple[Complex, Ints]:
    """Triangulate the outside of the outline of a map (n,): corners of a circle, and faces.

    The corners are rows n, n + 1, ... of the faces. It is the constrained Delaunay triangulation.
    """
    import mapbox_earcut  # by few maps alone

    outline = f[loop]
    low, high = (extreme(coordinates(outline), axis=0) for extreme in (np.min, np.max))
    middle = complex(*((low + high) / 2))
    turns = np.exp(2j * np.pi * np.arange(RING) / RING)
    ring = middle + ROOM * abs(outline - middle).max() * turns
    z = np.concatenate([ring, outline])
    points = coordinates(z)
    ends = np.array([RING, len(points)], dtype=np.uint32)
    F = mapbox_earcut.triangulate_float64(points, ends).reshape(-1, 3).astype(np.int64)
    area = libigl.double_areas(points, F)
    F[area < 0] = F[area < 0, ::-1]
    F, _ = intrinsic_delaunay(Mesh(_in_space(z), F, F[:0, 0]))
    return ring, np.concatenate([len(f) + np.arange(RING), loop])[F]


def _in_space(z: Complex) -> Floats:
    return np.column_stack([z.real, z.imag, np.zeros(len(z))])
