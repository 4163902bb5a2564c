"""A component mapped onto a disk: its holes filled, opened, and the cut grown."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse.csgraph import connected_components, dijkstra

from ..algorithm import disk_map
from ..arrays import Floats, Ints, as_complex, coordinates
from ..certificate import certify
from ..distortion import conformal_factor
from ..errors import MapError
from ..rescue.boundary import by_inscribed_angles
from ..result.disk_map import DiskMap
from ..steps.mobius import conformal_barycenter
from ..steps.options import Options
from ..steps.phases import Progress
from ..surface.filling import fill_hole
from ..surface.topology import outer_loop
from ..surface.triangles import face_areas, vertex_areas
from .cut_graph import Component, OpenedComponent
from .cut_paths import branch_to, open_to_disk, straighten

# A round of growth is kept if it lowers the scale variation, or the angle error, by more than this
# share.
GAIN = 0.03
# The map has shrunk a part of the surface if lengths there are shorter than on the average by this
# power of e.
SHRUNK = 1.0
# A boundary is tiny if a round hole as long has at most this share of the surface's area.
TINY = 0.01
# Branches in one round of growth.
MOST_BRANCHES = 8
# Angles, in radians, that differ by rounding only.
SAME_ANGLE = 1e-9
# Where an edge has collapsed the conformal factor is minus infinity: counted as this.
LEAST_FACTOR = -50.0


@dataclass(frozen=True, eq=False)
class Chart:
    """A component opened to a disk, and its map."""

    opened: OpenedComponent
    disk: DiskMap
    failure: str  # why the map is not valid, or nothing
    factor: Floats  # (n,) conformal factor with the conformal barycentre at 0
    # Its mean and standard deviation over the area, without what fills holes.
    average: float
    spread: float

    @property
    def F(self) -> Ints:
        """(k, 3) the faces that do not fill holes, rows of ``disk.uv``."""
        return self.opened.F[: len(self.opened.component.rows)]

    def gains_on(self, other: Chart) -> bool:
        """Whether the scale is more even; or the angles are better where they were not good."""
        if other.disk.conformal:
            return self.disk.conformal and self.spread < (1 - GAIN) * other.spread
        return self.disk.distortion.mean < (1 - GAIN) * other.disk.distortion.mean


def map_component(
    component: Component,
    options: Options,
    fill: bool,
    spread: float,
    known: dict[bytes, list[Chart]],
    progress: Progress | None,
) -> Chart:
    """Open a component to a disk and map it, unless it is like one that is `known`, by its faces.

    Then it has the map of that.
    """
    alike = known.setdefault(component.F.tobytes(), [])
    if options.align is None:
        for chart in alike:
            if made := _made_like(chart, component, options):
                return made
    alike.append(_grown(component, options, fill, spread, progress))
    return alike[-1]


def _made_like(chart: Chart, component: Component, options: Options) -> Chart | None:
    """Give a component with the same faces the map of a known one, if its angles are the same.

    A face alone may have other angles: its map is a similarity.
    """
    disk, spread = chart.disk, chart.spread
    if chart.opened.component.n_filled:
        component = fill_holes(component)
    opened = chart.opened.moved(component)
    if len(component.F) == 1 and options.mobius != "area" and not options.refine:
        mesh = disk.mesh.moved(component.V)
        uv = coordinates(by_inscribed_angles(mesh))
        # The barycentre is 0 in the equilateral triangle, where the scale is 1 / sin^2.
        spread = float(2 * np.log(np.sin(mesh.angles)).std())
    elif _same_angles(component, chart.opened.component):
        mesh, uv = disk.mesh.moved(opened.positions), disk.uv
    else:
        return None
    certificate = certify(mesh, uv)
    if not certificate.valid:
        return None
    disk = replace(disk, mesh=mesh, uv=uv, certificate=certificate, timings={})
    return replace(chart, opened=opened, disk=disk, spread=spread)


def _same_angles(one: Component, other: Component) -> bool:
    polygons, others = (each.polygon - each.polygon[0] for each in (one, other))
    same = np.array_equal(one.F, other.F) and np.array_equal(polygons, others)
    return same and bool(abs(one.angle - other.angle).max() < SAME_ANGLE)


def _grown(
    component: Component, options: Options, fill: bool, spread: float, progress: Progress | None
) -> Chart:
    """Open a component to a disk and map it; grow the cut while that evens out the scale."""
    opened = open_to_disk(fill_holes(component) if fill else component)
    if spread < np.inf:
        opened = lead_away(opened)
    best = _chart(opened, options, progress)
    # Steps that were asked for are taken by the first map, and by the last if the cut has grown.
    in_between = replace(options, refine=None) if options.refine else options
    while best.spread > spread or not (best.disk.conformal or spread == np.inf):
        longer = grow(best)
        if longer is best.opened:
            break
        grown = _chart(longer, in_between, progress)
        if not grown.gains_on(best):
            break
        best = grown
    if options.refine and best.opened is not opened:
        best = _chart(best.opened, options, progress)
    if best.failure:
        raise MapError(best.failure, best.disk)
    return best


def _chart(opened: OpenedComponent, options: Options, progress: Progress | None) -> Chart:
    """Map a component that is cut to a disk once, and measure how its scale varies."""
    V, F, failure = opened.positions, opened.F, ""
    try:
        disk = disk_map(V, F, progress=progress, **vars(options))
    except MapError as error:
        if not isinstance(error.result, DiskMap) or not np.isfinite(error.result.uv).all():
            raise
        disk, failure = error.result, str(error)
    given = F[: len(opened.component.rows)]
    area = vertex_areas(V, given)
    factor = _centered_factor(V, F, disk.uv, area)
    average = float(np.average(factor, weights=area))
    spread = float(np.sqrt(np.average((factor - average) ** 2, weights=area)))
    return Chart(opened, disk, failure, factor, average, spread)


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
    outer = outer_loop(V, loops)
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
    n_parts, part = connected_components(inside, directed=False)
    order = np.lexsort((factor[shrunk], part))
    tips = shrunk[order[np.searchsorted(part[order], np.arange(n_parts))]]
    grown = opened
    for tip in tips[np.argsort(factor[tips])][:MOST_BRANCHES]:
        grown = branch_to(grown, int(tip))
    return opened if grown is opened else straighten(grown)
