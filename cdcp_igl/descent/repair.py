"""Repair of flipped faces: mean-value patches and relaxation near them, or everywhere."""

from __future__ import annotations

import numpy as np

from ..arrays import Bools, Complex, Ints, marked
from ..records import Repair
from ..starts.tutte import combined, mean_value_weights, tutte_embedding
from ..surface.mesh import Mesh
from ..surface.topology import components_of_pairs
from ..surface.triangles import flipped_faces, flipped_or_flat
from .relaxation import Relaxation

RINGS = 10  # largest radius of a patch around a flipped face
ATTEMPTS = 4  # with patches up to a quarter of that, a half and so on
MAX_FAILED_ATTEMPTS = 2  # in succession
MANY = 0.03  # of the faces: more flipped faces are not near each other, but everywhere
FEW = 10  # flipped faces that are worth another attempt even if the last one repaired none
SOFTNESSES = (0.3, 0.1, 0.03, 0.01, 0.003)  # of the relaxation of flipped faces, in turn
SWEEPS = 4  # of a relaxation near flipped faces
RELAXED = 6  # rings around the vertices that were moved, relaxed with them at the end
MOST_MOVES, MOST_SWEEPS = 200_000, 30  # of single vertices, and of all, at the end


def repaired(mesh: Mesh, f: Complex) -> tuple[Complex, Repair]:
    """Make every face positively oriented, at whatever cost.

    Where `repair_locally` cannot, because of many flipped faces or stubborn ones, the whole
    interior is that of an `tutte_embedding`, and relaxed. The boundary stays where it is.
    """
    g, repair = repair_locally(mesh, f, repairable(mesh))
    if len(flipped_faces(g, mesh.F)[0]):
        whole = Neighbourhood(mesh, np.ones(len(f), dtype=bool))
        whole.moved, (g, _) = whole.free, tutte_embedding(mesh, f)
        g = whole.relaxed(g)
        repair = Repair(repair.n_flipped, len(mesh.interior), repair.rounds + 1)
    return g, repair


def repairable(mesh: Mesh, share: float = MANY) -> float:
    """How many flipped faces are worth repair: a share of all, and one of few."""
    return max(1.0, share * len(mesh.F))


