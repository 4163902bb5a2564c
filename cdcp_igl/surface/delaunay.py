"""The intrinsic Delaunay triangulation of a surface.

libigl flips edges one after the other, by their lengths, and among needles to and fro until the
memory is full. Here many are flipped at a time, by coordinates of their two faces in a plane, and
not for ever.

References
----------
M. Fisher, B. Springborn, A. Bobenko, P. Schröder. An algorithm for the construction of intrinsic
Delaunay triangulations with applications to digital geometry processing. SIGGRAPH Courses, 2006.
"""

from __future__ import annotations

import numpy as np

from .. import libigl
from ..arrays import Bools, Complex, Floats, Ints
from .mesh import Mesh

# If the cotangents opposite an edge add up to minus this, its four vertices lie on one circle, as
# far as rounding tells.
ROUNDING = 1e-12
MOST_ROUNDS = 10_000  # 3,000 surfaces take up to 160; a fan in an ellipse, as many as its faces


def intrinsic_delaunay(mesh: Mesh) -> tuple[Ints, Floats]:
    """(m, 3) faces of the intrinsic Delaunay triangulation, and the cotangents of their corners.

    The same surface, vertices and boundary, with edges flipped until the cotangents opposite each
    interior edge add up to no less than zero. An edge with the same face on both sides stays.
    """
    half_edges = _HalfEdges(mesh)
    edges = mesh.edges.twins[0].astype(np.int64)
    rng = np.random.default_rng(0)  # by rows, the edges of a strip would wait for one another
    with np.errstate(divide="ignore", invalid="ignore"):  # faces without area stay
        for _ in range(MOST_ROUNDS):
            edges = edges[half_edges.are_to_flip(edges)]
            if len(edges) == 0:
                break
            edges = half_edges.flip(rng.permutation(edges))
    F, cotangents = half_edges.tail, np.roll(half_edges.cot, -half_edges.m)
    return F.reshape(3, -1).T, cotangents.reshape(3, -1).T


class _HalfEdges:
    """Half-edge k m + f leaves corner k of face f, and lies opposite corner k - 1."""

    def __init__(self, mesh: Mesh) -> None:
        self.m = m = len(mesh.F)
        self.tail = mesh.F.T.flatten()  # to be changed
        self.length = np.roll(
            np.sqrt(libigl.squared_edge_lengths(mesh.scaled, mesh.F)).T.ravel(), m
        )
        self.cot = np.roll(mesh.cotangents.T.ravel(), m)  # of the corner opposite
        self.twin = np.full(3 * m, -1)
        one, other = mesh.edges.twins
        self.twin[one], self.twin[other] = other, one
        self._place = np.arange(3 * m)  # where each comes, while edges are flipped

    def are_to_flip(self, h: Ints) -> Bools:
        """(k,) whether edges, by one half-edge of each, are not Delaunay."""
        H, cot = self.twin[h], self.cot[h]
        return (h % self.m != H % self.m) & (cot + self.cot[H] < -ROUNDING * (1 + abs(cot)))

    def flip(self, edges: Ints) -> Ints:
        """Flip edges (k,), one of each face; return those to look at next."""
        faces, every = np.stack([edges, self.twin[edges]]) % self.m, np.arange(len(edges))
        last = np.empty(self.m, dtype=np.int64)
        last[faces] = every
        goes = (last[faces] == every).all(axis=0)
        changed = self._flip(edges[goes])
        near = np.concatenate([edges[~goes], *(changed + k * self.m for k in range(3))])
        near = near[self.twin[near] >= 0]
        return np.unique(np.minimum(near, self.twin[near]))

    def _flip(self, h: Ints) -> Ints:
        """Flip edges without a common face, unless rounding forbids it; return the faces changed.

        h leads from p to q; a is to its left, and b to its right.
        """
        a_p, b_p, a_q, b_q = corners = self._laid_out(h)
        areas = np.stack([(b_p.conj() * a_p).imag, (a_q.conj() * b_q).imag])  # doubled
        is_convex = (areas > 0).all(axis=0)
        h, (p_area, q_area) = h[is_convex], areas[:, is_convex]
        a_p, b_p, a_q, b_q = corners[:, is_convex]
        H, qa, ap, pb, bq = self._around(h)
        tail, length, cot, twin, place = self.tail, self.length, self.cot, self.twin, self._place
        # pb comes to h and qa to H, and the new edge where these were.
        tail[qa], tail[pb] = tail[bq], tail[ap]
        ba = a_p - b_p
        length[h], length[H] = length[pb], length[qa]
        length[qa] = length[pb] = abs(ba)
        for half, u, v, area in (
            *((qa, b_p, a_p, p_area), (ap, -b_p, ba, p_area), (h, a_p, ba, p_area)),
            *((pb, a_q, b_q, q_area), (bq, a_q, ba, q_area), (H, -b_q, ba, q_area)),
        ):
            cot[half] = (u.real * v.real + u.imag * v.imag) / area
        old, new = np.concatenate([pb, qa]), np.concatenate([h, H])
        place[old] = new
        twins = np.where(twin[old] >= 0, place[twin[old]], -1)
        place[old] = old
        twin[new], twin[twins[twins >= 0]] = twins, new[twins >= 0]
        twin[qa], twin[pb] = pb, qa
        return new % self.m

    def _laid_out(self, h: Ints) -> Complex:
        """(4, k) places of a and b by p, then by q, in a plane in which q is to the right of p."""
        _, qa, ap, pb, bq = self._around(h)
        at_p, at_q, below_p, below_q = (self.cot[half] for half in (qa, ap, bq, pb))
        up, down = self.length[h] / (at_p + at_q), self.length[h] / (below_p + below_q)
        by_p = up * (at_p + 1j), down * (below_p - 1j)
        by_q = up * (1j - at_q), -down * (1j + below_q)
        return np.stack([*by_p, *by_q])

    def _around(self, h: Ints) -> list[Ints]:
        """Twins H (k,), the half-edges after and before h, and those after and before H."""
        H, m = self.twin[h], self.m
        return [H, *(half % (3 * m) for half in (h + m, h - m, H + m, H - m))]
