"""The arcs of a cut, each laid anew where it is shorter and straighter."""

from __future__ import annotations

import numpy as np

from ..arrays import Bools, Ints
from .cut_paths import STRETCH, straight_path
from .cut_surface import CutSurface, Opened
from .cut_system import far_apart

__all__ = ["branch_to", "slit", "straighten"]

# Times that all arcs are laid anew.
ROUNDS = 3


def slit(surface: CutSurface) -> None:
    """Cut a sphere along a straight path between two far vertices."""
    opened = surface.opened()
    one, other = far_apart(opened.graph(surface.length))
    path = straight_path(opened, _only(opened, one), _only(opened, other))
    if len(path) == 1:  # which does not open the sphere: go on along the shortest edge
        ends = [surface.tail[path[0]], surface.head[path[0]]]
        on = opened.cuttable[np.isin(surface.tail[opened.cuttable], ends)]
        on = np.setdiff1d(on, [path[0], surface.twin[path[0]]])
        path = np.append(path, on[surface.length[on].argmin()])
    surface.set_cut(path, cut=True)


def branch_to(surface: CutSurface, vertex: int) -> bool:
    """Cut on from the cut or the boundary to a vertex, unless it is there already."""
    opened = surface.opened()
    copies = np.unique(opened.tail[surface.tail == vertex])
    if opened.on_boundary[copies].any():
        return False
    path = straight_path(opened, _only(opened, int(copies[0])), opened.on_boundary)
    surface.set_cut(path, cut=True)
    return len(path) > 0


def straighten(surface: CutSurface) -> None:
    """Lay each arc of the cut anew, as long as the cut becomes shorter or straighter.

    Without one of its arcs the surface is an annulus, and any path between the two loops of
    it makes a disk again: the ends of an arc slide along the others.
    """
    cost = _cost(surface)
    for _ in range(ROUNDS):
        before = cost
        for middle in [arc[len(arc) // 2] for arc in _arcs(surface)]:
            # The arcs laid anew before may have changed this one.
            arc = next((arc for arc in _arcs(surface) if middle in arc), None)
            if arc is None or _name(surface, arc) in surface.settled:
                continue
            old = np.array(arc)
            surface.set_cut(old, cut=False)
            new = _laid_anew(surface, old)
            surface.set_cut(new, cut=True)
            changed = _cost(surface)
            if len(new) and changed < cost:
                cost = changed
            else:
                surface.set_cut(new, cut=False)
                surface.set_cut(old, cut=True)
                surface.settled.add(_name(surface, arc))
        if not cost < before:
            return


def _name(surface: CutSurface, arc: list[int]) -> tuple[int, ...]:
    """Whichever way one goes along an arc, its name is the same."""
    return tuple(sorted(min(half, int(surface.twin[half])) for half in arc))


def _cost(surface: CutSurface) -> float:
    return surface.opened().bend + STRETCH * float(surface.length[surface.cut_edges].sum())


def _laid_anew(surface: CutSurface, arc: Ints) -> Ints:
    """Half-edges of the best path in place of an arc that has just been joined."""
    opened = surface.opened()
    ends = [_label(opened, surface.tail[arc[0]]), _label(opened, surface.head[arc[-1]])]
    loose = [_only(opened, end) for end in ends if not opened.on_boundary[end]]
    if loose:
        start, end = loose[0], loose[1] if len(loose) == 2 else opened.on_boundary
    elif opened.loop.max() == 1:
        start, end = opened.loop == 0, opened.loop == 1
    else:
        return arc[:0]
    longest = surface.length[arc].sum() * (1 + 1e-9)
    path = straight_path(opened, start, end, longest)
    # One edge with two loose ends does not open a sphere.
    return path if len(path) > 1 or len(loose) < 2 else arc[:0]


def _label(opened: Opened, vertex: int) -> int:
    """One of the vertices that a vertex of the surface has become."""
    return int(opened.tail[np.argmax(opened.surface.tail == vertex)])


def _only(opened: Opened, vertex: int) -> Bools:
    """(n,) true for one vertex."""
    chosen = np.zeros(opened.n, dtype=bool)
    chosen[vertex] = True
    return chosen


def _arcs(surface: CutSurface) -> list[list[int]]:
    """Half-edges of the cut, each arc from one end or branching to the next."""
    edges = surface.cut_edges
    halves = np.concatenate([edges, surface.twin[edges]])
    tail, head = surface.tail[halves].tolist(), surface.head[halves].tolist()
    leaving: dict[int, list[int]] = {}
    for h, v in zip(halves.tolist(), tail, strict=True):
        leaving.setdefault(v, []).append(h)
    to = dict(zip(halves.tolist(), head, strict=True))
    border = set(surface.tail[surface.twin < 0].tolist()) & set(leaving)
    nodes = {v for v, out in leaving.items() if len(out) != 2 or v in border}
    twin = surface.twin
    arcs, seen = [], set()
    for v in sorted(nodes) + sorted(set(leaving) - nodes):
        for h in leaving[v]:
            if h in seen:
                continue
            arc = [h]
            while (at := to[arc[-1]]) not in nodes and at != v:
                back = int(twin[arc[-1]])
                arc.append(next(g for g in leaving[at] if g != back))
            seen.update(arc)
            seen.update(int(twin[g]) for g in arc)
            arcs.append(arc)
    return arcs
