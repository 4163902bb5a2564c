"""The certificate of a free outline: a simple polygon, and no flipped face."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Bools, Complex, Floats, Ints, as_complex, coordinates, places, shifted
from ..errors import spell
from ..surface.location import z_order
from ..surface.mesh import Mesh
from ..surface.triangles import BLOCK, EPS, flipped_faces, orientations
from .certificate import Verified

if TYPE_CHECKING:
    from fractions import Fraction

MOST_NEAR = 1 << 20  # edges that rays are held against at a time


@dataclass(frozen=True, eq=False)
class OutlineCertificate(Verified):
    """What was verified on the coordinates of a map with a free outline.

    If the outline, the image of the boundary, is a simple polygon and every face is positively
    oriented, the map is a bijection onto the polygon: each of its points has as many images as
    the outline goes around it, and that is once inside and never outside.

    Attributes
    ----------
    winding_number : int
        Turns of the outline: its exterior angles by 2 pi.
    meeting : (k, 2) ndarray of int64
        Edges of the outline that meet elsewhere than at a common end, exactly: the boundary
        vertices that they leave. Some if there are any, and not always all.
    finite, flipped, n_exact
        As in `Certificate`.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.spherical_cap(20)
    >>> certificate = cdcp_igl.free_map(V, F).certificate
    >>> certificate.valid, certificate.winding_number, len(certificate.meeting)
    (True, 1, 0)
    """

    finite: bool
    winding_number: int
    meeting: Ints
    flipped: Ints
    n_exact: int

    @property
    def valid(self) -> bool:
        """True for a bijection onto a simple polygon."""
        return self.simple and len(self.flipped) == 0

    @property
    def simple(self) -> bool:
        """True if the outline goes around once and meets itself nowhere."""
        return self.finite and self.winding_number == 1 and len(self.meeting) == 0

    def _said(self) -> str:
        overlap = f"overlaps itself at {spell(self.meeting)}" if len(self.meeting) else "simple"
        return f"outline {overlap}, winding number {self.winding_number}"


def certify_outline(
    mesh: Mesh, uv: Floats, known: tuple[Ints, int] | None = None
) -> OutlineCertificate:
    """Verify a map (n, 2) of a mesh with a free outline; `flipped_faces` of it may be `known`."""
    if not np.isfinite(uv).all():
        return OutlineCertificate(False, 0, np.empty((0, 2), int), np.arange(len(mesh.F)), 0)
    f = as_complex(uv)
    after = shifted(np.arange(len(mesh.loop)))
    turns = exterior_angles(f[mesh.loop], after).sum() / (2 * np.pi)
    flipped, n_exact = known or flipped_faces(f, mesh.F)
    meeting = mesh.loop[meeting_edges(f[mesh.loop])]
    return OutlineCertificate(True, round(turns), meeting, flipped, n_exact)


def exterior_angles(z: Complex, after: Ints) -> Floats:
    """(n,) turns of closed polygons in radians; -pi where one goes straight back, as at a slit."""
    edges, before = z[after] - z, places(after, len(z))
    angle = np.angle(edges * edges[before].conj())
    side = orientations(z[before], z, z[after])
    return np.where(side == 0, np.where(abs(angle) > 1, -np.pi, 0), side * abs(angle))


def meeting_edges(z: Complex) -> Ints:
    """(k, 2) edges of a closed polygon that meet elsewhere than at a common end; some if any do.

    Edge i leaves z[i]. Whether edges meet is decided exactly.
    """
    head = shifted(z)

    def met(pairs: Ints) -> Ints:
        pairs = pairs[_may_meet(z, *pairs.T)]
        i, j = pairs.T
        sides = [orientations(z[i], head[i], end) for end in (z[j], head[j])]
        sides += [orientations(z[j], head[j], end) for end in (z[i], head[i])]
        # Their boxes overlap, so that they meet if both have the other's ends on either side, or
        # on their line: neighbours always do, and go back along one line if all is on it.
        found = (sides[0] * sides[1] <= 0) & (sides[2] * sides[3] <= 0)
        found[_are_neighbours(i, j, len(z)) & np.any(sides, axis=0)] = False
        return pairs[found]

    return _among_near_edges(np.stack([coordinates(z), coordinates(head)]), met)


def overlapping_edges(z: Complex, after: Ints) -> Ints:
    """(k, 2) edges of closed polygons at which what lies on their left overlaps; some if any do.

    Edge i runs from z[i] to ``z[after[i]]``. Overlapping are edges that cross, and edges that begin
    on one another where the wedges between the edges of their polygons do; that they touch is not
    enough. All is decided exactly.
    """
    before = places(after, len(z))
    order = z_order(z)

    def overlap(pairs: Ints) -> Ints:
        i, j = order[pairs].T
        side = [orientations(z[i], z[after[i]], z[end]) for end in (j, after[j])]
        other = [orientations(z[j], z[after[j]], z[end]) for end in (i, after[i])]
        found = (side[0] * side[1] < 0) & (other[0] * other[1] < 0)
        for one, two, beside in ((i, j, side[0]), (j, i, other[0])):  # does `two` begin on `one`?
            at, start, end = z[two], z[one], z[after[one]]
            on = (beside == 0) & (at != end) & _in_box(at, start, end)
            k = np.flatnonzero(on & ~found)
            back = np.where(at[k] == start[k], z[before[one[k]]], start[k])
            wedges = (end[k], back), (z[after[two[k]]], z[before[two[k]]])
            for (out, last), (first, _) in (wedges, wedges[::-1]):
                found[k] |= _in_wedge(at[k], out, last, first)
        return order[pairs[found]]

    return _among_near_edges(np.stack([coordinates(z), coordinates(z[after])])[:, order], overlap)


def _in_box(z: Complex, one: Complex, other: Complex) -> Bools:
    """(k,) whether points lie in the boxes around two others each."""
    low_x, high_x = np.minimum(one.real, other.real), np.maximum(one.real, other.real)
    low_y, high_y = np.minimum(one.imag, other.imag), np.maximum(one.imag, other.imag)
    inside = (low_x <= z.real) & (z.real <= high_x) & (low_y <= z.imag) & (z.imag <= high_y)
    return np.asarray(inside)


def _in_wedge(at: Complex, out: Complex, back: Complex, z: Complex) -> Bools:
    """(k,) whether z is seen in the wedge from `out`, which counts, counterclockwise to `back`.

    A wedge that ends where it begins is the full angle, as of faces around the end of a slit.
    """
    turn, left, right = (orientations(at, p, q) for p, q in ((out, back), (out, z), (z, back)))

    def along(p: Complex, q: Complex) -> Bools:  # of points on a line with `at`
        return np.asarray(((p - at) * (q - at).conj()).real > 0)

    inside = np.select(
        [turn > 0, turn < 0, along(out, back)],
        [(left > 0) & (right > 0), (left >= 0) | (right > 0), True],
        left > 0,
    )
    return np.asarray(inside | ((left == 0) & along(out, z)))


def goes_around(z: Complex, after: Ints, edges: Ints) -> Iterator[tuple[Ints, Ints, Ints]]:
    """Find which edges of closed polygons lie to the right of the left sides of some of them.

    That is the count of how many times the polygons go around the place immediately left of the
    middle of an edge, exactly; no edges may cross, and the given ones may not be level.

    Yields
    ------
    query, edge, sign : (k,) ndarray of int64
        Row in `edges`, edge that a ray to the right passes, 1 if it goes up and -1 if down. Each
        time for some of the `edges`, all that is passed.
    """
    low, high = z.imag[edges], z.imag[after[edges]]
    level = low / 2 + high / 2
    level = np.where(level == np.maximum(low, high), np.minimum(low, high), level)
    order = np.argsort(level)
    y, y_next = z.imag, z.imag[after]
    first, last = (
        np.searchsorted(level[order], end(y, y_next)) for end in (np.minimum, np.maximum)
    )
    change = [np.bincount(rank, minlength=len(edges) + 1)[:-1] for rank in (first, last)]
    near = np.cumsum(np.cumsum(change[0] - change[1]))  # edges at the level of each and before
    upwards = high > low
    ends = np.flatnonzero(np.diff(near // MOST_NEAR)) + 1
    for start, stop in pairwise([0, *ends.tolist(), len(order)]):
        begin = np.clip(first, start, stop)
        count = np.clip(last, start, stop) - begin
        edge = np.repeat(np.arange(len(z)), count)
        rank = np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count) + begin[edge]
        query = order[rank]
        own = edges[query]
        x, error = _crossing(z[edge], z[after[edge]], level[query])
        x_own, error_own = _crossing(z[own], z[after[own]], level[query])
        right = x > x_own
        in_doubt = np.flatnonzero(abs(x - x_own) <= error + error_own)
        both = (np.sort([z[e], z[after[e]]], axis=0) for e in (edge[in_doubt], own[in_doubt]))
        is_other = np.not_equal(*both).any(axis=0)
        right[in_doubt] = upwards[query[in_doubt]]  # if one lies on the other
        for k in in_doubt[is_other].tolist():
            at = level[query[k]]
            gap = _exact(z, after, edge[k], at) - _exact(z, after, own[k], at)
            right[k] = gap > 0 or (gap == 0 and upwards[query[k]])
        sign = np.where(y_next[edge] > y[edge], 1, -1)
        yield query[right], edge[right], sign[right]


def _crossing(a: Complex, b: Complex, y: Floats) -> tuple[Floats, Floats]:
    """(k,) where edges from a to b are at heights y, and bounds of the errors."""
    share = (y - a.imag) / (b.imag - a.imag)
    x = a.real + share * (b.real - a.real)
    return x, 8 * EPS * (abs(a.real) + abs(b.real))


def _exact(z: Complex, after: Ints, edge: int, y: float) -> Fraction:
    from fractions import Fraction  # for the few that floats do not tell

    a, b = z[edge], z[after[edge]]
    ax, ay, bx, by = (Fraction(float(c)) for c in (a.real, a.imag, b.real, b.imag))
    return ax + (Fraction(float(y)) - ay) / (by - ay) * (bx - ax)


def _among_near_edges(ends: Floats, found_in: Callable[[Ints], Ints]) -> Ints:
    """(k, 2) what is first found in pairs (., 2) of edges (2, n, 2) whose boxes overlap.

    Boxes around runs of edges, the halves of these and so on: only where two boxes overlap, runs
    are looked into.
    """
    n = ends.shape[1]
    depth = (n - 1).bit_length()
    low, high = np.full((2, 1 << depth, 2), np.inf) * [[[1]], [[-1]]]  # empty boxes at the end
    low[:n], high[:n] = ends.min(axis=0), ends.max(axis=0)
    boxes = [(low, high)]
    for _ in range(depth):
        low, high = low.reshape(-1, 2, 2).min(axis=1), high.reshape(-1, 2, 2).max(axis=1)
        boxes.append((low, high))
    stack = [(depth, np.zeros((1, 2), dtype=np.int64))]
    while stack:
        level, pairs = stack.pop()
        if level == 0:
            if len(found := found_in(pairs)):
                return found
            continue
        (low, high), level = boxes[level - 1], level - 1
        halves = 2 * pairs[:, None] + [[0, 0], [0, 1], [1, 0], [1, 1]]
        i, j = halves.reshape(-1, 2).T
        kept = np.flatnonzero((i < j) | ((i == j) & (level > 0)))
        i, j = i[kept], j[kept]
        over = ((low[i] <= high[j]) & (low[j] <= high[i])).all(axis=1)
        pairs = np.column_stack([i[over], j[over]])
        # The first part is looked into first, so that the others take no memory meanwhile.
        stack += [(level, pairs[start : start + BLOCK]) for start in range(0, len(pairs), BLOCK)]
    return np.empty((0, 2), dtype=np.int64)


def _may_meet(z: Complex, i: Ints, j: Ints) -> Bools:
    """(k,) no for neighbours i < j that do not leave their common end for the same quadrant."""
    n = len(z)
    middle = np.where(j - i == 1, j, i)
    back, on = z[middle - 1] - z[middle], z[(middle + 1) % n] - z[middle]
    folded = (np.sign(back.real) == np.sign(on.real)) & (np.sign(back.imag) == np.sign(on.imag))
    return np.asarray(folded | ~_are_neighbours(i, j, n))


def _are_neighbours(i: Ints, j: Ints, n: int) -> Bools:
    """(k,) whether edges i < j of a closed polygon have a common end."""
    return np.asarray((j - i == 1) | (j - i == n - 1))
