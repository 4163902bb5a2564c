"""A pattern to cut: the outlines of a map in the unit of the surface, and which edges meet."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from ..arrays import Bools, Floats, Ints, distinct_rows
from ..io.patterns import Lines
from ..surface.topology import Topology

NOTCH = 1 / 60  # length, in the square root of the area
OF_A_SEAM = 1 / 4  # but not longer than this share of it


@dataclass(frozen=True, eq=False)
class Pattern:
    """What was drawn, and how true it is. Lengths and the area are in the unit of the surface.

    Attributes
    ----------
    lines : Lines
        ``outlines``, a tuple of closed (k, 2) polygons, the surface on their left, seen from
        outside; ``notches`` (k, 2, 2) with their ``numbers`` (k,), one for both sides of a seam;
        ``folds`` (k, 2, 2), the edges within.
    seams : int
        Pairs of edges, or of rows of edges, that meet.
    length, length_on_surface : float
        Of all outlines together.
    largest_length_error : float
        Of an edge of the outlines against that on the surface, as a share of it.
    area : float
        Within the outlines.
    """

    lines: Lines
    seams: int
    length: float
    length_on_surface: float
    largest_length_error: float
    area: float

    def report(self) -> dict[str, Any]:
        """Return everything but the lines, as JSON types."""
        numbers = {each.name: getattr(self, each.name) for each in fields(self)[1:]}
        return {"outlines": len(self.lines.outlines), **numbers}

    def __str__(self) -> str:
        return (
            f"{len(self.lines.outlines)} outlines, {self.length:.6g} long, on the surface "
            f"{self.length_on_surface:.6g} (an edge differs by {self.largest_length_error:.2g} of "
            f"its length at most), {self.seams} seams"
        )


def pattern_of(V: Floats, F: Ints, uv: Floats, *, folds: bool) -> Pattern:
    """Draw charts with vertices V (n, 3) and images uv (n, 2); edges at the same places meet."""
    n_fans, fan = Topology(F, len(V)).fans  # a vertex where holes touch is several
    corners = fan.reshape(3, -1).T.astype(np.int64)
    vertex = np.empty(n_fans, np.int64)
    vertex[corners] = F
    topology = Topology(corners, n_fans)
    loops = topology.loops
    tail = vertex[np.concatenate(loops)]
    head = vertex[np.concatenate([np.roll(loop, -1) for loop in loops])]
    (start, end), on_surface = (uv[tail], uv[head]), np.linalg.norm(V[head] - V[tail], axis=1)
    length = np.linalg.norm(end - start, axis=1)
    ends = np.cumsum([len(loop) for loop in loops])
    after = np.arange(1, len(tail) + 1)
    after[ends - 1] = np.append(0, ends[:-1])
    seams = _seams(_partners(V, tail, head), after)
    area = float(np.sum(start[:, 0] * end[:, 1] - start[:, 1] * end[:, 0]) / 2)
    edges, numbers, sizes = [], [], []
    for number, (run, across) in enumerate(seams, 1):
        so_far = np.cumsum(length[run])
        middle = int(np.searchsorted(so_far, so_far[-1] / 2))
        edges += [run[middle], across[middle]]
        numbers += [number, number]
        sizes += 2 * [min(NOTCH * np.sqrt(area), OF_A_SEAM * so_far[-1])]
    middle = (start[edges] + end[edges]) / 2
    inwards = (end - start)[edges] / length[edges, None] @ np.array([[0, 1], [-1, 0]])
    notches = np.stack([middle, middle + np.array(sizes)[:, None] * inwards], axis=1)
    within = topology.edges.ends(topology.edges.valence > 1) if folds else np.empty((0, 2), int)
    outlines = tuple(uv[vertex[loop]] for loop in loops)
    lines = Lines(outlines, notches.reshape(-1, 2, 2), np.array(numbers, int), uv[vertex[within]])
    error = float((np.abs(length - on_surface) / on_surface).max())
    return Pattern(lines, len(seams), float(length.sum()), float(on_surface.sum()), error, area)


def _partners(V: Floats, tail: Ints, head: Ints) -> Ints:
    """(k,) the edge that goes the other way between the same places, -1 if not just one does."""
    _, place = distinct_rows(np.concatenate([V[tail], V[head]]))
    ends = place.reshape(2, -1)
    _, edge = distinct_rows(np.sort(ends, axis=0).T)
    order = np.argsort(edge, kind="stable")
    first = np.searchsorted(edge[order], np.arange(edge.max() + 1))
    pairs = first[np.bincount(edge) == 2]
    one, other = order[pairs], order[pairs + 1]
    opposite = ends[0, one] == ends[1, other]
    one, other = one[opposite], other[opposite]
    partner = np.full(len(tail), -1)
    partner[one], partner[other] = other, one
    return partner


def _seams(partner: Ints, after: Ints) -> list[tuple[Ints, Ints]]:
    """Rows of edges that meet others, as long as both go on; and these others, edge by edge.

    A row ends at the tip of a dart, where an edge meets the next.
    """
    goes_on: Bools = (partner >= 0) & (partner[after] >= 0) & (partner != after)
    goes_on &= after[partner[after]] == partner
    before = np.argsort(after)
    seen, seams = np.zeros(len(partner), dtype=bool), []
    for edge in np.flatnonzero(partner >= 0).tolist():
        if seen[edge]:
            continue
        first = edge
        while goes_on[before[first]] and before[first] != edge:
            first = int(before[first])
        run = [first]
        while goes_on[run[-1]] and after[run[-1]] != first:
            run.append(int(after[run[-1]]))
        seen[run] = seen[partner[run]] = True
        seams.append((np.array(run), partner[run]))
    return seams
