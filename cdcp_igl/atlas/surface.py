"""Any surface onto disks: cleaned, cut open, and each component mapped."""

from __future__ import annotations

from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, Ints, as_complex
from ..cached import cached_property
from ..certificate import Certificate
from ..distortion import AngleDistortion, plane_angles
from ..errors import counted
from ..io.given import takes_meshes
from ..plot.layout import Layout
from ..rescue.conformality import Conformality
from ..result.base import Result
from ..result.disk_map import DiskMap
from ..solve.solvers import SolverName
from ..steps.center import CenterMethod
from ..steps.options import Options
from ..steps.phases import Progress
from ..surface.triangles import corner_angles, corner_cotangents, face_areas, oriented_areas
from ..surface.validation import unit_size, usable_arrays
from .charts import Chart, map_component
from .cut_graph import split_components
from .cutting import Cut, cut_along
from .packing import packed_circles
from .sheets import Sheets, fill_left_out, oriented_sheets


@dataclass(frozen=True, eq=False, repr=False)
class SurfaceMap(Result):
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
        The opened surface, with the edges that were cut and their length. Flipped faces still
        are flipped; of vertices that were merged, it names the first.
    changes : tuple of str
        What was done to make disks, a sentence each; empty if the surface was a disk.
    certificate : Certificate
        Those of all disks in one, valid if each of them is: the largest error, the winding number
        farthest from 1, all flipped faces (rows of ``disks[k].mesh.F``), and how many were decided
        exactly. It does not compare one disk with another.
    conformality : Conformality
        That of the worst disk: of those that are not conformal, if any, the one of the largest
        mean distortion. Of several disks, the reasons name it.
    distortion : AngleDistortion
        Of the given faces, all disks together.
    spread : float
        Standard deviation over the area of the conformal factor, the logarithm of the scale,
        with the conformal barycentre at 0; the largest of all disks.
    shares : (k,) float64
        Share of each disk in the area of the surface.
    timings : dict of str to float
        Seconds per phase of the maps that were kept, all disks together; "cut" is the rest: what
        was cleaned and cut, and the maps with cuts that grew on.

    Examples
    --------
    Two caps, the larger one packed below the other:

    >>> import numpy as np
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.spherical_cap(5)
    >>> result = cdcp_igl.surface_map(np.vstack([2 * V, V + 3]), np.vstack([F, F + len(V)]))
    >>> below, above = result.packed()[: len(F)], result.packed()[len(F) :]
    >>> bool(below[..., 1].max() < above[..., 1].min())
    True
    """

    uv: Floats
    disks: tuple[DiskMap, ...]
    face_disk: Ints
    cut: Cut
    changes: tuple[str, ...]
    certificate: Certificate
    conformality: Conformality
    distortion: AngleDistortion
    spread: float
    shares: Floats
    timings: dict[str, float]

    _kind = "surface"

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

    def _subject(self) -> str:
        faces = counted(len(self.uv), "face", "faces")
        return f"{faces} onto {counted(len(self.disks), 'disk', 'disks')}"

    def _steps(self) -> list[tuple[str, str]]:
        return [
            ("scale variation", f"{self.spread:.2f}"),
            ("length of the cut", f"{self.cut.length:.4g}"),
            *(("change", change) for change in self.changes),
        ]

    def _details(self) -> dict[str, Any]:
        return {
            "spread": self.spread,
            "cut_length": self.cut.length,
            "changes": list(self.changes),
            "disks": [disk.report() for disk in self.disks],
        }

    def _surface(self) -> tuple[Floats, Ints]:
        """Return the given surface, but for vertices that no face uses."""
        used, row = np.unique(self.cut.vertex_index, return_inverse=True)
        return self.cut.V[: len(used)], row[self.cut.F]  # copies along the cut come last

    def _layout(self) -> Layout:
        cut, count = self.cut, len(self.disks)
        faces = np.flatnonzero(self.face_disk >= 0)  # the others have no area, or are there twice
        F, uv = cut.F[faces], np.zeros((len(cut.V), 2))
        uv[F] = 2 * self.packed()[faces] - 1
        area, _ = oriented_areas(as_complex(uv), F)
        return Layout(
            V=unit_size(cut.V),
            # Flipped faces of the surface are drawn as the disks have them.
            F=np.where((area < 0)[:, None], F[:, ::-1], F),
            uv=uv,
            vertices=cut.vertex_index,
            faces=faces,
            plane=f"{count:,} disks" if count > 1 else "Disk",
            middle=(0.5, 0.5),
            scale=0.5,
            origin=(0.5, 0.5),
            distortion=self.distortion,
            flipped=len(self.certificate.flipped),
            facts=self._facts(f"{len(np.unique(cut.vertex_index)):,} vertices"),
        )


@takes_meshes
def surface_map(
    V: ArrayLike,
    F: ArrayLike,
    *,
    polygon_of_face: ArrayLike | None = None,
    merge: bool = True,
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
    """Map any surface conformally onto disks: clean it, cut it open, map each component.

    What can be repaired without changing the shape is: vertices of equal coordinates are merged
    along seams, flipped faces oriented, vertices where fans of faces meet split, sheets that meet
    in an edge of three or more faces parted. Where a disk would shrink a part of the surface, the
    cut is led to its tip.

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
    options = Options(center, mobius, align, refine, refine_norm, refine_seconds, preset, solver)
    start = perf_counter()
    given, faces = usable_arrays(V, F)
    sheets = oriented_sheets(given, faces, polygon_of_face, merge)
    charts, done = [], 0.0
    known: dict[bytes, list[Chart]] = {}
    for component in split_components(sheets.V, sheets.F, sheets.vertices, sheets.polygon):
        share = len(component.rows) / len(sheets.F)
        part = _part_of(progress, done, share)
        charts.append(map_component(component, options, fill, spread, known, part))
        done += share
    if progress:
        progress("done", 1.0)
    made = _together(given.astype(np.float64), sheets, charts)
    mapping = sum(made.timings.values())
    return replace(made, timings={"cut": perf_counter() - start - mapping} | made.timings)


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


