"""Where a component is parted: limbs from the rest, or in two where it is narrow."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from ..arrays import Bools, Floats, Ints, marked, places
from ..surface.topology import components_of_pairs
from ..surface.triangles import face_areas
from .cut_graph import Component, OpenedComponent, split_components
from .cut_paths import way_to
from .nets import in_a_plane, seam_cost
from .sheets import part_sheets

# A component of fewer faces is not parted, and its cut grows once: of 80 boxes, tubes and
# icosahedra, one gained by a second time. Others are parted where each side has this share of the
# area.
LEAST_FACES = 200
LEAST_SHARE = 0.1
# A limb is shorter on the map than the average by this power of e, and has this share of the area.
LIMB = 1.5
LEAST_LIMB = 0.03


def pieces(opened: OpenedComponent) -> list[Component]:
    """Components of an opened surface, which keep its cut, without what fills holes."""
    component, F = opened.component, opened.F[: len(opened.component.rows)]
    polygon, forbidden = component.polygon[: len(F)], component.forbidden[: len(F)]
    sheets = part_sheets(opened.positions, F)  # where a cut ends at a hole, two fans are left
    parts = split_components(opened.positions, F, sheets, polygon, forbidden)
    return [replace(part, rows=component.rows[part.rows]) for part in parts]


def parted_by(component: Component, low: Bools) -> list[Component]:
    """Part a component between the faces that are `low` (m,) and the others."""
    left, right = component.sides(component.edges)
    return pieces(component.uncut.cut(component.edges[low[left] != low[right]]))


def limbs(component: Component, level: Floats) -> Bools:
    """(m,) the faces of large regions where a map has shrunk lengths, by its `level` (m,).

    What lies between such regions is large, too; none if there is nothing else.
    """
    area = face_areas(component.V, component.F)
    low = _mean_of_patches(component, level) < -LIMB
    for side in (True, False, True):
        count, region = _regions(component, low)
        small = np.bincount(region, area, count) < LEAST_LIMB * area.sum()
        small |= np.bincount(region, minlength=count) < LEAST_FACES
        low[(low == side) & small[region]] = not side
    return low & ~low.all()


def narrow_side(component: Component, ends: Ints | None = None) -> Bools:
    """(m,) the faces on one side of where a component is narrow between two ends, if any.

    Those are two far vertices, if none are given.

    Of the level lines of the difference of the distances from the ends, along the one that is
    shortest for the smaller of the areas on either side.
    """
    m, area = len(component.F), face_areas(component.V, component.F)
    distances = partial(dijkstra, component.graph)
    one = distances(indices=0).argmax() if ends is None else ends[0]
    from_end = distances(indices=one)
    way = from_end - distances(indices=from_end.argmax() if ends is None else ends[1])
    level = _mean_of_patches(component, way[component.F].mean(axis=1))
    order = np.argsort(level, kind="stable")
    first, last = np.sort(places(order, m)[[*component.sides(component.edges)]], axis=0)
    length = component.length[component.edges]
    # The edges between the faces up to each rank and those after it.
    line = np.cumsum(np.bincount(first, length, m) - np.bincount(last, length, m))[:-1]
    below = np.cumsum(area[order])[:-1]
    smaller = np.minimum(below, area.sum() - below)
    possible = (np.diff(level[order]) > 0) & (smaller > LEAST_SHARE * area.sum())
    if not possible.any():
        return np.zeros(m, dtype=bool)
    low = level <= level[order[np.where(possible, line / smaller, np.inf).argmin()]]
    for side in (True, False):  # what is not joined to the rest of its side goes to the other one
        count, region = _regions(component, low)
        largest = np.bincount(region[low == side], area[low == side], count).argmax()
        low[region != largest] = not side
    return low


def crease_between(opened: OpenedComponent, loop: Ints, pairs: Ints) -> Ints:
    """Half-edges of the crease of a net that parts most of some pairs of boundary edges.

    Of several, the shortest; none if none parts any. A crease is where two facets meet, which are
    flat. Edges (k, 2) are named by the places in the loop that they leave.
    """
    component, half = opened.component, opened.component.edges
    half = half[~opened.is_cut[half]]
    one, other = component.sides(half)
    joined = (in_a_plane(component) | component.is_barred)[half]
    _, facet = components_of_pairs(one[joined], other[joined], len(opened.F))
    low, high = np.sort([facet[one], facet[other]], axis=0)
    half, low, high = (each[low < high] for each in (half, low, high))
    if len(half) == 0:
        return half
    _, crease = np.unique(low.astype(np.int64) * len(opened.F) + high, return_inverse=True)
    place = places(loop, opened.n)[[opened.tail[half], opened.head[half]]]
    # In a net a crease goes from one place of the boundary to another.
    first, last = np.full((2, crease.max() + 1), [[len(loop)], [-1]])
    np.minimum.at(first, crease, np.where(place < 0, len(loop), place).min(axis=0))
    np.maximum.at(last, crease, place.max(axis=0))
    beyond = (first <= pairs[..., None]) & (pairs[..., None] < last)
    parted = (beyond[:, 0] != beyond[:, 1]).sum(axis=0)
    length = np.bincount(crease, component.length[half])
    best = np.lexsort((length, -parted))[0]
    return half[(crease == best) & (parted[best] > 0)]


def shortest_between(opened: OpenedComponent, loop: Ints, pairs: Ints) -> Ints:
    """Half-edges of the cheapest path across a disk that parts one of some pairs of boundary edges.

    Edges (k, 2) are named by the places in the loop that they leave, the smaller first.
    """
    half = opened.cuttable
    tail, head = opened.tail[half], opened.head[half]
    cost = seam_cost(opened.component)[half]
    graph = csr_matrix((cost, (tail, head)), (opened.n, opened.n))
    ways = []
    for i, j in pairs.tolist():
        within = marked(len(loop), np.arange(i + 1, j + 1))
        distance, parent, _ = dijkstra(
            graph, indices=loop[within], min_only=True, return_predecessors=True
        )
        end = int(loop[~within][distance[loop[~within]].argmin()])
        ways.append((float(distance[end]), end, parent))
    _, end, parent = min(ways, key=lambda way: way[0])
    into = np.full(opened.n, -1)
    into[head[parent[head] == tail]] = half[parent[head] == tail]
    return into[way_to(end, parent)[1:]]


def _mean_of_patches(component: Component, values: Floats) -> Floats:
    """(m,) means over the faces that are not to be parted, for each face."""
    patch = component.patch
    return (np.bincount(patch, values) / np.bincount(patch))[patch]


def _regions(component: Component, low: Bools) -> tuple[int, NDArray[np.int32]]:
    """Count the regions of faces that are all `low` (m,), or none of them; (m,) their numbers."""
    left, right = component.sides(component.edges)
    within = low[left] == low[right]
    return components_of_pairs(left[within], right[within], len(low))
