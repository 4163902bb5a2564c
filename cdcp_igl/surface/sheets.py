"""Sheets that touch along edges of more than two faces: which faces continue each other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Indices, Ints, marked
from .topology import Topology


def fans_of_sheets(V: Floats, F: Ints) -> tuple[int, NDArray[np.int32]]:
    """Group the corners (3m,), in the order of ``F.T``, so that each group is a manifold's vertex.

    Around an edge of more than two faces, neighbours of opposite orientation are paired, those
    first that continue each other best, so that sheets do not cross, what is closed stays so, and
    nothing becomes one-sided; where that leaves a choice, solids are parted. Other faces there
    stand alone. Then each vertex gets a copy for each fan of faces across these pairs.
    """
    surface = Topology(F, len(V))
    if not surface.singular.any():
        return surface.fans
    one, other = surface.twins
    pairs, edge, end = _pairs(V, surface)
    while True:
        joined = np.array(pairs, dtype=one.dtype).reshape(-1, 2)
        n_fans, fan = surface.fans_across(
            np.append(one, joined[:, 0]), np.append(other, joined[:, 1])
        )
        if not _parted_more(pairs, surface, edge, fan[end]):
            return n_fans, fan


def _pairs(V: Floats, surface: Topology) -> tuple[list[list[int]], Ints, Indices]:
    """Pairs of half-edges; all at these edges (k,), and their corners at both ends (2, k)."""
    edges, m = surface.edges, len(surface.F)
    valence = edges.valence
    half = edges.sides[np.repeat(surface.singular, valence)].astype(np.int64)
    group = np.repeat(np.arange(surface.singular.sum()), valence[surface.singular])
    low, high = (ends[surface.singular][group] for ends in (edges.low, edges.high))
    column, face = np.divmod(half, m)
    forwards = surface.F[face, column] == low
    flipped = marked(m, *([] if surface.misoriented is None else [surface.misoriented]))
    # Directions across the edge, as seen along it: all from the first face.
    along = V[high] - V[low]
    across = V[surface.F[face, (column + 2) % 3]] - V[low]
    first = across[np.searchsorted(group, group)]
    unit = np.linalg.norm(along, axis=1)
    up = np.cross(along, first)
    right = np.cross(up, along) / np.where(unit > 0, unit, 1)[:, None]
    angle = np.arctan2((across * up).sum(axis=1), (across * right).sum(axis=1))
    order = np.lexsort((angle, group))
    runs = np.split(order, np.flatnonzero(np.diff(group[order])) + 1)
    out = forwards ^ flipped[face]
    pairs = [half[pair].tolist() for run in runs for pair in _paired(run, angle, out)]
    end = np.where(forwards, [half, (half + m) % (3 * m)], [(half + m) % (3 * m), half])
    return pairs, half, end


def _paired(ring: Ints, angle: Floats, out: Ints) -> list[list[int]]:
    """Pairs of neighbours in a ring of faces, in the order of their angles around an edge."""
    left, pairs = ring.tolist(), list[list[int]]()
    while True:
        ways = [
            # From a face that looks forwards the way to the next is outside of a solid.
            (round(abs(np.pi - (angle[b] - angle[a]) % (2 * np.pi)), 6), bool(out[a]), a, b)
            for a, b in zip(left, left[1:] + left[:1], strict=True)
            if out[a] != out[b]
        ]
        if not ways:
            return pairs
        pairs.append(list(min(ways)[2:]))
        left = [a for a in left if a not in pairs[-1]]


def _parted_more(pairs: list[list[int]], surface: Topology, half: Ints, fans: Indices) -> bool:
    """Change pairs, in place, of which two have the same vertices, or one those of a third face.

    Two pairs exchange partners, which parts the fans at both ends; one is given up. Whether
    anything was to be done: of pairs with a vertex in common one is changed at a time.
    """
    _, name, count = np.unique(fans, axis=1, return_inverse=True, return_counts=True)
    crowded = count[name.ravel()] > 2
    if not crowded.any():
        return False
    group_of = dict(zip(half[crowded].tolist(), name.ravel()[crowded].tolist(), strict=True))
    ends_of = dict(zip(half[crowded].tolist(), fans[:, crowded].T.tolist(), strict=True))
    groups: dict[int, list[int]] = {}
    for k, (a, _) in enumerate(pairs):
        if a in group_of:
            groups.setdefault(group_of[a], []).append(k)
    touched: set[int] = set()
    given_up = []
    tail, head = surface.F.T.ravel(), np.roll(surface.F, -1, axis=1).T.ravel()
    for members in groups.values():
        ends = set(ends_of[pairs[members[0]][0]])
        if touched & ends:
            continue
        touched |= ends
        if len(members) == 1:
            given_up.append(members[0])
            continue
        (a, b), (c, d) = pairs[members[0]], pairs[members[1]]
        if (tail[a], head[a]) == (tail[c], head[c]):
            c, d = d, c
        pairs[members[0]], pairs[members[1]] = [a, c], [b, d]
    for k in sorted(given_up, reverse=True):
        del pairs[k]
    return True
