"""Sheets that touch along edges of more than two faces: which faces continue each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import minimum_spanning_tree

from ..arrays import Bools, Floats, Indices, Ints, distinct_rows, marked, shifted
from .topology import Topology, components_of_pairs


def fans_of_sheets(V: Floats, F: Ints) -> tuple[int, NDArray[np.int32]]:
    """Group the corners (3m,), in the order of ``F.T``, so that each group is a manifold's vertex.

    Around an edge of more than two faces, neighbours of opposite orientation are paired, those
    first that continue each other best, so that sheets do not cross, what is closed stays so, and
    nothing becomes one-sided; where that leaves a choice, solids are parted. Other faces there
    stand alone. Then each vertex gets a copy for each fan of faces across these pairs.

    Windings that do not fit together are put right before: first of faces that share an edge with
    no third, then from sheet to sheet.
    """
    surface = Topology(F, len(V))
    if not surface.singular.any():
        return surface.fans
    rings = _rings(V, surface)
    out = rings.forwards ^ _flipped(surface, rings)[rings.half % len(F)]
    pairs = [pair for ring in rings.places for pair in _paired(ring, rings.angle, out)]
    one, other = surface.twins
    before = len(pairs)
    while True:
        joined = rings.half[np.array(pairs, dtype=np.int64).reshape(-1, 2)].astype(one.dtype)
        n_fans, fan = surface.fans_across(
            np.append(one, joined[:, 0]), np.append(other, joined[:, 1])
        )
        # Each change gives up pairs or parts fans, except on one-sided sheets, and joins none. What
        # lowers neither number is followed by one that gives up pairs.
        left = len(pairs) - n_fans
        if not _parted_more(pairs, out, fan[rings.ends], may_exchange=left < before):
            return n_fans, fan
        before = left


@dataclass(frozen=True, eq=False)
class _Rings:
    """The half-edges at edges of three faces or more."""

    half: Ints  # (k,) those of an edge in succession
    edge: Ints  # (k,) number of its edge, among these
    forwards: Bools  # (k,) which of them lead to the end of larger index
    ends: Ints  # (2, k) corners of their faces at both ends of the edge
    angle: Floats  # (k,) directions of their faces, as seen along the edge, from the first face
    places: list[Ints]  # for each edge its half-edges, in the order of these angles


def _rings(V: Floats, surface: Topology) -> _Rings:
    edges, m = surface.edges, len(surface.F)
    valence = edges.valence
    half = edges.sides[np.repeat(surface.singular, valence)].astype(np.int64)
    edge = np.repeat(np.arange(surface.singular.sum()), valence[surface.singular])
    low, high = (ends[surface.singular][edge] for ends in (edges.low, edges.high))
    column, face = np.divmod(half, m)
    forwards = surface.F[face, column] == low
    after = (half + m) % (3 * m)
    along = V[high] - V[low]
    across = V[surface.F[face, (column + 2) % 3]] - V[low]
    first = across[np.searchsorted(edge, edge)]
    unit = np.linalg.norm(along, axis=1)
    up = np.cross(along, first)
    right = np.cross(up, along) / np.where(unit > 0, unit, 1)[:, None]
    angle = np.arctan2((across * up).sum(axis=1), (across * right).sum(axis=1))
    order = np.lexsort((angle, edge))
    places = np.split(order, np.flatnonzero(np.diff(edge[order])) + 1)
    return _Rings(
        half, edge, forwards, np.where(forwards, [half, after], [after, half]), angle, places
    )


def _bend(angle: Floats, one: Ints, other: Ints) -> Floats:
    """Angles between faces and the straight continuation of others."""
    return np.round(abs(np.pi - (angle[other] - angle[one]) % (2 * np.pi)), 6)


def _flipped(surface: Topology, rings: _Rings) -> Bools:
    """(m,) faces whose winding is to be reversed.

    Within a sheet, which ends at the edges of more than two faces, the majority counts. Sheets are
    turned over as well where those of a closed body leave an edge open, and where the windings
    within open ones say nothing: neighbours at an edge to opposite orientation, those that continue
    each other best first.
    """
    m, face = len(surface.F), rings.half % len(surface.F)
    flipped, one_sided = surface.flipped_across(*surface.twins)
    n, sheet = surface.components
    one, other = np.concatenate([np.stack([ring, shifted(ring)]) for ring in rings.places], axis=1)
    _, body = components_of_pairs(sheet[face[one]], sheet[face[other]], n)
    body = body[sheet]
    edges = surface.edges
    is_open = marked(n, body[edges.sides[edges.start[edges.valence % 2 > 0]] % m])
    excess = np.bincount(rings.edge, np.where(rings.forwards ^ flipped[face], 1, -1))
    torn = marked(n, body[face[excess[rings.edge] != 0]])
    doubtful = np.where(is_open, marked(n, body[flipped]), torn)[body] & ~one_sided
    asked = (doubtful[face[one]] & doubtful[face[other]]).nonzero()[0]
    asked = asked[np.argsort(_bend(rings.angle, one[asked], other[asked]), kind="stable")]
    sheets = np.sort(sheet[face[np.stack([one[asked], other[asked]])]], axis=0)
    first, _ = distinct_rows(sheets.T)
    first = first[sheets[0, first] < sheets[1, first]]
    graph = csr_matrix((first + 1, sheets[:, first]), (n, n))
    tree = asked[minimum_spanning_tree(graph).data.astype(np.int64) - 1]
    before, after = surface.twins
    return surface.flipped_across(
        np.append(before, rings.half[one[tree]]), np.append(after, rings.half[other[tree]])
    )[0]


def _paired(ring: Ints, angle: Floats, out: Bools) -> list[list[int]]:
    """Pairs of neighbours in a ring of faces, in the order of their angles around an edge."""
    left, pairs = ring.tolist(), list[list[int]]()
    while True:  # a pair fewer is left each time
        ways = [
            # From a face that looks forwards the way to the next is outside of a solid.
            (_bend(angle, a, b), bool(out[a]), a, b)
            for a, b in zip(left, left[1:] + left[:1], strict=True)
            if out[a] != out[b]
        ]
        if not ways:
            return pairs
        pairs.append(list(min(ways)[2:]))
        left = [a for a in left if a not in pairs[-1]]


def _parted_more(pairs: list[list[int]], out: Bools, fans: Indices, *, may_exchange: bool) -> bool:
    """Change pairs, in place, of which two have the same vertices, or one those of a third face.

    Two pairs exchange partners, which parts the fans at both ends; one is given up. Whether
    anything was to be done: of pairs with a vertex in common one is changed at a time.
    """
    _, name, count = np.unique(fans, axis=1, return_inverse=True, return_counts=True)
    name = name.ravel()
    crowded = count[name] > 2
    if not crowded.any():
        return False
    groups: dict[int, list[int]] = {}
    for k, (a, _) in enumerate(pairs):
        if crowded[a]:
            groups.setdefault(int(name[a]), []).append(k)
    touched: set[int] = set()
    given_up = []
    for members in groups.values():
        ends = set(fans[:, pairs[members[0]][0]].tolist())
        if touched & ends:
            continue
        touched |= ends
        if len(members) == 1 or not may_exchange:
            given_up.append(members[0])
            continue
        (a, b), (c, d) = pairs[members[0]], pairs[members[1]]
        if out[a] == out[c]:
            c, d = d, c
        pairs[members[0]], pairs[members[1]] = [a, c], [b, d]
    for k in sorted(given_up, reverse=True):
        del pairs[k]
    return True
