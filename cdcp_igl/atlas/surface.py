"""Any surface onto disks: mended, cut open, and each component mapped."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from ..algorithm import disk_map
from ..arrays import Floats, Ints, as_complex
from ..distortion import AngleDistortion, plane_angles
from ..errors import MapError, counted
from ..plot.shown import Shown
from ..result.disk_map import DiskMap
from ..solve.solvers import SolverName
from ..steps.center import CenterMethod
from ..steps.options import Options
from ..steps.phases import Progress
from ..surface.triangles import face_areas
from ..surface.validation import usable_arrays
from .cut_growth import grow, lead_away
from .cut_surface import CutSurface, Opened
from .cutting import Cut, cut_along, open_to_disk, split_components
from .holes import fill_holes
from .left_out import fill_left_out
from .packing import packed_circles
from .scale import centered_factor
from .sheets import Sheets, oriented_sheets

__all__ = ["SurfaceMap", "surface_map"]

# A round of growth is kept if it lowers the spread, or the angle error, by more than this share.
GAIN = 0.03


@dataclass(frozen=True, eq=False, repr=False)
class SurfaceMap(Shown):
    """A map of a surface onto disks, one for each component; printing it gives a summary.

    Attributes
    ----------
    uv : (m, 3, 2) float64
        Image of corner k of face f of the given F, in the unit disk of its component.
        Corners of the same vertex have the same image, unless the surface was cut between them.
    disks : tuple of DiskMap
        The maps, that of the component with most faces first. Their rows are vertices of the
        opened component.
    face_disk : (m,) int64
        Which disk each face is in; -1 if it was left out, because it has no area or is there
        already. Its corners lie where other faces have them, or are NaN.
    cut : Cut
        The opened surface, with the edges that were cut and their length. Where faces were turned
        over, they still are.
    changes : tuple of str
        What was done to make disks, a sentence each; empty if the surface was a disk.
    distortion : AngleDistortion
        Of the given faces, all disks together.
    spread : float
        Standard deviation over the area of the conformal factor, the logarithm of the scale,
        with the conformal barycentre at 0; the largest of all disks.
    shares : (k,) float64
        Share of each disk in the area of the surface.

    Examples
    --------
    Two caps, packed one below the other:

    >>> import numpy as np
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.spherical_cap(5)
    >>> result = cdcp_igl.surface_map(np.vstack([V, V + 3]), np.vstack([F, F + len(V)]))
    >>> below, above = result.packed()[: len(F)], result.packed()[len(F) :]
    >>> bool(below[..., 1].max() < above[..., 1].min())
    True
    """

    uv: Floats
    disks: tuple[DiskMap, ...]
    face_disk: Ints
    cut: Cut
    changes: tuple[str, ...]
    distortion: AngleDistortion
    spread: float
    shares: Floats

    @property
    def valid(self) -> bool:
        """True if every disk has a valid certificate."""
        return all(disk.certificate.valid for disk in self.disks)

    @property
    def conformal(self) -> bool:
        """True if every disk is as conformal as its mesh lets it be, see `DiskMap.conformal`."""
        return all(disk.conformal for disk in self.disks)

    @cached_property
    def uv_cut(self) -> Floats:
        """(n, 2) image of each vertex of ``cut``: ``uv_cut[cut.F]`` is ``uv``."""
        uv_cut = np.empty((len(self.cut.V), 2))
        uv_cut[self.cut.F] = self.uv
        return uv_cut

    def packed(self) -> Floats:
        """Lay the disks into the unit square, side by side, by area.

        Returns
        -------
        (m, 3, 2) float64
            Texture coordinates of each corner. The disks have areas as on the surface.
        """
        centers, radii = packed_circles(np.sqrt(self.shares))
        mapped = self.face_disk >= 0
        disk = np.zeros(len(self.cut.V), np.int64)
        disk[self.cut.F[mapped]] = self.face_disk[mapped][:, None]
        return (centers[disk] + radii[disk][:, None] * self.uv_cut)[self.cut.F]

    def __str__(self) -> str:
        certified = sum(disk.certificate.valid for disk in self.disks)
        return "\n".join(
            [
                f"surface map of {counted(len(self.uv), 'face', 'faces')} onto "
                f"{counted(len(self.disks), 'disk', 'disks')}: {certified:,} valid"
                + ("" if self.conformal else ", NOT CONFORMAL"),
                f"  angular distortion  {self.distortion}",
                f"  spread of scale     {self.spread:.2f}",
                f"  length of the cut   {self.cut.length:.4g}",
                *(f"  - {change}" for change in self.changes),
            ]
        )


def surface_map(
    V: ArrayLike,
    F: ArrayLike,
    *,
    polygon_of_face: ArrayLike | None = None,
    fill: bool = True,
    spread: float = 1.0,
    center: CenterMethod = "torsion",
    mobius: Literal["angle", "area"] | None = "angle",
    align: ArrayLike | None = None,
    refine: int | None = None,
    refine_norm: float = 1.5,
    refine_seconds: float = np.inf,
    preset: Literal["paper"] | None = None,
    solver: SolverName | None = None,
    progress: Progress | None = None,
) -> SurfaceMap:
    """Map any surface conformally onto disks: mend it, cut it open, map each component.

    What can be mended without changing the shape is: faces turned over, vertices where fans of
    faces meet split, sheets that meet in an edge of three or more faces parted. Where a disk would
    shrink a part of the surface, the cut is led to its tip.

    Parameters
    ----------
    V : (n, 3) or (n, 2) array_like of real numbers
        Vertex positions, in any unit. Those that no face uses are ignored.
    F : (m, 3) array_like of integers
        Corners of the faces.
    polygon_of_face : (m,) array_like of integers, optional
        As in `cut`: which polygon each face is a part of; polygons are not parted.
    fill : bool
        Fill all boundary loops but the outermost of each component while mapping; those faces
        are not returned. It distorts less than a cut to them. False cuts.
    spread : float
        Grow the cut until the standard deviation of the conformal factor is at most this and
        the map is conformal, or nothing is gained: see ``SurfaceMap.spread``. With infinity, no
        cut grows.
    center, mobius, refine, refine_norm, refine_seconds, preset, solver, progress
        As in `disk_map`, for each disk; `refine_seconds` for each.
    align : (3,) array_like or None
        A direction in space that goes right, as in `disk_map`.

    Returns
    -------
    SurfaceMap

    Raises
    ------
    MeshError
        If V and F are no triangle mesh, no face has an area, or a component is one-sided, like
        a Möbius strip or a Klein bottle.
    SolverError, MapError, ImportError
        As `disk_map`.
    ValueError
        If an option is not one of those above.

    Examples
    --------
    A closed surface:

    >>> import cdcp_igl
    >>> V = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    >>> F = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]
    >>> result = cdcp_igl.surface_map(V, F)
    >>> result.valid, result.uv.shape, result.changes
    (True, (4, 3, 2), ('cut open along 2 edges',))
    """
    if not spread >= 0:
        raise ValueError(f"spread must be 0 or more, not {spread!r}")
    if not isinstance(center, str):
        raise ValueError(f"center must be a method, since each disk has a face, not {center!r}")
    if align is not None and np.ndim(align) == 0:
        raise ValueError(f"align must be a direction in space or None, not {align!r}")
    steps = 0 if refine is None else refine  # 0 is as needed
    options = Options(center, mobius, align, steps, refine_norm, refine_seconds, preset, solver)
    given, faces = usable_arrays(V, F)
    sheets = oriented_sheets(given, faces, polygon_of_face)
    charts = _charts(sheets, options, fill, spread, progress)
    return _together(given.astype(np.float64), faces, sheets, list(charts))


@dataclass(frozen=True, eq=False)
class _Chart:
    """A component opened to a disk, and its map; `failure` says why that is not valid.

    `average` and `spread` are those of `factor` over the area. The first faces of `opened` are
    `rows` of the oriented surface, the others fill holes.
    """

    opened: Opened
    disk: DiskMap
    failure: str
    factor: Floats
    average: float
    spread: float
    rows: Ints = field(default_factory=lambda: np.empty(0, np.int64))
    n_filled: int = 0

    def gains_on(self, other: _Chart) -> bool:
        """Whether the scale is more even; or the angles are better where they were not good."""
        if other.disk.conformal:
            return self.disk.conformal and self.spread < (1 - GAIN) * other.spread
        return self.disk.distortion.mean < (1 - GAIN) * other.disk.distortion.mean


def _charts(
    sheets: Sheets,
    options: Options,
    fill: bool,
    spread: float,
    progress: Progress | None,
) -> Iterator[_Chart]:
    """Fill, open and map each component."""
    done = reported = 0.0
    for component in split_components(sheets.V, sheets.F, sheets.vertices, sheets.polygon):
        n_faces = len(component.rows)
        share = n_faces / len(sheets.F)

        def advance(phase: str, fraction: float, done: float = done, share: float = share) -> None:
            nonlocal reported
            if progress and phase != "done":
                reported = max(reported, done + share * fraction)  # each map begins anew
                progress(phase, reported)

        surface, n_filled = fill_holes(component.surface) if fill else (component.surface, 0)
        open_to_disk(surface)
        if spread < np.inf:
            lead_away(surface)
        chart = _grown(surface, options, advance, n_faces, spread)
        yield replace(chart, rows=component.rows, n_filled=n_filled)
        done += share
    if progress:
        progress("done", 1.0)


def _grown(
    surface: CutSurface, options: Options, progress: Progress, n_faces: int, spread: float
) -> _Chart:
    """Map a component that is cut to a disk, and grow the cut while that evens out the scale."""
    best, n_edges = _chart(surface, options, progress, n_faces), len(surface.cut_edges)
    as_needed = replace(options, refine=0)
    while best.spread > spread or not (best.disk.conformal or spread == np.inf):
        before = surface.is_cut.copy()
        if not grow(surface, best.factor, best.average):
            break
        grown = _chart(surface, as_needed, progress, n_faces)
        if not grown.gains_on(best):
            surface.is_cut = before
            break
        best = grown
    if options.refine and len(surface.cut_edges) != n_edges:
        best = _chart(surface, options, progress, n_faces)
    if best.failure:
        raise MapError(best.failure, best.disk)
    return best


def _chart(surface: CutSurface, options: Options, progress: Progress, n_faces: int) -> _Chart:
    """Map a component that is cut to a disk once, and measure how its scale varies."""
    opened = surface.opened()
    V, F, failure = opened.positions, opened.F, ""
    try:
        disk = disk_map(V, F, progress=progress, **vars(options))
    except MapError as error:
        if not isinstance(error.result, DiskMap) or not np.isfinite(error.result.uv).all():
            raise
        disk, failure = error.result, str(error)
    given = F[:n_faces]  # others fill holes
    area = np.bincount(given.ravel(), np.repeat(face_areas(V, given), 3), len(V))
    factor = centered_factor(V, F, disk.uv, area.astype(np.float64))
    average = float(np.average(factor, weights=area))
    deviation = float(np.sqrt(np.average((factor - average) ** 2, weights=area)))
    return _Chart(opened, disk, failure, factor, average, deviation)


def _together(V: Floats, F: Ints, sheets: Sheets, charts: list[_Chart]) -> SurfaceMap:
    """Put the maps of all components back into the rows of the given faces."""
    uv, face_disk = np.full((len(F), 3, 2), np.nan), np.full(len(F), -1)
    corners = -1 - np.arange(F.size).reshape(F.shape)
    count, errors, areas = 0, [], []
    for k, chart in enumerate(charts):
        rows = sheets.rows[chart.rows]
        tail = chart.opened.F[: len(rows)]
        uv[rows], face_disk[rows], corners[rows] = chart.disk.uv[tail], k, count + tail
        count += chart.opened.n
        angles = chart.opened.surface.angle.reshape(3, -1).T[: len(rows)]
        errors.append(np.degrees(abs(plane_angles(as_complex(chart.disk.uv), tail) - angles)))
        areas.append(float(face_areas(sheets.V, F[rows]).sum()))
    turned = sheets.rows[sheets.turned]
    for array in (corners, uv):
        array[turned] = array[turned, ::-1]
    fill_left_out(F, face_disk >= 0, corners, uv)
    opened, changes = cut_along(V, F, corners), list(sheets.changes)
    if filled := sum(chart.n_filled for chart in charts):
        changes.append(f"filled {counted(filled, 'hole', 'holes')}")
    if len(opened.edges):
        changes.append(f"cut open along {counted(len(opened.edges), 'edge', 'edges')}")
    return SurfaceMap(
        uv=uv,
        disks=tuple(chart.disk for chart in charts),
        face_disk=face_disk,
        cut=opened,
        changes=tuple(changes),
        distortion=AngleDistortion.of(np.concatenate(errors)),
        spread=max(chart.spread for chart in charts),
        shares=np.array(areas) / sum(areas),
    )