def repair_locally(
    mesh: Mesh, f: Complex, most: float = np.inf, *, is_free: bool = False
) -> tuple[Complex, Repair]:
    """Repair flipped faces by moving vertices near them and no others.

    Cotangents of obtuse angles are negative, and a harmonic map with negative weights may
    flip faces. The vertices of the flipped faces are set to mean-value combinations of their
    neighbours, whose weights are positive; a patch of them is kept if it has fewer flipped
    faces then, and larger the next time if it has not. What no patch repairs, a relaxation
    of the flipped faces may, with the boundary near them if the outline `is_free`. At the end
    what was moved is relaxed towards conformality. Nothing is done about more than `most` flipped
    faces; some may be left. Those that only rounding keeps count as flipped.
    """
    flipped = flipped_or_flat(f, mesh.F)
    if len(flipped) == 0 or len(flipped) > most:
        return f, Repair(len(flipped))
    at_flipped = marked(len(f), mesh.F[flipped])
    near = Neighbourhood(mesh, grow(mesh.F, at_flipped, RINGS + RELAXED + 1), is_free=is_free)
    g = f[near.vertices]
    failed = 0
    for attempt in range(1, ATTEMPTS + 1):
        before = len(near.flipped(g))
        g = near.average(g, attempt * RINGS // ATTEMPTS)
        g = near.relax_flipped(g, attempt)
        left = len(near.flipped(g))
        failed = failed + 1 if left == before else 0
        if left == 0 or failed == MAX_FAILED_ATTEMPTS or left > max(0.9 * before, FEW):
            break
    f = f.copy()
    f[near.vertices] = g if left else near.relaxed(g)
    return f, Repair(len(flipped), int(near.moved.sum()), near.rounds)


class Neighbourhood:
    """A part of a surface, in which vertices move; nothing here costs more than its size.

    Its `vertices` (k,) are rows of V. Those are `free` (k,) to move that lie inside with all their
    faces, and `loose` (k,) to be relaxed, on a free outline, too; `moved` (k,) says which have
    been. The patch around a vertex at a flipped face that is tried next has `reach` (k,) rings;
    `rounds` counts the tries. `weights` (k, k) are positive.
    """

    def __init__(self, mesh: Mesh, inside: Bools, *, is_free: bool = False) -> None:
        faces = np.flatnonzero(inside[mesh.F].all(axis=1))
        self.vertices, corners = np.unique(mesh.F[faces], return_inverse=True)
        self.F: Ints = corners.reshape(-1, 3)
        self.V = mesh.scaled[self.vertices]
        degree = np.bincount(mesh.F.ravel(), minlength=len(mesh.scaled))[self.vertices]
        whole = np.bincount(self.F.ravel(), minlength=len(self.vertices)) == degree
        self.free: Bools = whole & ~mesh.on_boundary[self.vertices]
        self.loose: Bools = whole if is_free else self.free
        self.moved: Bools = np.zeros(len(self.vertices), dtype=bool)
        self.reach: Ints = np.zeros(len(self.vertices), dtype=np.int64)
        self.rounds = 0
        self.weights = mean_value_weights(self.V, self.F, mesh.angles[faces])

    def flipped(self, g: Complex) -> Ints:
        """Rows of F that are not positively oriented, or only as rounding has it."""
        return flipped_or_flat(g, self.F)

    def average(self, g: Complex, rings: int) -> Complex:
        """Set patches around flipped faces to mean values, and keep those that are better then.

        Without progress a patch grows by a ring, up to so many; all do if there are not fewer
        flipped faces then.
        """
        flipped = self.flipped(g)
        while len(flipped) and self.reach[self.F[flipped]].max() <= rings:
            at_flipped = np.unique(self.F[flipped])
            patch = self.free & self._within(at_flipped, self.reach)
            component = _connected(self.F, patch)
            trial = combined(self.weights, g, np.flatnonzero(patch))
            if self.rounds:  # mean values have left faces flipped, or flipped others
                around = self.free & grow(self.F, patch, 2)
                trial = Relaxation(self.V, self.F, around).sweep(trial, SWEEPS)
            # Flipped faces by patch; the first count is that of faces without one.
            counts = [
                np.bincount(component[self.F[rows]].max(axis=1) + 1, minlength=component.max() + 2)
                for rows in (flipped, self.flipped(trial))
            ]
            better = (counts[1] < counts[0])[component + 1] & patch
            g = np.where(better, trial, g)
            self.moved |= better
            before, flipped = flipped, self.flipped(g)
            # Two patches may take turns to flip what the other has repaired. So fewer faces are
            # flipped after each round, or the patches of all that were have grown.
            in_vain = ~better[at_flipped] | (len(flipped) >= len(before))
            self.reach[at_flipped[in_vain]] += 1
            self.rounds += 1
        return g

    def relax_flipped(self, g: Complex, rings: int) -> Complex:
        """Relax around flipped faces, from soft to hard; keep the result if fewer are left."""
        flipped = self.flipped(g)
        if len(flipped) == 0:
            return g
        at_flipped = marked(len(g), self.F[flipped])
        moving = self.loose & grow(self.F, at_flipped, rings)
        relaxation, trial = Relaxation(self.V, self.F, moving), g
        for softness in SOFTNESSES:
            trial = relaxation.sweep(trial, SWEEPS, softness)
            if len(self.flipped(trial)) == 0:
                break
        if len(self.flipped(trial)) < len(flipped):
            self.moved |= moving
            return trial
        return g

    def relaxed(self, g: Complex) -> Complex:
        """Relax what has been moved towards conformality, unless rounding flips a face then."""
        moving = self.loose & grow(self.F, self.moved, RELAXED)
        sweeps = min(MOST_SWEEPS, 1 + MOST_MOVES // (1 + int(moving.sum())))
        trial = Relaxation(self.V, self.F, moving).sweep(g, sweeps)
        if len(self.flipped(trial)) > len(self.flipped(g)):
            return g
        self.moved = moving
        return trial

    def _within(self, sources: Ints, reach: Ints) -> Bools:
        """(k,) vertices within `reach` rings of a source, which has a reach of its own."""
        level = np.full(len(reach), -1)
        level[sources] = reach[sources]
        for _ in range(level.max()):
            highest = level[self.F].max(axis=1) - 1
            for corner in self.F.T:
                np.maximum.at(level, corner, highest)
        return level >= 0


def grow(F: Ints, vertices: Bools, rings: int) -> Bools:
    """(n,) marked vertices, and those within so many rings of them."""
    for _ in range(rings):
        grown = vertices.copy()
        grown[F[vertices[F].any(axis=1)]] = True
        vertices = grown
    return vertices


def _connected(F: Ints, patch: Bools) -> Ints:
    """(n,) numbers of the components of a set of vertices; -1 elsewhere."""
    size = int(np.count_nonzero(patch))
    component = np.full(len(patch), -1)
    component[patch] = np.arange(size)
    i, j = component[F].ravel(), component[np.roll(F, -1, axis=1)].ravel()
    inside = (i >= 0) & (j >= 0)
    component[patch] = components_of_pairs(i[inside], j[inside], size)[1]
    return component
