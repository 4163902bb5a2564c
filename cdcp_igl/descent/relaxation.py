"""Relaxation: vertices are moved one after the other towards conformality."""

from __future__ import annotations

import numpy as np

from ..arrays import Bools, Complex, Floats, Ints, Numbers, places
from ..verdict.distortion import wirtinger_derivative

HALVINGS = 12  # of a vertex's step
HALVINGS_AT_FLIPPED = 4  # of that of a vertex at a flipped face: shorter ones hardly ever help
TERMS = 5  # a gradient, and a symmetric Hessian


class Relaxation:
    """Lower the conformal energy of the faces around some vertices, one vertex at a time.

    On a face the map is f = p z + q conj(z) in coordinates of the surface; its energy
    (|p|^2 + |q|^2) / (|p|^2 - |q|^2) is 1 where the map is conformal and infinite where the
    face collapses. As a function of one vertex it is a convex quadratic over a linear
    function, hence convex, and Newton's method with backtracking cannot flip a face. With a
    softness s, the determinant J = |p|^2 - |q|^2 is replaced by (J + sqrt(J^2 + s^2)) / 2, in
    units of its size at the vertex: flipped faces have a finite, large energy then, which
    falls until they are positively oriented. Vertices of one colour have no face in common and
    move together. F has all faces of the vertices (n,) that are `moving`.

    References
    ----------
    K. Hormann, G. Greiner. MIPS: an efficient global parametrization method. Curve and
    Surface Design, 1999.

    V. Garanzha et al. Foldover-free maps in 50 lines of code. ACM Trans. Graph. 40(4), 2021.
    """

    def __init__(self, V: Floats, F: Ints, moving: Bools) -> None:
        derivative = wirtinger_derivative(V, F)
        self._stars = [_Star(len(V), F, derivative, chosen) for chosen in _colour(F, moving)]

    @np.errstate(all="ignore")  # at a collapsed face
    def sweep(self, f: Complex, times: int, softness: float = 0.0) -> Complex:
        """Move every vertex so many times.

        With a softness of 0 no face is flipped, and a vertex at a flipped face moves only if then
        none of its faces is flipped.
        """
        f = f.copy()
        for _ in range(times):
            for star in self._stars:
                star.improve(f, softness)
        return f


class _Star:
    """The faces around an independent set of vertices, one column a corner.

    What has two rows is for p and q, that is for the derivatives and their conjugates.
    """

    def __init__(self, n: int, F: Ints, derivative: Complex, vertices: Ints) -> None:
        row = places(vertices, n)
        face, corner = np.nonzero(row[F] >= 0)
        self._vertices = vertices
        self._owner = row[F[face, corner]]
        self._corners = F[face].T.copy()
        # By differences from the first corner, lest a small face lose its digits to its place.
        one, other = derivative[face, 1:].T
        self._second, self._third = (np.array([c, c.conj()]) for c in (one, other))
        c = derivative[face, corner]
        self._own, self._bend = np.array([c, c.conj()]), 4 * abs(c) ** 2
        self._owners = (np.arange(TERMS)[:, None] * len(vertices) + self._owner).ravel()
        self._count = np.bincount(self._owner, minlength=len(vertices))

    def improve(self, f: Complex, softness: float) -> None:
        """Take one Newton step, in place."""
        first, second, third = f[self._corners]
        pq = self._second * (second - first) + self._third * (third - first)
        above, below = _sum_and_difference(abs(pq) ** 2)
        soft = None
        if softness:
            soft = (softness * (self._sum(above) / self._count))[self._owner]
        # Gradients with respect to the vertex (x, y) as complex numbers x + iy. `below` is
        # linear in it, `above` has the Hessian 4 |c|^2.
        lifted, slope = softened(below, soft)
        d_above, d_below = _sum_and_difference(2 * (self._own[::-1] * pq))
        d_below *= slope
        change = d_above - above / lifted * d_below  # of the energy, times `lifted`
        gradient, mixed = change / lifted, -2 * change / lifted**2
        curvature = self._bend / lifted
        terms = [
            *(gradient.real, gradient.imag),
            curvature + mixed.real * d_below.real,
            curvature + mixed.imag * d_below.imag,
            mixed.real * d_below.imag + mixed.imag * d_below.real,
        ]
        sums = np.bincount(self._owners, np.concatenate(terms), TERMS * len(self._vertices))
        x, y, xx, yy, twice_xy = sums.reshape(TERMS, -1)
        xy = twice_xy / 2
        step = xy * y - yy * x + 1j * (xy * x - xx * y)
        step /= xx * yy - xy**2
        step[~np.isfinite(step)] = 0

        energy = self._energy(above, lifted)
        most = np.where(np.isfinite(energy), HALVINGS, HALVINGS_AT_FLIPPED)
        scale = np.ones(len(step))
        for halvings in range(HALVINGS):
            moved = pq + self._own * (scale * step)[self._owner]
            above, below = _sum_and_difference(abs(moved) ** 2)
            after = self._energy(above, softened(below, soft)[0])
            worse = ~(np.isfinite(after) & (after <= energy))
            if not (worse & (halvings < most)).any():
                break
            scale[worse] /= 2
        scale[worse] = 0
        f[self._vertices] += scale * step

    def _energy(self, above: Floats, lifted: Floats) -> Floats:
        """Add up the energies around each vertex; infinite where a face is flipped, unless soft."""
        return self._sum(np.where(lifted > 0, above / lifted, np.inf))

    def _sum(self, values: Floats) -> Floats:
        """Add up over the faces around each vertex."""
        return np.bincount(self._owner, values, len(self._vertices)).astype(float, copy=False)


def _sum_and_difference(pair: Numbers) -> tuple[Numbers, Numbers]:
    return pair[0] + pair[1], pair[0] - pair[1]


def softened(below: Floats, soft: Floats | None) -> tuple[Floats, Floats | float]:
    """(J + sqrt(J^2 + s^2)) / 2 without cancellation, and its derivative; J itself where s = 0."""
    if soft is None:
        return below, 1.0
    root = np.hypot(below, soft)
    lifted = np.where(below > 0, (below + root) / 2, soft**2 / (2 * (root - below)))
    hard = soft == 0
    slope = np.where(hard, 1.0, lifted / root)
    return np.where(hard, below, lifted), slope


def _colour(F: Ints, moving: Bools) -> list[Ints]:
    """Split a set of vertices into sets without common faces.

    Each takes, of the vertices that are left, those that come before all their neighbours in
    a scattered order.
    """
    left = np.flatnonzero(moving)
    rank = np.full(len(moving), -1)
    rank[left] = np.random.default_rng(0).permutation(len(left))
    F = F[moving[F].any(axis=1)]
    classes = []
    while len(left):
        ranks = rank[F]
        highest = np.full(len(moving), -1)
        for corner in F.T:
            np.maximum.at(highest, corner, ranks.max(axis=1))
        chosen = left[highest[left] == rank[left]]
        classes.append(chosen)
        rank[chosen] = -1
        left = left[rank[left] >= 0]
        F = F[(rank[F] >= 0).any(axis=1)]
    return classes
