"""Shortest paths that cut a surface to a disk: a tree, a cotree, and what is left."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import dijkstra, minimum_spanning_tree

from ..arrays import Bools, Floats, Ints
from .cut_surface import CutSurface

__all__ = ["cut_to_disk", "far_apart"]


def cut_to_disk(surface: CutSurface) -> None:
    """Cut a surface that is not closed of genus 0 along shortest paths, until it is a disk.

    A shortest-path tree along the edges of polygons, each boundary loop one node of it, from
    a vertex, or from the longest loop if there is one, and a spanning tree of the faces across
    the edges that are not in it, by preference those that close the longest loops. The edges
    in neither close the shortest loops that cut all handles (greedy homotopy generators); the
    paths of the tree from these and from each boundary loop to the root are the cut.

    References
    ----------
    J. Erickson, K. Whittlesey. Greedy optimal homotopy and homology generators. SODA 2005.
    """
    n, length = len(surface.V), surface.length
    border = surface.twin < 0
    node = _nodes(surface)
    root = int(node[_root(surface)])
    tail, head = node[surface.tail], node[surface.head]
    along = np.flatnonzero(~surface.is_diagonal & ~border & (tail != head))
    # Of several edges between two nodes, only the shortest can be in the tree.
    along = along[np.lexsort((length[along], head[along], tail[along]))]
    pair = tail[along] * n + head[along]
    along = along[np.diff(pair, prepend=-1) != 0]
    graph = csr_matrix((length[along], (tail[along], head[along])), (n, n))
    distance, parent = dijkstra(graph, indices=root, return_predecessors=True)
    up = np.full(n, -1)
    is_up = along[parent[tail[along]] == head[along]]
    up[tail[is_up]] = is_up

    in_tree = border.copy()
    in_tree[is_up] = in_tree[surface.twin[is_up]] = True
    candidates = np.flatnonzero(~in_tree & (np.arange(len(tail)) < surface.twin))
    closed = distance[tail[candidates]] + distance[head[candidates]] + length[candidates]
    closed[surface.is_diagonal[candidates]] = np.inf  # polygons are faces of the cotree
    left_over = candidates[~_in_cotree(surface, candidates, closed)]

    on_path = np.zeros(n, dtype=bool)
    for start in [*tail[left_over], *head[left_over], *np.unique(tail[border])]:
        v = start
        while v != root and not on_path[v]:
            on_path[v] = True
            v = parent[v]
    surface.set_cut(np.append(left_over, up[on_path]), cut=True)
    _prune(surface)


def _nodes(surface: CutSurface) -> Ints:
    """(n,) for each vertex a vertex of its boundary loop, all of which is one node; or itself."""
    opened = surface.opened()
    node = np.arange(len(surface.V))
    loop = np.full(len(surface.V), -1)
    loop[surface.tail] = opened.loop[opened.tail]
    bound = np.flatnonzero(loop >= 0)
    first = bound[np.unique(loop[bound], return_index=True)[1]]
    node[bound] = first[loop[bound]]
    return node


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


def _prune(surface: CutSurface) -> None:
    """Join again the edges of the cut that end nowhere, as near the root."""
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
