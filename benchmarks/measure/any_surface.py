"""Surfaces of all kinds as textures: how true and how even, by how many charts and seams."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import groupby
from pathlib import Path
from time import process_time
from typing import Annotated

import numpy as np
import typer

from cdcp_igl import DiskMap, MapError, MeshError, SolverError, SurfaceMap, certify, surface_map
from cdcp_igl.arrays import Floats, Ints, as_complex
from cdcp_igl.io import READABLE, read_mesh
from cdcp_igl.io.output import write_text
from cdcp_igl.libigl import angles
from cdcp_igl.surface.topology import Topology, components_of_pairs
from cdcp_igl.surface.triangles import face_areas
from cdcp_igl.verdict.distortion import plane_angles

from ..records.store import WORK, code
from ..write.report import facts
from ..write.table import Cell, Content, entitled, markdown, name, number, word
from .machine import describe
from .models import digest, files_of
from .peers import ATLASES
from .worker import Jobs, WorkFolder, answered, kept_answers, wide_console

SECONDS = 600.0  # after which a program hangs
OURS = "cdcp_igl"
MAPPED, LOST = "map", "no map"
TYPED = MapError, MeshError, SolverError


@dataclass(frozen=True)
class Row:
    """What a program made of a surface; `mesh` is the digest of V and F."""

    surface: str
    mesh: str
    program: str
    outcome: str = answered("")
    faces: int = answered(0)
    charts: int = answered(0)
    seams: float = answered(np.nan)  # their length by the square root of the area
    mean: float = answered(np.nan)  # angular distortion, degrees
    least: float = answered(np.nan)  # no map with these seams can be below it
    texels: float = answered(np.nan)  # density, 95th by 5th percentile of the surface
    fill: float = answered(np.nan)  # of the least square around all charts
    valid: bool = answered(False)
    seconds: float = answered(np.nan)  # of CPU


def surfaces(
    folder: Annotated[
        Path | None,
        typer.Argument(exists=True, file_okay=False, help="Files of any surfaces."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Also write the tables there, as Markdown.")
    ] = None,
    jobs: Jobs = 1,
    work: WorkFolder = None,
) -> None:
    """Make charts of surfaces of all kinds, and let xatlas and Blender do so where they are.

    What has been mapped is kept in build/benchmarks, and not mapped again.
    """
    paths = {path.stem: path for path in files_of(folder, READABLE)}
    missing = {program.missing() for program in ATLASES.values()} - {""}
    programs = [OURS, *(name for name, program in ATLASES.items() if not program.missing())]
    requests = [
        Row(name, digest(*_surface(path)), program)
        for name, path in paths.items()
        for program in programs
    ]
    console = wide_console()
    kept = (work or WORK / code()) / "atlases"
    rows = kept_answers(partial(examine, paths), requests, kept, SECONDS, jobs, console)
    tables = _summary(rows, programs), _details(rows)
    text = "\n\n".join(f"## {each.title}\n\n{each.text}\n\n{markdown(each)}" for each in tables)
    console.print("\n".join([text, *sorted(missing)]), markup=False, soft_wrap=True)
    if out:
        again = shlex.join(["python", "-m", "benchmarks", *sys.argv[1:]])
        on = facts(describe(1) | {"commands": {"surfaces": again}})
        write_text(out, f"# Charts of any surface\n\n## What was measured on\n\n{on}\n\n{text}\n")


@cache
def _surface(path: Path) -> tuple[Floats, Ints]:
    """Read a surface; vertices at one place are one, and so are faces with the same corners.

    What a file has opened for its texture is no seam of a program, and no place is there twice.
    """
    V, F = read_mesh(path)
    V, row = np.unique(V.astype(np.float64), axis=0, return_inverse=True)
    F = row.reshape(-1)[F]
    proper = (np.roll(F, 1, axis=1) != F).all(axis=1)
    _, first = np.unique(np.sort(F[proper], axis=1), axis=0, return_index=True)
    return V, F[np.flatnonzero(proper)[np.sort(first)]]


def examine(paths: Mapping[str, Path], request: Row) -> Row:
    """Let a program make charts of a surface, and measure them."""
    V, F = _surface(paths[request.surface])
    program: Callable[[Floats, Ints], Floats | SurfaceMap] = surface_map
    if request.program != OURS:
        ATLASES[request.program].prepare()
        program = ATLASES[request.program].function
    start = process_time()
    try:
        made = program(V, F)
    except TYPED as error:
        return replace(request, outcome=f"{LOST}: {error}"[:100], faces=len(F))
    seconds = process_time() - start
    uv = np.asarray(made.packed() if isinstance(made, SurfaceMap) else made, dtype=np.float64)
    found = certify(V, F, uv)
    area = face_areas(V, F).sum()
    x, y = np.moveaxis(uv[:, 1:] - uv[:, :1], 2, 0)
    seams, charts = seams_and_charts(V, F, uv)
    side = np.ptp(uv[np.isfinite(uv).all(axis=(1, 2))].reshape(-1, 2), axis=0).max()
    return replace(
        request,
        outcome=MAPPED,
        faces=len(F),
        charts=charts,
        seams=seams / np.sqrt(area),
        mean=found.angles.mean,
        least=least_distortion(made) if isinstance(made, SurfaceMap) else np.nan,
        texels=found.areas.texels,
        fill=float(np.nansum(abs(x[:, 0] * y[:, 1] - x[:, 1] * y[:, 0])) / 2 / side**2),
        valid=found.valid,
        seconds=seconds,
    )


def seams_and_charts(V: Floats, F: Ints, uv: Floats) -> tuple[float, int]:
    """Add up the edges whose faces lie apart in an atlas (m, 3, 2); count what hangs together.

    Whichever side of a face is up.
    """
    m = len(F)

    def ends(half: Ints) -> tuple[Ints, Floats]:
        face, corner = half % m, half // m
        both = np.stack([corner, (corner + 1) % 3])
        both = np.where(F[face, both[0]] < F[face, both[1]], both, both[::-1])
        return F[face, both], uv[face, both]

    here, there = Topology(F, len(V)).twins
    (vertices, one), (_, other) = ends(here), ends(there)
    apart = (one != other).any(axis=(0, 2))
    length = np.linalg.norm(V[vertices[0]] - V[vertices[1]], axis=1)[apart].sum()
    charts, _ = components_of_pairs(here[~apart] % m, there[~apart] % m, m)
    return float(length), charts


def least_distortion(result: SurfaceMap) -> float:
    """Bound the mean angular distortion from below by the angles around the vertices, in degrees.

    In the plane they are 2 pi around an interior vertex, and less than pi at a vertex of the
    convex polygon that a map onto the disk is. What they are on the surface beyond that, some
    corner has to change.
    """
    mapped = result.face_chart >= 0
    F, uv = result.cut.F[mapped], result.uv_cut
    V = np.zeros((len(result.cut.V), 3))
    V[:, : result.cut.V.shape[1]] = result.cut.V
    sums = np.bincount(F.ravel(), angles(V, F).ravel(), len(V))
    around = np.bincount(F.ravel(), abs(plane_angles(as_complex(uv), F)).ravel(), len(V))
    interior = abs(around - 2 * np.pi) < 1e-6
    is_disk = isinstance(result.charts[0], DiskMap)
    on_circle = is_disk & (np.hypot(*np.nan_to_num(uv).T) > 1 - 1e-9)
    excess = abs(sums - 2 * np.pi)[interior].sum()
    excess += np.maximum(sums - np.pi, 0)[on_circle & ~interior].sum()
    return float(np.degrees(excess) / F.size)


# -- what is told ----------------------------------------------------------------------


@entitled("surfaces")
def _summary(rows: Sequence[Row], programs: Sequence[str]) -> Content:
    """All programs.

    Medians over the surfaces that all of them have charts of, each with its default options. Valid:
    no face is flipped, and no place of the texture has two.
    """
    groups = [list(group) for _, group in groupby(rows, key=lambda row: row.surface)]
    made = [group for group in groups if all(row.outcome == MAPPED for row in group)] or groups
    table = []
    for k, program in enumerate(programs):
        own = [group[k] for group in made]
        every = [row for row in rows if row.program == program]
        middle = {name: float(np.median([getattr(row, name) for row in own])) for name in MEDIANS}
        table.append(
            [
                word(program),
                Cell(f"{sum(row.outcome == MAPPED for row in every)} of {len(every)}"),
                Cell(f"{sum(row.valid for row in every)}"),
                *(number(middle[name], form) for name, form in MEDIANS.items()),
                number(max(row.texels for row in own), ".3g"),
                number(sum(row.seconds for row in own), ".1f"),
            ]
        )
    return (
        *("program", "mapped", "valid", "charts", "seams", "mean °", "texels", "fill"),
        *("worst texels", "CPU s, all"),
    ), table


MEDIANS = {"charts": "g", "seams": ".2f", "mean": ".2f", "texels": ".2f", "fill": ".2f"}


@entitled("every surface")
def _details(rows: Sequence[Row]) -> Content:
    """Every surface.

    Seams: their length by the square root of the area. Mean: of angular distortion in degrees; no
    map with the seams of cdcp_igl can be below the least, by the angles around the vertices.
    Texels: how many times denser a texture is where 95 percent of the surface have less than where
    5 percent do. Fill: share of the square. Seconds of CPU, as all programs ran side by side.
    """
    table = []
    for row in rows:
        first = row.program == OURS
        table.append(
            [
                name(row.surface if first else ""),
                Cell(f"{row.faces:,}" if first else ""),
                word(row.program),
                Cell(f"{row.charts}") if row.outcome == MAPPED else Cell("–", note=row.outcome),
                number(row.seams, ".2f"),
                number(row.mean, ".2f"),
                number(row.least, ".2f"),
                number(row.texels, ".3g"),
                number(row.fill, ".2f"),
                Cell("yes" if row.valid else "no"),
                number(row.seconds, ".2f"),
            ]
        )
    return (
        *("surface", "faces", "program", "charts", "seams", "mean °", "least °", "texels"),
        *("fill", "valid", "CPU s"),
    ), table
