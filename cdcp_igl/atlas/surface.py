"""Any surface onto charts: cleaned, cut open, and each component mapped."""

from __future__ import annotations

import logging
from dataclasses import replace
from time import perf_counter
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from .. import libigl
from ..arrays import (
    Floats,
    Ints,
    rows_not_in,
    size_exponent,
)
from ..errors import counted
from ..io.given import takes_meshes
from ..options import Options
from ..phases import Progress
from ..result.base import announced
from ..result.disk_map import DiskMap
from ..result.free_map import FreeMap
from ..result.packing import Packing
from ..result.surface_map import SurfaceMap, worst
from ..solve.solvers import SolverName
from ..steps.center import CenterMethod
from ..surface.triangles import face_areas
from ..surface.validation import usable_arrays
from ..verdict.certificate import together
from ..verdict.conformality import Conformality
from ..verdict.distortion import AngleDistortion, reported_distortion
from .charts import Chart, Limits, Outline, charts_of
from .cut_graph import split_components
from .cutting import cut_along
from .own_seams import among_edges, checked_edges, checked_seams, cut_at, wanted_edges
from .sheets import Sheets, fill_left_out, oriented_sheets

log = logging.getLogger("cdcp_igl")


@takes_meshes
def surface_map(
    V: ArrayLike,
    F: ArrayLike,
    *,
    polygon_of_face: ArrayLike | None = None,
    merge: bool = True,
    outline: Outline = "free",
    fill: bool | None = None,
    seams: ArrayLike | Literal["uv", "keep"] | None = None,
    forbidden: ArrayLike | None = None,
    scale_variation: float | None = None,
    max_charts: int | None = None,
    size: int = 2048,
    padding: float = 4,
    density: float | None = None,
    rotate: bool = True,
    center: CenterMethod = "torsion",
    mobius: Literal["angle", "area"] | None = "angle",
    align: ArrayLike | None = None,
    refine: int | None = None,
    refine_norm: float = 1.5,
    refine_seconds: float = np.inf,
    keep: float | str = "angles",
    preset: Literal["paper"] | None = None,
    solver: SolverName | None = None,
    progress: Progress | None = None,
) -> SurfaceMap:
    """Map any surface conformally onto charts: clean it, cut it open, map each component.

    What can be repaired without changing the shape is: vertices of equal coordinates are merged
    along seams, flipped faces oriented, vertices where fans of faces meet split, sheets that meet
    in an edge of three or more faces parted, one-sided parts cut where their orientation turns
    over.

    Charts have the outline that distorts least, and a scale that is the same nearly everywhere, so
    that texels are: short slits lead to where curvature would vary it, and what is flat between its
    corners, such as a box or a can, is unfolded to its net, without any distortion. Where outlines
    would overlap themselves, slits get too long, faces stay flipped, or are too large for a
    conformal map, there are more charts.

    Parameters
    ----------
    V : (n, 3) or (n, 2) array_like of real numbers
        Vertex positions, in any unit. Those that no face uses are ignored. In place of V and F,
        one object as in `disk_map`.
    F : (m, 3) array_like of integers
        Corners of the faces.
    polygon_of_face : (m,) array_like of integers, optional
        As in `cut`: which polygon each face is a part of; polygons are not parted.
    merge : bool
        Merge vertices of equal coordinates along seams, where two edges lie in the same place,
        each with a face of its own. Sheets that only touch stay apart.
    outline : {"free", "disk"}
        Each chart with an outline of its own, as by `free_map`, or onto the unit disk, which
        registration wants, and which shrinks what lies behind a neck.
    fill : bool, optional
        Fill all boundary loops but the outermost of each component while mapping; those faces
        are not returned. False cuts to them. By default, whichever leaves a more even scale: holes
        are filled, unless cuts to them halve the variation, as in a tube. Of disks they are filled.
    seams : (k, 2) or (m, 3, 2) array_like, or {"uv", "keep"}, optional
        Cut along these edges, each named by its two rows of V; those where texture coordinates of
        the corners differ from face to face, or `"uv"` for the coordinates of the file that is
        given; or `"keep"` those where the surface has the same place twice.
        Cuts are added only where a chart would be no disk, and where a `scale_variation` is asked
        for, too. One edge alone, between inner vertices, opens nothing.
    forbidden : (k, 2) array_like of integers, optional
        Edges that are not to be cut.
    scale_variation : float, optional
        The scale is to vary no more than this: the standard deviation of its logarithm over the
        area of a chart, ``SurfaceMap.scale_variation``. By default 0.2, at which texels differ by
        less than a factor of two, one level of a mipmap, from the 5th to the 95th percentile. Where
        it is not reached, the first line of the result says so.
        With infinity there are no slits, and nothing is parted; nor is it by default with `seams`,
        where the first line says, too, if the scale varies more than by default.
        Where faces are large a chart may vary by up to twice as much: it is parted from there on.
        Of disks it is 1 by default: the cut grows to what shrank, as long as that gains, and then
        the component is parted, limbs first. It is parted before where that leaves more than 1.4
        times what is asked for or halves it, or where more than twice this is left before any
        growth. Parting ends with the first part that is no better than the whole.
    max_charts : int, optional
        So many charts a component has at most; as many as are needed by default.
    size : int
        Texels along each side of the square into which ``SurfaceMap.packed`` lays the charts.
    padding : float
        So many of these texels are between two charts, and between them and the rim.
    density : float, optional
        Texels a unit of V, such as for several surfaces alike; by default the charts are as large
        as there is room for.
    rotate : bool
        Whether charts with free outlines are turned, so that they need less room.
    center, mobius, refine, refine_norm, refine_seconds, keep, preset, solver, progress
        As in `disk_map`, for each chart; `refine_seconds` for each. Only disks have `center`,
        `mobius` and `preset`. The surface is cut for angles, whatever is to be kept. As needed, a
        chart with a free outline is refined by five steps if its mean error is above one degree.
    align : (3,) array_like or None
        A direction in space that goes right, as in `disk_map`.

    Returns
    -------
    SurfaceMap

    Raises
    ------
    MeshError
        If V and F are no triangle mesh, or no face has an area; if one of `seams` or `forbidden` is
        no edge, or the latter leave no way to make a disk.
    SolverError, MapError, ImportError
        As `disk_map`.
    ValueError
        If an option is not one of those above; if an edge is in `seams` and in `forbidden`; if the
        charts do not fit into the square.

    Examples
    --------
    A closed surface:

    >>> import cdcp_igl
    >>> V = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    >>> F = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]
    >>> result = cdcp_igl.surface_map(V, F)
    >>> result.valid, result.uv.shape, result.changes
    (True, (4, 3, 2), ('cut open along 3 edges',))

    And along a path of one's own:

    >>> result = cdcp_igl.surface_map(V, F, seams=[[1, 0], [0, 3]])
    >>> result.cut.edges.tolist(), result.added.tolist()
    ([[0, 1], [0, 3]], [])
    """
    packing = Packing(size, padding, density, rotate)
    wish = checked_seams(np.empty((0, 2), np.int64) if seams is None else seams)
    barred = checked_edges("forbidden", [] if forbidden is None else forbidden)
    limits = Limits(outline, fill, scale_variation, np.inf if max_charts is None else max_charts)
    held = limits  # by more cuts; none are added to own seams for a scale that is not asked for
    if seams is not None and scale_variation is None:
        held = replace(limits, scale_variation=np.inf)
    if outline == "free" and (center, mobius, preset) != ("torsion", "angle", None):
        raise ValueError('center, mobius and preset are for disks: outline="disk"')
    if not isinstance(merge, bool | np.bool_):
        raise ValueError(f"merge must be True or False, not {merge!r}")
    if not isinstance(center, str):
        raise ValueError(f"center must be a method, since each disk has a face, not {center!r}")
    if align is not None and np.ndim(align) == 0:
        raise ValueError(f"align must be a direction in space or None, not {align!r}")
    options = Options(
        center, mobius, align, refine, refine_norm, refine_seconds, preset, solver, keep
    )
    start = perf_counter()
    given, faces = usable_arrays(V, F)
    sheets = oriented_sheets(given, faces, polygon_of_face, merge)
    to_cut, barred = wanted_edges(sheets, faces, wish, barred)
    is_seam, is_barred = (among_edges(sheets.F, edges) for edges in (to_cut, barred))
    vertices = cut_at(sheets.vertices, is_seam) if is_seam.any() else sheets.vertices
    charts, done = [], 0.0
    known: dict[bytes, list[tuple[float, Chart]]] = {}
    for component in split_components(sheets.V, sheets.F, vertices, sheets.polygon, is_barred):
        share = len(component.rows) / len(sheets.F)
        part = _part_of(progress, done, share)
        charts += charts_of(component, options, held, known, part)
        done += share
    if progress:
        progress("done", 1.0)
    made = _together(given.astype(np.float64), sheets, charts, limits.asked, held, to_cut)
    mapping = sum(made.timings.values())
    timings = {"cut": perf_counter() - start - mapping} | made.timings
    made = replace(made, timings=timings, packing=packing)
    if made.scale_variation > limits.asked:
        log.warning("scale variation %s", made._variation)
    if lost := made._lost:
        log.warning("in single precision %s", lost)
    return announced(made)


