"""A component mapped: its holes filled, opened, the cut grown, and parted if that is not enough."""

from __future__ import annotations

from bisect import bisect, insort
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from operator import itemgetter
from typing import Any, Literal

import numpy as np
from scipy.sparse.csgraph import connected_components, dijkstra

from ..arguments import is_real, is_whole
from ..arrays import Bools, Floats, Ints, as_complex, coordinates
from ..errors import MapError
from ..maps.disk import made_disk_map
from ..options import Options
from ..phases import Progress
from ..result.disk_map import DiskMap
from ..result.free_map import FreeMap
from ..solve.solvers import using
from ..starts.boundary import by_inscribed_angles
from ..steps.mobius import conformal_barycenter
from ..surface.triangles import face_areas, vertex_areas
from ..verdict.certificate import certify
from ..verdict.distortion import conformal_factor
from ..verdict.outline import certify_outline
from ..verdict.texels import variation
from .cones import Draft
from .cut_graph import Component, OpenedComponent, fill_holes
from .cut_paths import branch_to, open_to_disk, straighten
from .even import even_drafts, exact_nets, halves
from .parting import LEAST_FACES, limbs, narrow_side, parted_by, pieces

# A round of growth is kept if it lowers the scale variation, or the angle error, by more than this
# share.
GAIN = 0.03
# A chart whose mean angle error is more degrees is refined, if that is not said: along needles,
# slits cost angles that a few steps win back. Where the scale would then vary more than is asked
# for, it is so only if less than this share of the error is left.
ENOUGH, WORTH_UNEVENNESS = 1.0, 1 / 3
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
# The scale varies by less than this, as it is a logarithm of doubles.
MOST_VARIATION = 709
# What it may vary by default: texels differ by less than one level of a mipmap, a factor of two,
# between the fifth and the 95th percentile. Disks, which shrink what lies behind a neck, reach 1.
EVEN, EVEN_DISKS = 0.2, 1.0
# Where faces are large a map varies more than its draft, which is linear: from so many times what
# is asked a chart is parted, if this share of the variation is left at most.
FAR, WORTH_PARTING = 2.0, 0.75
# Where an edge has collapsed the conformal factor is minus infinity: counted as this.
LEAST_FACTOR = -50.0


Outline = Literal["disk", "free"]


@dataclass(frozen=True)
class Limits:
    """What kind of charts is asked for, and where there are to be more of them."""

    outline: Outline
    fill: bool | None
    scale_variation: float | None
    max_charts: float

    def __post_init__(self) -> None:
        if self.outline not in ("disk", "free"):
            raise ValueError(f'outline must be "disk" or "free", not {self.outline!r}')
        if not isinstance(self.fill, bool | np.bool_ | None):
            raise ValueError(f"fill must be True, False or None, not {self.fill!r}")
        most, asked = self.max_charts, self.asked
        if not (most == np.inf or (is_whole(most) and most >= 1)):
            raise ValueError(f"max_charts must be 1, 2, ... or None, not {most!r}")
        if not (is_real(asked) and (0 <= asked < MOST_VARIATION or asked == np.inf)):
            raise ValueError(
                f"scale_variation must be from 0 to {MOST_VARIATION}, or infinite, not {asked!r}"
            )

    @property
    def asked(self) -> float:
        """What the scale may vary: what no one sees, or what disks can reach, if not told."""
        default = EVEN if self.outline == "free" else EVEN_DISKS
        return default if self.scale_variation is None else self.scale_variation


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
    is_traded: bool = False  # its even scale, for angles

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
        return bool(self.failure), not self.map.is_acceptable, self.scale_variation

    def gains_on(self, other: Chart) -> bool:
        """Whether the scale is more even; or the angles are better where they were not good."""
        if other.failure:
            return not self.failure
        if other.map.is_acceptable:
            return (
                self.map.is_acceptable and self.scale_variation < (1 - GAIN) * other.scale_variation
            )
        return self.map.distortion.mean < (1 - GAIN) * other.map.distortion.mean


def charts_of(
    component: Component,
    options: Options,
    limits: Limits,
    known: dict[bytes, list[tuple[float, Chart]]],
    progress: Progress | None,
) -> list[Chart]:
    """Map a component onto charts, unless it is like one that is `known`, by its faces.

    Then it has the map of that. Those with the same faces are sorted by a mark, which differs as
    little as their angles. MapError if there is a chart without a valid map.
    """
    alike = known.setdefault(component.F.tobytes(), [])
    angles, by_mark = component.angle.ravel(), itemgetter(0)
    mark, most = float(angles @ np.cos(np.arange(len(angles)))), len(angles) * SAME_ANGLE
    if options.align is None:
        near = slice(*(bisect(alike, mark + change, key=by_mark) for change in (-most, most)))
        for _, chart in (*alike[:1], *alike[near]):  # a face alone may be like any other
            if made := _made_like(chart, component, options):
                return [made]
    make = _free_charts if limits.outline == "free" else _disks
    charts = sorted(make(component, options, limits, progress), key=lambda chart: -len(chart.F))
    for chart in charts:
        if chart.failure:
            raise MapError(chart.failure, chart.map)
    if len(charts) == 1:
        insort(alike, (mark, charts[0]), key=by_mark)
    return charts


