"""Surfaces of all kinds: cut, filled, mapped; and what bounds the distortion from below."""

from __future__ import annotations

from itertools import groupby
from pathlib import Path
from time import perf_counter
from typing import Annotated

import numpy as np
import typer

import cdcp_igl
from cdcp_igl import MeshError, SurfaceMap
from cdcp_igl.arrays import as_complex
from cdcp_igl.libigl import angles
from cdcp_igl.surface.triangles import face_areas
from cdcp_igl.verdict.distortion import plane_angles

from ..write.table import Cell, Row, Table, markdown, name, number
from .models import files_of

COLUMNS = (
    *("surface", "vertices", "disks", "valid", "conformal", "cut edges", "cut length"),
    *("mean", "SD", "least mean", "scale variation", "area SD", "seconds", "by disk_map"),
)

NOTE = """
Angular distortion in degrees. Cut length by the square root of the area. Least mean: no map onto
disks with this cut can be below it, by the angles around the vertices. Scale variation: standard
deviation of the conformal factor. Area SD: that of the logarithm of the scale of area, over the
area. By disk_map: seconds by those of one `disk_map` of the opened components, in the same run.
"""


def surfaces(
    folder: Annotated[
        Path | None,
        typer.Argument(
            exists=True, file_okay=False, help="npz files of V and F, the class first in the name."
        ),
    ] = None,
) -> None:
    """Map surfaces that are no disks, by class."""
    files = files_of(folder, {".npz"})
    for kind, group in groupby(files, key=lambda file: file.stem.partition("_")[0]):
        rows = [_row(file) for file in group]
        typer.echo(f"\n## {kind}\n\n{markdown(Table(kind, kind, '', COLUMNS, rows))}")
    typer.echo(NOTE)


def _row(file: Path) -> Row:
    """Map a surface; the row notes what holds it back if it is not conformal."""
    with np.load(file) as mesh:
        V, F = mesh["V"].astype(np.float64), mesh["F"].astype(np.int64)
    names = [name(file.stem), Cell(f"{len(V):,}")]
    start = perf_counter()
    try:
        result = cdcp_igl.surface_map(V, F)
    except MeshError as error:
        return [*names, Cell(f"refused: {error}"), *[Cell("")] * (len(COLUMNS) - 3)]
    seconds = perf_counter() - start
    alone = sum(sum(disk.timings.values()) for disk in result.charts)
    mapped = result.face_chart >= 0
    area = face_areas(V, F)
    change = result.area_distortion()
    weights = area[mapped] / area[mapped].sum()
    area_sd = np.sqrt(weights @ (change - weights @ change) ** 2)
    worst = max(result.charts, key=lambda disk: (not disk.conformal, len(disk.uv)))
    return [
        *names,
        Cell(f"{len(result.charts)}"),
        Cell("yes" if result.valid else "NO"),
        Cell("yes") if result.conformal else Cell("no", note=str(worst.conformality)),
        Cell(f"{len(result.cut.edges):,}"),
        number(result.cut.length / np.sqrt(area[mapped].sum()), ".2f"),
        number(result.distortion.mean, ".2f"),
        number(result.distortion.sd, ".2f"),
        number(least_distortion(result), ".2f"),
        number(result.scale_variation, ".2f"),
        number(area_sd, ".2f"),
        number(seconds, ".2f"),
        number(seconds / alone, ".1f"),
    ]


def least_distortion(result: SurfaceMap) -> float:
    """Bound the mean angular distortion from below by the angles around the vertices, in degrees.

    In the plane they are 2 pi around an interior vertex, and less than pi at a vertex of a
    convex polygon. What they are on the surface beyond that, some corner has to change.
    """
    mapped = result.face_chart >= 0
    F, uv = result.cut.F[mapped], result.uv_cut
    V = np.zeros((len(result.cut.V), 3))
    V[:, : result.cut.V.shape[1]] = result.cut.V
    sums = np.bincount(F.ravel(), angles(V, F).ravel(), len(V))
    around = np.bincount(F.ravel(), abs(plane_angles(as_complex(uv), F)).ravel(), len(V))
    interior = abs(around - 2 * np.pi) < 1e-6
    on_circle = np.hypot(*np.nan_to_num(uv).T) > 1 - 1e-9
    excess = abs(sums - 2 * np.pi)[interior].sum()
    excess += np.maximum(sums - np.pi, 0)[on_circle & ~interior].sum()
    return float(np.degrees(excess) / F.size)