def _part_of(progress: Progress | None, done: float, share: float) -> Progress | None:
    """Report one disk as a part of all; a round of growth begins anew, but nothing goes back."""
    if progress is None:
        return None
    reported = done

    def advance(phase: str, fraction: float) -> None:
        nonlocal reported
        if phase != "done":
            reported = max(reported, done + share * fraction)
            progress(phase, reported)

    return advance


def _together(
    V: Floats, sheets: Sheets, charts: list[Chart], asked: float, held: Limits, seams: Ints
) -> SurfaceMap:
    """Put the maps of all components back into the rows of the given faces."""
    F = sheets.given
    uv, face_chart = np.full((len(F), 3, 2), np.nan), np.full(len(F), -1)
    corners = -1 - np.arange(F.size).reshape(F.shape)
    count = 0
    for k, chart in enumerate(charts):
        rows = sheets.rows[chart.opened.component.rows]
        uv[rows], face_chart[rows], corners[rows] = chart.map.uv[chart.F], k, count + chart.F
        count += chart.opened.n
    mapped = np.flatnonzero(face_chart >= 0)
    areas = np.bincount(face_chart[mapped], face_areas(sheets.V, F[mapped]))
    angles = _distortion(sheets, uv[sheets.rows])
    flipped = sheets.rows[sheets.flipped]
    for array in (corners, uv):
        array[flipped] = array[flipped, ::-1]
    fill_left_out(F, face_chart >= 0, corners, uv)
    maps = [chart.map for chart in charts]
    opened, changes = cut_along(V, F, corners, face_chart >= 0), list(sheets.changes)
    if isinstance(maps[0], FreeMap):
        uv = np.ldexp(uv, size_exponent(opened.V))
    if filled := sum(chart.opened.component.n_filled for chart in charts):
        changes.append(f"filled {counted(filled, 'hole', 'holes')}")
    added = rows_not_in(seams, opened.edges)
    if len(opened.edges):
        of_them = f", {len(added):,} of them added to the seams given" if len(seams) else ""
        changes.append(f"cut open along {counted(len(opened.edges), 'edge', 'edges')}{of_them}")
    return SurfaceMap(
        uv=uv,
        charts=tuple(maps),
        face_chart=face_chart,
        cut=opened,
        added=added,
        changes=tuple(changes),
        certificate=together([made.certificate for made in maps]),
        conformality=_worst_conformality(maps),
        _angles=angles,
        scale_variation=max(chart.scale_variation for chart in charts),
        scale_variation_asked=asked,
        _stopped=_why_uneven(charts, held),
        shares=areas / areas.sum(),
        timings=_sum_of_seconds(maps),
    )


