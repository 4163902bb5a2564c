"""A component mapped: its holes filled, opened, the cut grown, and parted if that is not enough."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from inspect import signature
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra

from ..arrays import Bools, Floats, Ints, as_complex, coordinates, places
from ..errors import MapError
from ..maps.disk import disk_map
from ..maps.free import FreeMap, free_map
from ..options import Options, is_real, is_whole
from ..phases import Progress
from ..rescue.boundary import by_inscribed_angles
from ..result.disk_map import DiskMap
from ..steps.mobius import conformal_barycenter
from ..surface.filling import fill_hole
from ..surface.topology import by_reach, components_of_pairs
from ..surface.triangles import face_areas, vertex_areas
from ..verdict.certificate import certify
from ..verdict.distortion import conformal_factor
from .cut_graph import Component, OpenedComponent, split_components
from .cut_paths import branch_to, open_to_disk, straighten

# A round of growth is kept if it lowers the scale variation, or the angle error, by more than this
# share.
GAIN = 0.03
# Where a cut that has grown leaves the scale variation at more than this many times what is asked
# for, or has halved it, it does not grow on, and the component is parted. No later round has made
# up for more than 1.33, or lowered what had been halved.
HOPELESS = 1.4
# A component that is cut to be a disk, and whose scale varies more than this many times what is
# asked for, is parted before its cut grows. No growth has made up for more than 1.99.
LOST = 2.0
# The map has shrunk a part of the surface if lengths there are shorter than on the average by this
# power of e.
SHRUNK = 1.0
# A boundary is tiny if a round hole as long has at most this share of the surface's area.
TINY = 0.01
# What shrank hangs on the boundary if cuts to it are no longer than this many times the square root
# of the number of faces, in mean edges: of shorter ones, none has evened out the scale.
SHORT = 0.25
# Branches in one round of growth.
MOST_BRANCHES = 8
# Angles, in radians, that differ by rounding only.
SAME_ANGLE = 1e-9
# A component of fewer faces is not parted, and its cut grows once: of 80 boxes, tubes and
# icosahedra, one gained by a second time. Others are parted where each side has this share of the
# area.
LEAST_FACES = 200
LEAST_SHARE = 0.1
# A limb is shorter on the map than the average by this power of e, and has this share of the area.
LIMB = 1.5
LEAST_LIMB = 0.03
# The scale varies by less than this, as it is a logarithm of doubles.
MOST_VARIATION = 709
# Where an edge has collapsed the conformal factor is minus infinity: counted as this.
LEAST_FACTOR = -50.0


Outline = Literal["disk", "free"]


@dataclass(frozen=True)
class Limits:
    """What kind of charts is asked for, and where there are to be more of them."""

    outline: Outline
    fill: bool
    scale_variation: float
    max_charts: float

    def __post_init__(self) -> None:
        if self.outline not in ("disk", "free"):
            raise ValueError(f'outline must be "disk" or "free", not {self.outline!r}')
        if not isinstance(self.fill, bool | np.bool_):
            raise ValueError(f"fill must be True or False, not {self.fill!r}")
        most, asked = self.max_charts, self.scale_variation
        if not (most == np.inf or (is_whole(most) and most >= 1)):
            raise ValueError(f"max_charts must be 1, 2, ... or None, not {most!r}")
        if not (is_real(asked) and (0 <= asked < MOST_VARIATION or asked == np.inf)):
            raise ValueError(
                f"scale_variation must be from 0 to {MOST_VARIATION}, or infinite, not {asked!r}"
            )

    @property
    def parts_early(self) -> bool:
        """Whether not to wait for growth: free outlines gain more by it than disks."""
        return self.outline == "disk" and self.max_charts > 1


@dataclass(frozen=True, eq=False)
class Chart:
    """A component opened to a disk, and its map."""

    opened: OpenedComponent
    map: DiskMap | FreeMap
    failure: str  # why the map is not valid, or nothing
    factor: Floats  # (n,) conformal factor, on a disk with the conformal barycentre at 0
    # Its mean and standard deviation over the area, without what fills holes.
    average: float
    scale_variation: float
    # (k,) the deviation before the cut had grown, if it has, or where that would be in vain.
    level: Floats | None = None
    is_lost: bool = False  # its cut grows only if it cannot be parted

    @property
    def F(self) -> Ints:
        """(k, 3) the faces that do not fill holes, rows of ``map.uv``."""
        return self.opened.F[: len(self.opened.component.rows)]

    @property
    def deviation(self) -> Floats:
        """(k,) the factor of the faces less its mean."""
        return np.asarray(self.factor[self.F].mean(axis=1) - self.average, np.float64)

    @property
    def unevenness(self) -> tuple[bool, bool, float]:
        """What more charts are to lower: no valid map is worse than one that is not conformal."""
        return bool(self.failure), not self.map.conformal, self.scale_variation

    def gains_on(self, other: Chart) -> bool:
        """Whether the scale is more even; or the angles are better where they were not good."""
        if other.failure:
            return not self.failure
        if other.map.conformal:
            return self.map.conformal and self.scale_variation < (1 - GAIN) * other.scale_variation
        return self.map.distortion.mean < (1 - GAIN) * other.map.distortion.mean


def charts_of(
    component: Component,
    options: Options,
    limits: Limits,
    known: dict[bytes, list[Chart]],
    progress: Progress | None,
) -> list[Chart]:
    """Map a component onto charts, unless it is like one that is `known`, by its faces.

    Then it has the disk of that. MapError if there is a chart without a valid map.
    """
    alike = known.setdefault(component.F.tobytes(), [])
    if options.align is None:
        for chart in alike:
            if made := _made_like(chart, component, options):
                return [made]
    charts = _charts(component, options, limits, progress)
    if len(charts) == 1:
        alike += charts
    return charts


def _made_like(chart: Chart, component: Component, options: Options) -> Chart | None:
    """Give a component with the same faces the map of a known one, if its angles are the same.

    A face alone may have other angles: its map is a similarity.
    """
    disk, variation = chart.map, chart.scale_variation
    if not isinstance(disk, DiskMap):
        return None
    if chart.opened.component.n_filled:
        component = fill_holes(component)
    opened = chart.opened.moved(component)
    if len(component.F) == 1 and options.mobius != "area" and not options.refine:
        mesh = disk.mesh.moved(component.V)
        uv = coordinates(by_inscribed_angles(mesh))
        # The barycentre is 0 in the equilateral triangle, where the scale is 1 / sin^2.
        variation = float(2 * np.log(np.sin(mesh.angles)).std())
    elif _same_angles(component, chart.opened.component):
        mesh, uv = disk.mesh.moved(opened.positions), disk.uv
    else:
        return None
    certificate = certify(mesh, uv)
    if not certificate.valid:
        return None
    disk = replace(disk, mesh=mesh, uv=uv, certificate=certificate, timings={})
    return replace(chart, opened=opened, map=disk, scale_variation=variation)


def _same_angles(one: Component, other: Component) -> bool:
    polygons, others = (each.polygon - each.polygon[0] for each in (one, other))
    same = np.array_equal(one.F, other.F) and np.array_equal(polygons, others)
    return same and bool(abs(one.angle - other.angle).max() < SAME_ANGLE)


def _charts(
    component: Component, options: Options, limits: Limits, progress: Progress | None
) -> list[Chart]:
    """Open a component to a disk and map it; part it where the scale is too uneven even so."""
    # What is asked for beyond that is done at the end, by the charts as they are then.
    later = bool(options.refine or options.kept)
    in_between = replace(options, refine=None, keep="angles") if later else options
    how = in_between, limits, progress
    whole = _mapped(component, *how)
    waiting, charts = [whole], list[Chart]()
    while waiting:
        waiting.sort(key=lambda chart: chart.unevenness)
        worst = waiting.pop()
        parts = [worst.opened.component]
        most = limits.max_charts - len(waiting) - len(charts)
        is_uneven = worst.unevenness > (False, False, limits.scale_variation)
        if most > 1 and is_uneven:
            parts = parted(worst, most)
        if len(parts) > 1:
            waiting += [_mapped(part, *how) for part in parts]
            continue
        if worst is not whole and worst.is_lost:
            worst = _grown(worst, *how)
        if is_uneven and whole.is_lost:
            whole = _grown(whole, *how)
        if worst.unevenness < whole.unevenness:
            charts.append(worst)
        else:  # parted in vain
            waiting, charts = [], [whole]
    charts.sort(key=lambda chart: -len(chart.F))
    if later:
        charts = [_chart(chart.opened, options, limits.outline, progress) for chart in charts]
    for chart in charts:
        if chart.failure:
            raise MapError(chart.failure, chart.map)
    return charts


def _mapped(
    component: Component, options: Options, limits: Limits, progress: Progress | None
) -> Chart:
    """Open a component to a disk and map it; let the cut grow, unless it is lost."""
    opened = open_to_disk(fill_holes(component) if limits.fill else component)
    if limits.scale_variation < np.inf:
        opened = lead_away(opened)
    first = _chart(opened, options, limits.outline, progress)
    is_far = limits.parts_early and first.scale_variation > LOST * limits.scale_variation
    if is_far and len(opened.cut_edges) and len(component.rows) >= LEAST_FACES:
        return replace(first, level=first.deviation, is_lost=True)
    return _grown(first, options, limits, progress)


def _grown(first: Chart, options: Options, limits: Limits, progress: Progress | None) -> Chart:
    """Grow the cut of a component while that evens out the scale."""
    best = replace(first, is_lost=False)
    is_small = len(first.opened.component.rows) < LEAST_FACES
    asked = limits.scale_variation
    while best.scale_variation > asked or not (best.map.conformal or asked == np.inf):
        longer = grow(best)
        if longer is best.opened:
            break
        grown = _chart(longer, options, limits.outline, progress)
        if not grown.gains_on(best):
            break
        best = replace(grown, level=first.deviation)
        if is_small or (limits.max_charts > 1 and best.scale_variation > HOPELESS * asked):
            break
        if limits.parts_early and 2 * best.scale_variation < first.scale_variation:
            break
    return best


def _chart(
    opened: OpenedComponent, options: Options, outline: Outline, progress: Progress | None
) -> Chart:
    """Map a component that is cut to a disk once, and measure how its scale varies."""
    V, F, failure = opened.positions, opened.F, ""
    made: object
    try:
        if outline == "free":
            taken = vars(options).keys() & signature(free_map).parameters.keys()
            free = {name: getattr(options, name) for name in taken}
            made = free_map(V, F, progress=progress, **free)
        else:
            made = disk_map(V, F, progress=progress, **vars(options))
    except MapError as error:
        made, failure = error.result, str(error)
        if not isinstance(made, DiskMap | FreeMap) or not np.isfinite(made.uv).all():
            raise
    given = F[: len(opened.component.rows)]
    area = vertex_areas(V, given)
    if outline == "free":
        factor = np.maximum(conformal_factor(V, F, made.uv), LEAST_FACTOR)
    else:
        factor = _centered_factor(V, F, made.uv, area)
    average = float(np.average(factor, weights=area))
    variation = float(np.sqrt(np.average((factor - average) ** 2, weights=area)))
    return Chart(opened, made, failure, factor, average, variation)


def _centered_factor(V: Floats, F: Ints, uv: Floats, area: Floats) -> Floats:
    """(n,) conformal factor that a map onto the disk has with the conformal barycentre at 0."""
    z = as_complex(uv)
    w = conformal_barycenter(z, area)
    derivative = (1 - abs(w) ** 2) / abs(1 - w.conjugate() * z) ** 2  # of the transformation (19)
    return np.maximum(conformal_factor(V, F, uv) + np.log(derivative), LEAST_FACTOR)


def fill_holes(component: Component) -> Component:
    """Fill all boundary loops but the outermost, for the time of a map.

    A hole that only faces without area would fill, such as a slit of coinciding edges, stays.
    """
    if component.topology.euler_characteristic > 0:  # a sphere or a disk
        return component
    loops = component.topology.loops
    if len(loops) < 2:
        return component
    V, filling = component.V, []
    outer = by_reach(V, loops)[0]
    for loop in loops:
        faces = None if loop is outer else fill_hole(V, loop)
        if faces is not None:
            if faces.max() == len(V):
                V = np.vstack([V, V[loop].mean(axis=0)])
            filling.append(faces)
    F = np.vstack([component.F, *filling])
    alone = component.polygon.max() + np.arange(1, len(F) - len(component.F) + 1)
    polygon = np.append(component.polygon, alone)
    return Component(V, F, polygon, component.rows, n_filled=len(filling))


def lead_away(opened: OpenedComponent) -> OpenedComponent:
    """Cut from a boundary that is tiny by the surface to the vertex farthest from it.

    Almost all of a surface that is closed but for a small hole would be shrunk.
    """
    component = opened.component
    border = np.flatnonzero(opened.is_cut)
    along = component.V[component.head[border]] - component.V[component.tail[border]]
    length = np.linalg.norm(along, axis=1).sum()
    if length**2 > TINY * 4 * np.pi * face_areas(component.V, component.F).sum():
        return opened
    boundary = np.flatnonzero(opened.on_boundary)
    distance = dijkstra(opened.graph(component.length), indices=boundary, min_only=True)
    return branch_to(opened, int(distance.argmax()))


def grow(chart: Chart) -> OpenedComponent:
    """Cut on to the vertex that shrank most, in each part of the surface that did.

    After X. Gu, S. J. Gortler, H. Hoppe. Geometry images. SIGGRAPH 2002.
    """
    opened, factor = chart.opened, chart.factor
    shrunk = np.flatnonzero(~opened.on_boundary & (factor < chart.average - SHRUNK))
    if len(shrunk) == 0:
        return opened
    inside = opened.graph(np.ones(len(opened.tail)))[shrunk][:, shrunk]
    count, region = connected_components(inside, directed=False)
    order = np.lexsort((factor[shrunk], region))
    tips = shrunk[order[np.searchsorted(region[order], np.arange(count))]]
    grown = opened
    for tip in tips[np.argsort(factor[tips])][:MOST_BRANCHES]:
        grown = branch_to(grown, int(tip))
    if opened.component.length[grown.cut_edges].sum() < SHORT * np.sqrt(len(opened.F)):
        return opened
    if grown is opened or isinstance(chart.map, FreeMap):  # whose outline bends with the cut
        return grown
    straight = straighten(grown)
    return opened if np.array_equal(straight.is_cut, opened.is_cut) else straight


def parted(chart: Chart, most: float) -> list[Component]:
    """Part a component into at most so many: limbs from the rest, or in two where it is narrow.

    One that cannot be parted stays whole. One with handles has no limbs, nor one whose cut has not
    grown: what is shrunk there hangs on the boundary.
    """
    component = chart.opened.component
    m = len(component.rows)
    if m < LEAST_FACES:
        return [component]
    F, polygon = component.F[:m], component.polygon[:m]
    given = Component(component.V[: F.max() + 1], F, polygon, component.rows)
    left, right = given.sides(given.edges)
    ways: list[Callable[[Component], Bools]] = [narrow_side]
    if chart.level is not None and component.topology.euler_characteristic > 0:
        ways.insert(0, partial(limbs, level=chart.level))
    for way in ways:
        low = way(given)
        opened = given.uncut.cut(given.edges[low[left] != low[right]])
        parts = list(split_components(opened.positions, opened.F, opened.F, polygon))
        if 1 < len(parts) <= most:
            return [replace(part, rows=component.rows[part.rows]) for part in parts]
    return [component]


def _mean_of_polygons(component: Component, values: Floats) -> Floats:
    """(m,) means over the faces of each polygon, for each face."""
    _, number = np.unique(component.polygon, return_inverse=True)
    return (np.bincount(number, values) / np.bincount(number))[number]


def _regions(component: Component, low: Bools) -> tuple[int, NDArray[np.int32]]:
    """Count the regions of faces that are all `low` (m,), or none of them; (m,) their numbers."""
    left, right = component.sides(component.edges)
    within = low[left] == low[right]
    return components_of_pairs(left[within], right[within], len(low))


def limbs(component: Component, level: Floats) -> Bools:
    """(m,) the faces of large regions where a map has shrunk lengths, by its `level` (m,).

    What lies between such regions is large, too; none if there is nothing else.
    """
    area = face_areas(component.V, component.F)
    low = _mean_of_polygons(component, level) < -LIMB
    for side in (True, False, True):
        count, region = _regions(component, low)
        small = np.bincount(region, area, count) < LEAST_LIMB * area.sum()
        small |= np.bincount(region, minlength=count) < LEAST_FACES
        low[(low == side) & small[region]] = not side
    return low & ~low.all()


def narrow_side(component: Component) -> Bools:
    """(m,) the faces on one side of where a component is narrow between two far ends, if any.

    Of the level lines of the difference of the distances from the ends, along the one that is
    shortest for the smaller of the areas on either side.
    """
    m, n, area = len(component.F), len(component.V), face_areas(component.V, component.F)
    graph = csr_matrix((component.length, (component.tail, component.head)), (n, n))
    distances = partial(dijkstra, graph, directed=False)  # at the boundary, edges go one way
    from_end = distances(indices=distances(indices=0).argmax())
    way = from_end - distances(indices=from_end.argmax())
    level = _mean_of_polygons(component, way[component.F].mean(axis=1))
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
