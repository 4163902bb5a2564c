"""Any surface onto charts: cleaned, cut open, and each component mapped."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import asdict, astuple, dataclass, field, replace
from time import perf_counter
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from .. import libigl
from ..arguments import typed
from ..arrays import (
    Complex,
    Floats,
    Ints,
    as_complex,
    coordinates,
    rows_not_in,
    size_exponent,
    unit_size,
)
from ..cached import cached_property
from ..errors import counted
from ..fields import Field, Method
from ..io.given import takes_meshes
from ..maps.free import FreeMap
from ..options import Options
from ..phases import Progress
from ..plot.layout import Layout
from ..rescue.repair import Repair
from ..result.base import announced
from ..result.bijection import Bijection
from ..result.disk_map import DiskMap
from ..solve.solvers import SolverName
from ..steps.center import CenterMethod
from ..surface.location import FaceFinder
from ..surface.triangles import face_areas, oriented_areas
from ..surface.validation import usable_arrays
from ..verdict.certificate import Certificate, together
from ..verdict.conformality import Conformality
from ..verdict.distortion import AngleDistortion, reported_distortion
from ..verdict.outline import OutlineCertificate
from .charts import Chart, Limits, Outline, charts_of
from .cut_graph import split_components
from .cutting import Cut, cut_along
from .own_seams import among_edges, checked_edges, checked_seams, cut_at, wanted_edges
from .packing import Packing
from .sheets import Sheets, fill_left_out, oriented_sheets
from .texels import TexelDensity

log = logging.getLogger("cdcp_igl")


@dataclass(frozen=True, eq=False, repr=False)
class SurfaceMap(Bijection):
    """A map of a surface onto charts, disks or with free outlines; printing it gives a summary.

    Attributes
    ----------
    uv : (m, 3, 2) float64
        Image of corner k of face f of the given F in its chart: in the unit disk or, with free
        outlines, in the unit of V.
        Corners of the same vertex have the same image, unless the surface was cut between them.
    charts : tuple of DiskMap, or of FreeMap
        The maps, those of the component with most faces first. Their rows are vertices of the
        opened chart, in a unit that is a power of two of that of V.
    face_chart : (m,) int64
        Which chart each face is in; -1 if it was left out, because it has no area or is there
        already. It lies where its twin does, or all at one place of a chart, or is NaN.
    cut : Cut
        The opened surface, with the edges that were cut and their length. Flipped faces still
        are flipped; of vertices that were merged, it names the first.
    added : (k, 2) int64
        Those of ``cut.edges`` that were not among the `seams` given.
    changes : tuple of str
        What was done to make disks, a sentence each; empty if the surface was a disk.
    certificate : Certificate or OutlineCertificate
        Those of all charts in one, valid if each of them is: the largest error, the winding number
        farthest from 1, all flipped faces (rows of ``charts[k].mesh.F``), and how many were decided
        exactly. It does not compare one chart with another.
    conformality : Conformality
        That of the worst chart: of those that are not conformal, if any, the one of the largest
        mean distortion. Of several charts, the reasons name it.
    distortion : AngleDistortion
        Of the given faces, all charts together.
    scale_variation : float
        Standard deviation over the area of the conformal factor, the logarithm of the scale;
        the largest of all charts. That of a disk is with its conformal barycentre at 0.
    scale_variation_asked : float
        What it was to be at most.
    texel_density : TexelDensity
        How evenly a texture covers the surface.
    packing : Packing
        How its charts lie in the square of the texture: `size`, `padding`, `density`, `rotate`.
    fill : float
        Share of this square that they cover.
    texels_per_unit : float
        Square root of the texels that they cover by the area of their faces.
    shares : (k,) float64
        Share of each chart in the area of the surface.
    timings : dict of str to float
        Seconds per phase of the maps that were kept, all charts together; "cut" is the rest: what
        was cleaned and cut, and the maps with cuts that grew on or that were parted.

    Examples
    --------
    Two caps, as a texture shows them:

    >>> import numpy as np
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.spherical_cap(5)
    >>> result = cdcp_igl.surface_map(np.vstack([2 * V, V + 3]), np.vstack([F, F + len(V)]))
    >>> large, small = np.split(1024 * result.packed(size=1024, padding=8), 2)
    >>> round(float(large.min()), 6)
    8.0
    """

    uv: Floats
    charts: tuple[DiskMap | FreeMap, ...]
    face_chart: Ints
    cut: Cut
    added: Ints
    changes: tuple[str, ...]
    certificate: Certificate | OutlineCertificate
    scale_variation: float
    scale_variation_asked: float
    shares: Floats
    _angles: AngleDistortion
    _stopped: str  # why the scale varies more than was asked, if it does
    packing: Packing = field(default_factory=Packing)

    _kind = "surface"

    @property
    def distortion(self) -> AngleDistortion:
        """Mean, SD and maximum of the angular distortion of the given faces."""
        return self._angles

    @cached_property
    def uv_cut(self) -> Floats:
        """(n, 2) image of each vertex of ``cut``: ``uv_cut[cut.F]`` is ``uv``."""
        uv_cut = np.empty((len(self.cut.V), 2))
        uv_cut[self.cut.F] = self.uv
        return uv_cut

    @typed
    def packed(
        self,
        size: int | None = None,
        padding: float | None = None,
        density: float | None = None,
        rotate: bool | None = None,
    ) -> Floats:
        """Lay the charts into the unit square by their shape, with areas as on the surface.

        Parameters
        ----------
        size, padding, density, rotate
            As in `surface_map`; None for what that was told. Files, pages and `bake` have what that
            was told.

        Returns
        -------
        (m, 3, 2) float64
            Texture coordinates of each corner.

        Raises
        ------
        ValueError
            If the charts do not fit.
        """
        asked = {"size": size, "padding": padding, "density": density, "rotate": rotate}
        given: dict[str, Any] = {name: x for name, x in asked.items() if x is not None}
        places = self._placed(replace(self.packing, **given)) if given else self._places
        chart, (factor, move) = self._chart_of_vertex, places
        return coordinates(factor[chart] * self._in_charts + move[chart])[self.cut.F]

    @property
    def _in_charts(self) -> Complex:
        """(n,) images of the vertices of ``cut`` as the charts have them: V scaled to unit size."""
        free = isinstance(self.charts[0], FreeMap)
        return as_complex(np.ldexp(self.uv_cut, -size_exponent(self.cut.V) if free else 0))

    @cached_property
    def _chart_of_vertex(self) -> Ints:
        """(n,) the chart of each vertex of ``cut``, -1 of those in none."""
        mapped = np.flatnonzero(self.face_chart >= 0)
        chart = np.full(len(self.cut.V), -1)
        chart[self.cut.F[mapped]] = self.face_chart[mapped][:, None]
        others = self.cut.F[self.face_chart < 0]  # whose images are at one place
        chart[others] = np.where(
            chart[others] < 0, chart[others].max(axis=1)[:, None], chart[others]
        )
        return chart

    def _unfolded(self) -> tuple[Floats, Ints, Floats]:
        if not isinstance(self.charts[0], FreeMap):
            return super()._unfolded()
        chart = self._chart_of_vertex
        factor, move = replace(self.packing, density=None).places(self._outlines)  # as they are
        uv = coordinates((factor[chart] * self._in_charts + move[chart]) / abs(factor[0]))
        uv = np.ldexp(uv, size_exponent(self.cut.V))
        return self.cut.V, self._charted[1], uv

    @property
    def _outlines(self) -> list[Complex]:
        """Images of the boundary of each chart."""
        return [as_complex(chart.uv)[chart.mesh.loop] for chart in self.charts]

    @cached_property
    def _places(self) -> tuple[Complex, Complex]:
        """(k,) factor and displacement that take each chart to its place in the square."""
        return self._placed(self.packing)

    def _placed(self, packing: Packing) -> tuple[Complex, Complex]:
        F, exponent = self.cut.F[self.face_chart >= 0], size_exponent(self.cut.V)
        areas = self.shares * face_areas(unit_size(self.cut.V), F).sum()
        ratios = [chart.area_ratio for chart in self.charts if isinstance(chart, FreeMap)]
        if ratios:
            scale = 1 / np.sqrt(ratios)
        else:  # disks lie as `align` says
            scale, packing = np.sqrt(areas / np.pi), replace(packing, rotate=False)
        outlines = [k * z for k, z in zip(scale, self._outlines, strict=True)]
        factor, move = packing.places(outlines, unit=np.ldexp(1.0, -exponent))
        return factor * scale, move

    @cached_property
    def fill(self) -> float:
        """Share of the square that the charts cover."""
        _, F, uv = self._charted
        return float(oriented_areas(as_complex(uv), F)[0].sum() / 2)

    @property
    def texels_per_unit(self) -> float:
        """Square root of the texels that the charts cover by the area of their faces."""
        V, F = self._surface()
        area = face_areas(V, F[self.face_chart >= 0]).sum()
        return float(self.packing.size * np.sqrt(self.fill / area))

    @cached_property
    def texel_density(self) -> TexelDensity:
        """How evenly a texture covers the surface."""
        charted = np.flatnonzero(self.face_chart >= 0)
        V, F = self._surface()
        density = np.exp(self.area_distortion() / 2)  # of the faces in charts
        area = face_areas(unit_size(V), F[charted])  # V may have two columns
        return TexelDensity.of(density, area, self.face_chart[charted])

    @property
    def verdict(self) -> str:
        """Whether the map is valid, conformal, and of as even a scale as was asked for."""
        if not self.valid or self.scale_variation <= self.scale_variation_asked:
            return super().verdict
        return f"{super().verdict}, scale variation {self._variation}"

    @property
    def _plural(self) -> str:
        name = "chart" if isinstance(self.charts[0], FreeMap) else "disk"
        return counted(len(self.charts), name, f"{name}s")

    def _subject(self) -> str:
        return f"{counted(len(self.uv), 'face', 'faces')} onto {self._plural}"

    def _steps(self) -> list[tuple[str, str]]:
        return [
            ("texel density", str(self.texel_density)),
            ("scale variation", self._variation),
            ("length of the cut", f"{self.cut.length:.4g}"),
            ("packing", self._packed_as),
            *(("change", change) for change in self.changes),
        ]

    @property
    def _variation(self) -> str:
        said, asked = f"{self.scale_variation:.2f}", self.scale_variation_asked
        within = self.scale_variation <= asked
        return said if within else f"{said}, asked for: {asked:g} ({self._stopped})"

    @property
    def _packed_as(self) -> str:
        size = self.packing.size
        return f"{self.fill:.0%} of {size:,} x {size:,}, {self.texels_per_unit:.4g} texels a unit"

    def _made(self) -> dict[str, Any]:
        """Of the worst chart; repairs are those of all."""
        repairs = [chart.repair for chart in self.charts]
        flipped, moved, rounds = map(sum, zip(*map(astuple, repairs), strict=True))
        repair = Repair(flipped, moved, rounds)
        return self.charts[_worst(self.charts)]._made() | {"repair": repair.report()}

    def _details(self) -> dict[str, Any]:
        return {
            "scale_variation": self.scale_variation,
            "scale_variation_asked": self.scale_variation_asked,
            "texel_density": asdict(self.texel_density)
            | {"charts": list(self.texel_density.charts)},
            "packing": asdict(self.packing)
            | {"fill": self.fill, "texels_per_unit": self.texels_per_unit},
            "cut_length": self.cut.length,
            "cut_edges": len(self.cut.edges),
            "added_edges": len(self.added),
            "changes": list(self.changes),
            "charts": [chart.report() for chart in self.charts],
        }

    def _surface(self) -> tuple[Floats, Ints]:
        """Return the given surface, but for vertices that no face uses."""
        used, row = np.unique(self.cut.vertex_index, return_inverse=True)
        return self.cut.V[: len(used)], row[self.cut.F]  # copies along the cut come last

    @property
    def _faces(self) -> Ints:
        return self.cut.vertex_index[self.cut.F]

    def _corner_images(self, face: Ints) -> Floats:
        return self.packed()[face]

    def _field(self, values: ArrayLike, method: Method | None = None) -> Field:
        # Of vertices that no face uses, the last ones may be there or not.
        n = int(self.cut.vertex_index.max()) + 1
        return Field.of(values, method).of_vertices(n, unused=True)

    @cached_property
    def _charted(self) -> tuple[Ints, Ints, Floats]:
        """(k,) the faces in charts, (k, 3) their corners as the charts have them, (n, 2) places.

        Other faces have no area, or are there twice; flipped faces of the surface are turned.
        """
        faces, uv = np.flatnonzero(self.face_chart >= 0), np.zeros((len(self.cut.V), 2))
        F = self.cut.F[faces]
        uv[F] = self.packed()[faces]
        area, _ = oriented_areas(as_complex(uv), F)
        return faces, np.where((area < 0)[:, None], F[:, ::-1], F), uv

    @cached_property
    def _finder(self) -> FaceFinder:
        _, F, uv = self._charted
        return FaceFinder(F, as_complex(uv))

    def _located(self, points: Floats) -> tuple[Ints, Floats]:
        faces, F, _ = self._charted
        found, barycentric, _ = self._finder.locate(as_complex(points))
        face = np.where(found < 0, -1, faces[found])
        turned = F[found, 0] != self.cut.F[face, 0]
        barycentric[turned] = barycentric[turned, ::-1]
        return face, barycentric

    def _layout(self) -> Layout:
        cut, (faces, F, uv) = self.cut, self._charted
        charts = np.full(len(cut.V), -1)
        charts[F] = self.face_chart[faces, None]
        return Layout(
            V=unit_size(cut.V),
            F=F,
            uv=2 * uv - 1,
            vertices=cut.vertex_index,
            faces=faces,
            plane=self._plural if len(self.charts) > 1 else self._plural.split()[1].capitalize(),
            middle=(0.5, 0.5),
            scale=0.5,
            distortion=self.distortion,
            flipped=len(self.certificate.flipped),
            facts=self._facts(f"{len(np.unique(cut.vertex_index)):,} vertices"),
            verdict=self.verdict,
            charts=charts if len(self.charts) > 1 else None,
        )


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


def _worst(maps: Sequence[DiskMap | FreeMap]) -> int:
    """Find the chart of largest mean distortion, of those that are not conformal, if any."""
    return max(range(len(maps)), key=lambda k: (not maps[k].is_acceptable, maps[k].distortion.mean))


def _worst_conformality(maps: list[DiskMap | FreeMap]) -> Conformality:
    """Find the verdict on the worst chart, with its number."""
    bad, worst = [made for made in maps if not made.is_acceptable], _worst(maps)
    verdict = maps[worst].conformality
    if not bad or len(maps) == 1:
        return verdict
    reasons = tuple(f"charts[{worst}]: {reason}" for reason in verdict.reasons)
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