def _free_charts(
    component: Component, options: Options, limits: Limits, progress: Progress | None
) -> list[Chart]:
    """Map a component onto charts with free outlines; part what is not conformal, or uneven."""
    charts, failed, done = list[Chart](), list[tuple[Draft, Chart]](), 0
    may_part, enough = limits.asked < np.inf, (False, False, FAR * limits.asked)
    with using(options.solver):
        for draft in even_drafts(component, options, limits.fill, limits.asked, limits.max_charts):
            chart = _free_chart(draft, options, limits.asked, may_ease=False)
            # As faces are large, or few: its net is exact.
            if may_part and chart.unevenness > enough:
                for net in exact_nets(pieces(draft.opened), options):
                    chart = _measured(net.opened, net.map)
            if chart.failure or (may_part and chart.unevenness > enough):
                failed.append((draft, chart))
            else:
                charts.append(chart)
            done += len(chart.F)
            if progress:
                progress("cut", done / len(component.rows))
        while failed:  # a part has fewer faces than the whole
            draft, whole = failed.pop()
            spare = limits.max_charts - len(charts) - len(failed) - 1
            parts = halves(draft) if may_part and spare else []
            more = list[Chart]()
            if 1 < len(parts) <= 1 + spare:
                spare -= len(parts) - 1
                for part in parts:
                    made = _free_charts(part, options, replace(limits, max_charts=1 + spare), None)
                    spare -= len(made) - 1
                    more += made
            better = (*whole.unevenness[:2], WORTH_PARTING * whole.scale_variation)
            if max((chart.unevenness for chart in more), default=whole.unevenness) < better:
                charts += more
            else:
                charts.append(_free_chart(draft, options, limits.asked) if whole.failure else whole)
    return charts


def _free_chart(draft: Draft, options: Options, asked: float, *, may_ease: bool = True) -> Chart:
    """Map a component that is cut to a disk; refine the map where that is needed, and pays."""
    plain = _measured(draft.opened, partial(draft.map, may_ease=may_ease))
    is_fine = plain.failure or plain.map.distortion.mean <= ENOUGH
    if is_fine or options.refine is not None or options.kept:
        return plain
    fine = _measured(draft.opened, partial(draft.map, ENOUGH))
    is_even = fine.scale_variation <= asked or plain.scale_variation > asked
    pays = is_even or fine.map.distortion.mean < WORTH_UNEVENNESS * plain.map.distortion.mean
    return plain if fine.failure or not pays else replace(fine, is_traded=not is_even)


def _made_like(chart: Chart, component: Component, options: Options) -> Chart | None:
    """Give a component with the same faces the map of a known one, if its angles are the same.

    A face alone may have other angles: its map is a similarity.
    """
    known, varies = chart.map, chart.scale_variation
    is_free = isinstance(known, FreeMap)
    if is_free and options.kept:  # what is kept has a size
        return None
    if chart.opened.component.n_filled:
        component = fill_holes(component)
    opened = chart.opened.moved(component)
    if not is_free and len(component.F) == 1 and options.mobius != "area" and not options.refine:
        mesh = known.mesh.moved(component.V)
        f = by_inscribed_angles(mesh)
        # The barycentre is 0 in the equilateral triangle, where the scale is 1 / sin^2.
        varies = variation(2 * np.log(np.sin(mesh.angles)).ravel())
    elif _same_angles(component, chart.opened.component):
        mesh, f = known.mesh.moved(opened.positions), known._f
    else:
        return None
    if is_free:
        area, other = (
            face_areas(each.V, each.F).sum() for each in (component, chart.opened.component)
        )
        f = as_complex(mesh.in_own_unit(np.sqrt(area / other) * known.uv))
    certificate = (certify_outline if is_free else certify)(mesh, coordinates(f))
    if not certificate.valid:
        return None
    same: dict[str, Any] = {"mesh": mesh, "_f": f, "certificate": certificate, "timings": {}}
    made = replace(known, **same)
    return replace(chart, opened=opened, map=made, scale_variation=varies)