def _why_uneven(charts: list[Chart], limits: Limits) -> str:
    """Say why the scale varies more than is asked for, if it does."""
    if limits.asked == np.inf:
        return "nothing is added to the seams given for it, unless scale_variation is named"
    if max(charts, key=lambda chart: chart.scale_variation).is_traded:
        return "refined, as angles gain far more"
    return "max_charts" if len(charts) >= limits.max_charts else "more charts are not worth it"


def _distortion(sheets: Sheets, uv: Floats) -> AngleDistortion:
    """Measure the images (m, 3, 2) of the corners of all faces."""
    image, faces = uv.reshape(-1, 2), np.arange(uv.size // 2).reshape(-1, 3)
    flipped = libigl.double_areas(image, faces) < 0
    V = sheets.V[sheets.F.ravel()]
    return AngleDistortion.of(reported_distortion(V, faces, image, flipped))


def _worst_conformality(maps: list[DiskMap | FreeMap]) -> Conformality:
    """Find the verdict on the worst chart, with its number."""
    bad, chart = [made for made in maps if not made.is_acceptable], worst(maps)
    verdict = maps[chart].conformality
    if not bad or len(maps) == 1:
        return verdict
    reasons = tuple(f"charts[{chart}]: {reason}" for reason in verdict.reasons)
    if len(bad) > 1:
        others = counted(len(bad) - 1, "other chart is", "other charts are")
        reasons += (f"{others} not conformal either",)
    return replace(verdict, reasons=reasons)


def _sum_of_seconds(maps: list[DiskMap | FreeMap]) -> dict[str, float]:
    """Seconds per phase, all charts together."""
    total: dict[str, float] = {}
    for made in maps:
        for phase, seconds in made.timings.items():
            total[phase] = total.get(phase, 0.0) + seconds
    return total
