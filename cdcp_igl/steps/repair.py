"""Repair of flipped faces: mean-value patches, then relaxation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix, diags
from scipy.sparse.linalg import splu

from ..arrays import Bools, Complex, Floats, Ints
from ..certificate import flipped_faces
from ..distortion import wirtinger_derivative
from ..surface.mesh import DiskMesh

__all__ = ["Repair", "mean_value_weights", "unfold"]

RINGS = 3  # largest radius of a patch around the flipped faces
ROUNDS = 24  # of patches; after these the whole interior is taken
FEW, MANY = 4, 30  # sweeps of relaxation between rounds, and at the end
HALVINGS = 12


@dataclass(frozen=True)
class Repair:
    """What was done about flipped faces.

    Attributes
    ----------
    n_flipped : int
        Faces that the harmonic map had flipped; 0 if there was nothing to do.
    n_moved : int
        Interior vertices that were moved, so that they are not harmonic any more.
    rounds : int
        Patches that were tried.
    """

    n_flipped: int = 0
    n_moved: int = 0
    rounds: int = 0

    def __str__(self) -> str:
        if self.n_flipped == 0:
            return "not needed"
        return (
            f"{self.n_flipped:,} flipped faces unfolded by moving {self.n_moved:,} vertices "
            f"in {self.rounds} rounds"
        )


def unfold(mesh: DiskMesh, f: Complex) -> tuple[Complex, Repair]:
    """Make every face positively oriented, boundary fixed.

    Cotangents of obtuse angles are negative, and a harmonic map with negative weights may
    fold. The vertices of the flipped faces are set to mean-value combinations of their
    neighbours, whose weights are positive, and their surroundings are relaxed towards
    conformality without flipping any other face; everything else stays. This goes on, with
    patches of up to three rings around what is still flipped, until nothing is. Should
    that fail, the patch becomes the whole interior, where Floater's theorem applies:
    positive weights and a convex boundary give an embedding.

    Parameters
    ----------
    mesh : DiskMesh
    f : (n,) complex128
        Map onto the disk, boundary strictly counterclockwise on the circle.

    Returns
    -------
    f : (n,) complex128
        The argument itself if it has no flipped face.
    Repair

    References
    ----------
    M. S. Floater. Mean value coordinates. Comput. Aided Geom. Design 20(1), 2003.
    K. Hormann, G. Greiner. MIPS: an efficient global parametrization method. Curve and
    Surface Design, 1999.
    """
    flipped = _flipped(mesh, f)
    if len(flipped) == 0:
        return f, Repair()
    n_flipped = len(flipped)
    W = mean_value_weights(mesh)
    interior = np.zeros(len(f), dtype=bool)
    interior[mesh.interior] = True
    moved = np.zeros(len(f), dtype=bool)
    rounds = 0
    while len(flipped) and rounds <= ROUNDS:
        folded = np.zeros(len(f), dtype=bool)
        folded[mesh.F[flipped]] = True
        patch = interior & _grow(mesh, folded, min(rounds, RINGS)) if rounds < ROUNDS else interior
        f = _combine(W, f, patch)
        around = interior & _grow(mesh, patch, 2)
        f = _relax(mesh, f, around, FEW)
        moved |= around
        rounds += 1
        flipped = _flipped(mesh, f)
    f = _relax(mesh, f, moved, MANY)
    return f, Repair(n_flipped, int(moved.sum()), rounds)


def mean_value_weights(mesh: DiskMesh) -> csr_matrix:
    """(n, n) mean-value weights: (tan(a/2) + tan(b/2)) / |v_i - v_j|, all positive.

    a and b are the angles at v_i in the two faces at the edge; row i belongs to v_i.
    """
    half_tangents = np.tan(mesh.angles / 2)
    n, rows, columns, weights = len(mesh.V), [], [], []
    for k in range(3):
        for other in ((k + 1) % 3, (k + 2) % 3):
            i, j = mesh.F[:, k], mesh.F[:, other]
            rows.append(i)
            columns.append(j)
            weights.append(half_tangents[:, k] / np.linalg.norm(mesh.V[i] - mesh.V[j], axis=1))
    entries = np.concatenate(weights), (np.concatenate(rows), np.concatenate(columns))
    return csr_matrix(entries, (n, n))


def _flipped(mesh: DiskMesh, f: Complex) -> Ints:
    return flipped_faces(np.column_stack([f.real, f.imag]), mesh.F)[0]


def _grow(mesh: DiskMesh, vertices: Bools, rings: int) -> Bools:
    for _ in range(rings):
        grown = vertices.copy()
        grown[mesh.F[vertices[mesh.F].any(axis=1)]] = True
        vertices = grown
    return vertices


def _combine(W: csr_matrix, f: Complex, patch: Bools) -> Complex:
    """Make the vertices of a patch the weighted means of their neighbours."""
    inside, rest = np.flatnonzero(patch), np.flatnonzero(~patch)
    rows = W[inside]
    system = diags(np.asarray(rows.sum(axis=1)).ravel()) - rows[:, inside]
    given = rows[:, rest] @ f[rest]
    solution = splu(system.tocsc()).solve(np.column_stack([given.real, given.imag]))
    f = f.copy()
    f[inside] = solution[:, 0] + 1j * solution[:, 1]
    return f


# -- relaxation ------------------------------------------------------------------------


def _relax(mesh: DiskMesh, f: Complex, patch: Bools, sweeps: int) -> Complex:
    """Move one vertex after the other to lower the conformal energy of its faces.

    On a face the map is f = p z + q conj(z) in coordinates of the surface; its energy
    (|p|^2 + |q|^2) / (|p|^2 - |q|^2) is 1 where the map is conformal and infinite where
    the face collapses. As a function of one vertex it is a convex quadratic over a linear
    function, hence convex, and Newton's method with backtracking cannot flip a face.
    Vertices of one colour have no face in common and move together; one at a flipped
    face moves only if that unfolds all its faces.
    """
    f = f.copy()
    derivative = wirtinger_derivative(mesh.V, mesh.F)
    stars = [_Star(mesh, derivative, vertices) for vertices in _colour(mesh, patch)]
    for _ in range(sweeps):
        for star in stars:
            star.improve(f)
    return f


class _Star:
    """The faces around an independent set of vertices, one row a corner."""

    def __init__(self, mesh: DiskMesh, derivative: Complex, vertices: Ints) -> None:
        place = np.full(len(mesh.V), -1)
        place[vertices] = np.arange(len(vertices))
        self._face, corner = np.nonzero(place[mesh.F] >= 0)
        self._vertices = vertices
        self._owner = place[mesh.F[self._face, corner]]
        self._corners = mesh.F[self._face]
        self._derivative = derivative[self._face]
        self._own = derivative[self._face, corner]

    def improve(self, f: Complex) -> None:
        """Take one Newton step, in place."""
        c, z = self._own, f[self._corners]
        p = (self._derivative * z).sum(axis=1)
        q = (self._derivative.conj() * z).sum(axis=1)
        above, below = abs(p) ** 2 + abs(q) ** 2, abs(p) ** 2 - abs(q) ** 2
        # Gradients with respect to the vertex (x, y) as complex numbers x + iy. `below` is
        # linear in it, `above` has the Hessian 4 |c|^2.
        d_above, d_below = 2 * (c.conj() * p + c * q), 2 * (c.conj() * p - c * q)
        with np.errstate(all="ignore"):  # at a collapsed face
            ratio = above / below
            gradient = self._sum((d_above - ratio * d_below) / below)
            mixed = 2 * (ratio * d_below - d_above) / below**2
            curvature = 4 * abs(c) ** 2 / below
            xx = self._sum(curvature + mixed.real * d_below.real).real
            yy = self._sum(curvature + mixed.imag * d_below.imag).real
            xy = self._sum(mixed.real * d_below.imag + mixed.imag * d_below.real).real / 2
            step = (
                xy * gradient.imag
                - yy * gradient.real
                + 1j * (xy * gradient.real - xx * gradient.imag)
            ) / (xx * yy - xy**2)
        step[~np.isfinite(step)] = 0

        energy = self._energy(p, q)
        scale = np.ones(len(step))
        for _ in range(HALVINGS):
            move = (scale * step)[self._owner]
            after = self._energy(p + c * move, q + c.conj() * move)
            worse = ~(np.isfinite(after) & (after <= energy))
            if not worse.any():
                break
            scale[worse] /= 2
        scale[worse] = 0
        f[self._vertices] += scale * step

    def _energy(self, p: Complex, q: Complex) -> Floats:
        below = abs(p) ** 2 - abs(q) ** 2
        energy: Floats = np.full(len(p), np.inf)
        np.divide(abs(p) ** 2 + abs(q) ** 2, below, out=energy, where=below > 0)
        return np.bincount(self._owner, energy, len(self._vertices)).astype(float)

    def _sum(self, values: Complex) -> Complex:
        """Add up over the faces around each vertex."""
        n = len(self._vertices)
        return np.bincount(self._owner, values.real, n) + 1j * np.bincount(
            self._owner, values.imag, n
        )


def _colour(mesh: DiskMesh, patch: Bools) -> list[Ints]:
    """Split a set of vertices into sets without common faces, greedily in index order."""
    faces = mesh.F[patch[mesh.F].any(axis=1)]
    neighbours: dict[int, set[int]] = {}
    for face in faces.tolist():
        for vertex in face:
            neighbours.setdefault(vertex, set()).update(face)
    colour: dict[int, int] = {}
    classes: list[list[int]] = []
    for vertex in np.flatnonzero(patch).tolist():
        taken = {colour[w] for w in neighbours[vertex] if w in colour}
        free = next(c for c in range(len(taken) + 1) if c not in taken)
        colour[vertex] = free
        if free == len(classes):
            classes.append([])
        classes[free].append(vertex)
    return [np.array(vertices) for vertices in classes]
