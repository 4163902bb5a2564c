"""Nets: what is flat between its corners, cut along a short tree through all of them."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra, minimum_spanning_tree

from ..arrays import Bools, Floats, Ints, places
from .cut_graph import Component

FLAT = 1e-4  # an angle defect up to this, in radians, is none
COPLANAR = 1e-6  # two faces are in one plane if the cosine between their normals is so near 1


def net(component: Component) -> Ints:
    """Half-edges of a short tree through all vertices that are not flat, and the boundary.

    After K. Mehlhorn, Inf. Process. Lett. 27(3), 1988: shortest paths between neighbouring
    vertices of these, as a minimum spanning tree has them.
    """
    tail, head, n = component.tail, component.head, len(component.V)
    on_boundary = component.uncut.on_boundary
    around = np.bincount(tail, component.angle, n)
    ends = np.flatnonzero(on_boundary | (abs(2 * np.pi - around) > FLAT))
    if len(ends) == 0:
        return ends
    half = np.concatenate([component.edges, np.flatnonzero(component.twin < 0)])
    half = half[~component.is_barred[half]]
    cost = seam_cost(component)[half]
    graph = csr_matrix((cost, (tail[half], head[half])), (n, n))
    distance, parent, nearest = dijkstra(
        graph, directed=False, indices=ends, min_only=True, return_predecessors=True
    )
    reached = nearest[tail[half]] >= 0  # unless forbidden edges are around it
    half, cost = half[reached], cost[reached]
    number = places(ends, n)[np.maximum(nearest, 0)]
    low, high = np.sort([number[tail[half]], number[head[half]]], axis=0)
    way = distance[tail[half]] + cost + distance[head[half]]
    # Of several ways between two of the vertices, only the shortest can be in the tree.
    order = np.lexsort((way, high, low))
    order = order[(low != high)[order]]
    order = order[np.diff(low[order] * n + high[order], prepend=-1) != 0]
    rank = places(np.argsort(way[order], kind="stable"), len(order)) + 1
    tree = minimum_spanning_tree(csr_matrix((rank, (low[order], high[order])), (len(ends),) * 2))
    bridges = half[order[np.isin(rank, tree.data)]]
    into = np.full(n, -1)
    for start, end in ((tail[half], head[half]), (head[half], tail[half])):
        into[end[parent[end] == start]] = half[parent[end] == start]
    on_path = np.zeros(n, dtype=bool)
    for v in np.concatenate([tail[bridges], head[bridges]]).tolist():
        while parent[v] >= 0 and not on_path[v]:
            on_path[v] = True
            v = int(parent[v])
    cut = np.concatenate([bridges, into[on_path]])
    return cut[component.twin[cut] >= 0]


def in_a_plane(component: Component) -> Bools:
    """(3m,) half-edges between two faces of one plane."""
    return _flatness(component) > 1 - COPLANAR


def seam_cost(component: Component) -> Floats:
    """(3m,) length of each half-edge; next to nothing along the boundary.

    A seam hides in a crease: in a plane it costs twice as much as along a right angle.
    """
    cost = np.where(component.twin < 0, 1e-9, 1) * component.length
    return cost * (1 + np.maximum(_flatness(component), 0))


def _flatness(component: Component) -> Floats:
    """(3m,) cosine of the angle between the normals on either side, on the boundary 0."""
    V, F = component.V, component.F
    normal = np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    inner = np.flatnonzero(component.twin >= 0)
    one, other = component.sides(inner)
    cosine = np.zeros(F.size)
    cosine[inner] = (normal[one] * normal[other]).sum(axis=1)
    return cosine
