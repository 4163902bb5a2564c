"""Shortest paths that cut a surface to a disk: a tree, a cotree, and what is left."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import dijkstra, minimum_spanning_tree

from ..arrays import Bools, Floats, Ints
from .cut_surface import CutSurface

__all__ = ["cut_to_disk", "far_apart"]

# Length of a boundary edge, by the mean edge: next to nothing, since it need not be cut.
FREE = 1e-9


def cut_to_disk(surface: CutSurface) -> None:
    """Cut a surface that is not closed of genus 0 along shortest paths, until it is a disk.

    A shortest-path tree from one vertex, of the longest boundary loop if there is one, and
    a spanning tree of the faces across the edges that are not in it, by preference those
    that close the longest loops. The edges in neither close the shortest loops that cut
    all handles (greedy homotopy generators); the paths of the tree from these and
    from each boundary loop to the root are the cut.

    References
    ----------
    J. Erickson, K. Whittlesey. Greedy optimal homotopy and homology generators. SODA 2005.
    """
    n, tail, head = len(surface.V), surface.tail, surface.head
    border = surface.twin < 0
    opened = surface.opened()
    length = np.where(border, FREE, surface.length)
    root = _root(surface)
    graph = csr_matrix(
        (
            np.append(length, length[border]),
            (np.append(tail, head[border]), np.append(head, tail[border])),
        ),
        (n, n),
    )
    distance, parent = dijkstra(graph, indices=root, return_predecessors=True)

    in_tree = (parent[head] == tail) | (parent[tail] == head)
    candidates = np.flatnonzero(~in_tree & (np.arange(len(tail)) < surface.twin))
    closed = distance[tail[candidates]] + distance[head[candidates]] + length[candidates]
    left_over = candidates[~_in_cotree(surface, candidates, closed)]

    loops = opened.loop[opened.on_boundary]
    # Corners are vertices here, because nothing is cut yet, but in an order of their own.
    vertex = np.empty(opened.n, np.int64)
    vertex[opened.tail] = tail
    entries = vertex[opened.on_boundary][np.unique(loops, return_index=True)[1]]
    surface.set_cut(left_over, cut=True)
    up = _half_edges_to_parents(surface, parent)
    on_path = np.zeros(n, dtype=bool)
    for start in [*tail[left_over], *head[left_over], *entries]:
        v = start
        while v != root and not on_path[v]:
            on_path[v] = True
            v = parent[v]
    path = up[on_path]
    surface.set_cut(path[(path >= 0) & ~border[path]], cut=True)
    _prune(surface, root)


def _root(surface: CutSurface) -> int:
    """Pick a vertex of the longest boundary loop, or the first of a closed surface."""
    border = np.flatnonzero(surface.twin < 0)
    if len(border) == 0:
        return 0
    opened = surface.opened()
    loop = opened.loop[opened.tail[border]]
    longest = np.bincount(loop, surface.length[border]).argmax()
    return int(surface.tail[border[np.argmax(loop == longest)]])


def _in_cotree(surface: CutSurface, candidates: Ints, closed: Floats) -> Bools:
    """Which edges a maximum spanning tree of the faces crosses, weighted by loops closed."""
    m = len(surface.F)
    one, other = candidates % m, surface.twin[candidates] % m
    low, high = np.minimum(one, other), np.maximum(one, other)
    # Of several edges between two faces, only the best can be in the tree.
    order = np.lexsort((-closed, high, low))
    first = np.ones(len(order), dtype=bool)
    first[1:] = (np.diff(low[order]) != 0) | (np.diff(high[order]) != 0)
    order = order[first]
    rank = np.empty(len(order))
    rank[np.argsort(-closed[order], kind="stable")] = np.arange(1, len(order) + 1)
    graph = coo_matrix((rank, (low[order], high[order])), shape=(m, m))
    tree = minimum_spanning_tree(graph).tocoo()
    chosen = np.zeros(len(candidates), dtype=bool)
    by_rank = np.empty(len(order) + 1, np.int64)
    by_rank[rank.astype(np.int64)] = order
    chosen[by_rank[tree.data.astype(np.int64)]] = True
    return chosen


def _half_edges_to_parents(surface: CutSurface, parent: Ints) -> Ints:
    """(n,) a half-edge between each vertex and its parent, -1 at the root."""
    up = np.full(len(parent), -1)
    is_up = np.flatnonzero(parent[surface.tail] == surface.head)
    up[surface.tail[is_up]] = is_up
    is_down = np.flatnonzero(parent[surface.head] == surface.tail)
    up[surface.head[is_down]] = is_down
    return up


def _prune(surface: CutSurface, root: int) -> None:
    """Join again the edges of the cut that end nowhere: those at the root."""
    at_border = np.zeros(len(surface.V), dtype=bool)
    at_border[surface.tail[surface.twin < 0]] = True
    while True:
        edges = surface.cut_edges
        ends = np.column_stack([surface.tail[edges], surface.head[edges]])
        degree = np.bincount(ends.ravel(), minlength=len(surface.V))
        loose = ((degree[ends] == 1) & ~at_border[ends]).any(axis=1)
        if not loose.any():
            return
        surface.set_cut(edges[loose], cut=False)


def far_apart(graph: csr_matrix) -> tuple[int, int]:
    """Two vertices far from each other, by shortest paths: each the farthest from the other."""
    one = int(dijkstra(graph, indices=0).argmax())
    other = int(dijkstra(graph, indices=one).argmax())
    return one, other