def _together(V: Floats, sheets: Sheets, charts: list[Chart]) -> SurfaceMap:
    """Put the maps of all components back into the rows of the given faces."""
    F = sheets.given
    uv, face_disk = np.full((len(F), 3, 2), np.nan), np.full(len(F), -1)
    corners = -1 - np.arange(F.size).reshape(F.shape)
    count = 0
    for k, chart in enumerate(charts):
        rows = sheets.rows[chart.opened.component.rows]
        uv[rows], face_disk[rows], corners[rows] = chart.disk.uv[chart.F], k, count + chart.F
        count += chart.opened.n
    mapped = np.flatnonzero(face_disk >= 0)
    areas = np.bincount(face_disk[mapped], face_areas(sheets.V, F[mapped]))
    distortion = _distortion(sheets, uv[sheets.rows])
    flipped = sheets.rows[sheets.flipped]
    for array in (corners, uv):
        array[flipped] = array[flipped, ::-1]
    fill_left_out(F, face_disk >= 0, corners, uv)
    disks = [chart.disk for chart in charts]
    opened, changes = cut_along(V, F, corners), list(sheets.changes)
    if filled := sum(chart.opened.component.n_filled for chart in charts):
        changes.append(f"filled {counted(filled, 'hole', 'holes')}")
    if len(opened.edges):
        changes.append(f"cut open along {counted(len(opened.edges), 'edge', 'edges')}")
    return SurfaceMap(
        uv=uv,
        disks=tuple(disks),
        face_disk=face_disk,
        cut=opened,
        changes=tuple(changes),
        certificate=_common_certificate(disks),
        conformality=_worst_conformality(disks),
        distortion=distortion,
        spread=max(chart.spread for chart in charts),
        shares=areas / areas.sum(),
        timings=_sum_of_seconds(disks),
    )


def _distortion(sheets: Sheets, uv: Floats) -> AngleDistortion:
    """Measure the images (m, 3, 2) of the corners of all faces."""
    z = as_complex(uv.reshape(-1, 2))
    errors = plane_angles(z, np.arange(len(z)).reshape(-1, 3))
    errors -= corner_angles(corner_cotangents(sheets.V, sheets.F))
    return AngleDistortion.of(np.degrees(abs(errors)))


def _common_certificate(disks: list[DiskMap]) -> Certificate:
    """Sum up the certificates of all disks, as `SurfaceMap` says."""
    each = [disk.certificate for disk in disks]
    return Certificate(
        finite=all(certificate.finite for certificate in each),
        boundary_error=max(certificate.boundary_error for certificate in each),
        boundary_monotone=all(certificate.boundary_monotone for certificate in each),
        # 1, or one that is not: the farthest from it.
        winding_number=max((c.winding_number for c in each), key=lambda turns: abs(turns - 1)),
        flipped=np.concatenate([certificate.flipped for certificate in each]),
        n_exact=sum(certificate.n_exact for certificate in each),
    )


def _worst_conformality(disks: list[DiskMap]) -> Conformality:
    """Find the verdict on the worst disk, with the number of the disk."""
    bad = [k for k, disk in enumerate(disks) if not disk.conformal]
    worst = max(bad or range(len(disks)), key=lambda k: disks[k].distortion.mean)
    verdict = disks[worst].conformality
    if not bad or len(disks) == 1:
        return verdict
    reasons = tuple(f"disks[{worst}]: {reason}" for reason in verdict.reasons)
    if len(bad) > 1:
        others = counted(len(bad) - 1, "other disk is", "other disks are")
        reasons += (f"{others} not conformal either",)
    return replace(verdict, reasons=reasons)


def _sum_of_seconds(disks: list[DiskMap]) -> dict[str, float]:
    """Seconds per phase, all disks together."""
    total: dict[str, float] = {}
    for disk in disks:
        for phase, seconds in disk.timings.items():
            total[phase] = total.get(phase, 0.0) + seconds
    return total