def _same_angles(one: Component, other: Component) -> bool:
    polygons, others = (each.polygon - each.polygon[0] for each in (one, other))
    same = np.array_equal(one.F, other.F) and np.array_equal(polygons, others)
    same = same and np.array_equal(one.forbidden, other.forbidden)
    return same and bool(abs(one.angle - other.angle).max() < SAME_ANGLE)


def _disks(
    component: Component, options: Options, limits: Limits, progress: Progress | None
) -> list[Chart]:
    """Open a component to a disk and map it; part it where the scale is too uneven even so."""
    # What is asked for beyond that is done at the end, by the charts as they are then.
    later = bool(options.refine or options.kept)
    in_between = replace(options, refine=None, keep="angles") if later else options
    how = in_between, limits, progress
    whole = _mapped(component, *how)
    waiting, charts = [whole], list[Chart]()
    while waiting:  # a part has fewer faces than the whole
        waiting.sort(key=lambda chart: chart.unevenness)
        worst = waiting.pop()
        parts = [worst.opened.component]
        most = limits.max_charts - len(waiting) - len(charts)
        is_uneven = worst.unevenness > (False, False, limits.asked)
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
    if later:
        charts = [_chart(chart.opened, options, progress) for chart in charts]
    return charts


def _mapped(
    component: Component, options: Options, limits: Limits, progress: Progress | None
) -> Chart:
    """Open a component to a disk and map it; let the cut grow, unless it is lost."""
    opened = open_to_disk(component if limits.fill is False else fill_holes(component))
    if limits.asked < np.inf:
        opened = lead_away(opened)
    first = _chart(opened, options, progress)
    is_far = limits.max_charts > 1 and first.scale_variation > LOST * limits.asked
    if is_far and len(opened.cut_edges) and len(component.rows) >= LEAST_FACES:
        return replace(first, level=first.deviation, is_lost=True)
    return _grown(first, options, limits, progress)


def _grown(first: Chart, options: Options, limits: Limits, progress: Progress | None) -> Chart:
    """Grow the cut of a component while that evens out the scale."""
    best = replace(first, is_lost=False)
    is_small = len(first.opened.component.rows) < LEAST_FACES
    asked = limits.asked
    while best.scale_variation > asked or not (best.map.is_acceptable or asked == np.inf):
        longer = grow(best)
        if longer is best.opened:
            break
        grown = _chart(longer, options, progress)
        if not grown.gains_on(best):
            break
        best = replace(grown, level=first.deviation)
        if is_small or (limits.max_charts > 1 and best.scale_variation > HOPELESS * asked):
            break
        if limits.max_charts > 1 and 2 * best.scale_variation < first.scale_variation:
            break
    return best


def _chart(opened: OpenedComponent, options: Options, progress: Progress | None) -> Chart:
    """Map a component that is cut to a disk onto the unit disk."""

    def make() -> DiskMap:
        return made_disk_map(opened.positions, opened.F, options, progress)

    return _measured(opened, make)


def _measured(opened: OpenedComponent, make: Callable[[], DiskMap | FreeMap]) -> Chart:
    """Map a component that is cut to a disk once, and measure how its scale varies."""
    V, F, failure = opened.positions, opened.F, ""
    try:
        made = make()
    except MapError as error:
        failed, failure = error.result, str(error)
        if not isinstance(failed, DiskMap | FreeMap) or not np.isfinite(failed.uv).all():
            raise
        made = failed
    area = vertex_areas(V, F[: len(opened.component.rows)])
    if isinstance(made, FreeMap):
        factor = np.maximum(conformal_factor(V, F, made.uv), LEAST_FACTOR)
    else:
        factor = _centered_factor(V, F, made.uv, area)
    average = float(np.average(factor, weights=area))
    varies = variation(factor, area)
    return Chart(opened, made, failure, factor, average, varies)


def _centered_factor(V: Floats, F: Ints, uv: Floats, area: Floats) -> Floats:
    """(n,) conformal factor that a map onto the disk has with the conformal barycentre at 0."""
    z = as_complex(uv)
    w = conformal_barycenter(z, area)
    derivative = (1 - abs(w) ** 2) / abs(1 - w.conjugate() * z) ** 2  # of the transformation (19)
    return np.maximum(conformal_factor(V, F, uv) + np.log(derivative), LEAST_FACTOR)


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
    if grown is opened:
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
    F = component.F[:m]
    polygon, forbidden = component.polygon[:m], component.forbidden[:m]
    given = Component(component.V[: F.max() + 1], F, polygon, component.rows, forbidden)
    ways: list[Callable[[Component], Bools]] = [narrow_side]
    if chart.level is not None and component.topology.euler_characteristic > 0:
        ways.insert(0, partial(limbs, level=chart.level))
    for way in ways:
        parts = parted_by(given, way(given))
        if 1 < len(parts) <= most:
            return parts
    return [component]
