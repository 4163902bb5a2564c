"""Surfaces of all kinds: cut, filled, mapped; and what bounds the distortion from below."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from pathlib import Path
from time import perf_counter
from typing import Annotated

import numpy as np
import typer

import cdcp_igl
from cdcp_igl import MeshError, SurfaceMap
from cdcp_igl.libigl import angles
from cdcp_igl.surface.triangles import face_areas

from .models import files_of

COLUMNS = (
    "surface",
    "vertices",
    "disks",
    "valid",
    "conformal",
    "cut edges",
    "cut length",
    "mean",
    "SD",
    "least mean",
    "spread",
    "area SD",
    "seconds",
    "by disk_map",
)

NOTE = """
Angular distortion in degrees. Cut length by the square root of the area. Least mean: no map onto
disks with this cut can be below it, by the angles around the vertices. Spread: standard deviation
of the conformal factor. Area SD: that of the logarithm of the scale of area, over the area. By
disk_map: seconds by those of one `disk_map` of the opened components, in the same run.
"""


def surfaces(
    folder: Annotated[
        Path | None,
        typer.Argument(
            exists=True, file_okay=False, help="npz files of V and F, the class first in the name."
        ),
    ] = None,
    refine: Annotated[int, typer.Option(help="Steps of refinement.")] = 0,
    spread: Annotated[float, typer.Option(help="Grow cuts to this spread.")] = 1.0,
) -> None:
    """Map surfaces that are no disks, by class."""
    files = files_of(folder, {".npz"})
    for kind, group in groupby(files, key=lambda file: file.stem.partition("_")[0]):
        typer.echo(f"\n## {kind}\n")
        reasons = _print_rows(COLUMNS, _rows(group, refine=refine, spread=spread))
        for reason in reasons:
            typer.echo(f"\n- {reason}")
    typer.echo(NOTE)


def _rows(
    files: Iterator[Path], *, refine: int, spread: float
) -> Iterator[tuple[Sequence[str], str]]:
    """Yield the cells of each surface, and what holds it back if it is not conformal."""
    for file in files:
        with np.load(file) as mesh:
            V, F = mesh["V"].astype(np.float64), mesh["F"].astype(np.int64)
        start = perf_counter()
        try:
            result = cdcp_igl.surface_map(V, F, refine=refine, spread=spread)
        except MeshError as error:
            yield [file.stem, f"{len(V):,}", f"refused: {error}"], ""
            continue
        seconds = perf_counter() - start
        alone = sum(sum(disk.timings.values()) for disk in result.disks)
        mapped = result.face_disk >= 0
        area = face_areas(V, F)
        change = result.area_distortion()
        weights = area[mapped] / area[mapped].sum()
        area_sd = np.sqrt(weights @ (change - weights @ change) ** 2)
        cells = [
            file.stem,
            f"{len(V):,}",
            f"{len(result.disks)}",
            "yes" if result.valid else "NO",
            "yes" if result.conformal else "no",
            f"{len(result.cut.edges):,}",
            f"{result.cut.length / np.sqrt(area[mapped].sum()):.2f}",
            f"{result.distortion.mean:.2f}",
            f"{result.distortion.sd:.2f}",
            f"{least_distortion(result):.2f}",
            f"{result.spread:.2f}",
            f"{area_sd:.2f}",
            f"{seconds:.2f}",
            f"{seconds / alone:.1f}",
        ]
        worst = max(result.disks, key=lambda disk: (not disk.conformal, len(disk.uv)))
        yield cells, "" if result.conformal else f"{file.stem}: {worst.conformality}"


def least_distortion(result: SurfaceMap) -> float:
    """Bound the mean angular distortion from below by the angles around the vertices, in degrees.

    In the plane they are 2 pi around an interior vertex, and less than pi at a vertex of a
    convex polygon. What they are on the surface beyond that, some corner has to change.
    """
    mapped = result.face_disk >= 0
    F, uv = result.cut.F[mapped], result.uv_cut
    V = np.zeros((len(result.cut.V), 3))
    V[:, : result.cut.V.shape[1]] = result.cut.V
    sums = np.bincount(F.ravel(), angles(V, F).ravel(), len(V))
    around = np.zeros(len(V))
    u = uv[F]
    for k in range(3):
        one, other = u[:, (k + 1) % 3] - u[:, k], u[:, k - 1] - u[:, k]
        dot = (one * other).sum(axis=1)
        cross = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
        around += np.bincount(F[:, k], abs(np.arctan2(cross, dot)), len(V))
    interior = abs(around - 2 * np.pi) < 1e-6
    on_circle = np.hypot(*np.nan_to_num(uv).T) > 1 - 1e-9
    excess = abs(sums - 2 * np.pi)[interior].sum()
    excess += np.maximum(sums - np.pi, 0)[on_circle & ~interior].sum()
    return float(np.degrees(excess) / F.size)


def _print_rows(columns: Sequence[str], rows: Iterator[tuple[Sequence[str], str]]) -> list[str]:
    """Print a Markdown table row by row; return the notes that are not empty."""
    typer.echo(f"| {' | '.join(columns)} |")
    typer.echo(f"|---{'|--:' * (len(columns) - 1)}|")
    notes = []
    for cells, note in rows:
        typer.echo(f"| {' | '.join([*cells, *[''] * (len(columns) - len(cells))])} |")
        notes += [note] if note else []
    return notes
