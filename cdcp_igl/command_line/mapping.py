"""``cdcp-igl map``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from ..extras import from_extra
from .arguments import WRITABLE, Input, Quiet, target
from .map_options import (
    Align,
    Center,
    Mobius,
    Preset,
    Refine,
    RefineNorm,
    RefineSeconds,
    chosen_options,
)
from .messages import exit_codes, show, writing
from .progress import progress_bar

__all__ = ["map_command"]

MAPPED = 0.8  # of the progress, when the map is computed


def map_command(
    mesh: Input,
    out: Annotated[
        Path,
        typer.Argument(
            metavar="OUT",
            callback=target(*WRITABLE),
            help="The map: texture coordinates (.obj .ply), or V, F and uv (.npz).",
        ),
    ],
    clean_first: Annotated[
        bool,
        typer.Option(
            "--clean",
            help="Mend the surface first and say how: merge equal vertices, drop bad faces, "
            "orient, keep the largest component, fill holes. OUT has what is left of IN, in its "
            "order, without the filling.",
        ),
    ] = False,
    disk: Annotated[
        bool,
        typer.Option("--disk", help="Texture coordinates in the unit disk, not in [0, 1]^2."),
    ] = False,
    center: Center = None,
    mobius: Mobius = None,
    align: Align = None,
    refine: Refine = 0,
    refine_norm: RefineNorm = None,
    refine_seconds: RefineSeconds = None,
    preset: Preset = None,
    report: Annotated[
        Path | None,
        typer.Option(
            metavar="R.json", callback=target(".json"), help="Certificate, distortion, timings."
        ),
    ] = None,
    picture: Annotated[
        Path | None,
        typer.Option(
            metavar="P.png",
            callback=target(".png"),
            help="Surface, disk and histogram of the angular distortion.",
        ),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Map a triangulated disk conformally onto the unit disk.

    Files appear whole or not at all, and only if the map is valid.

    Exit codes: 0 a valid map; 1 a file could not be written, or an extra is missing;
    2 bad input; 3 no valid map.
    """
    options = chosen_options(center, mobius, align, refine, refine_norm, refine_seconds, preset)

    from ..algorithm import disk_map
    from ..io import read_mesh, whole_file, write_map
    from ..surface.cleaning import clean

    notes: list[str] = []
    with exit_codes(), progress_bar() as progress:
        if picture:
            with from_extra("plot"):
                from ..plot import picture as draw
        progress("read", 0)
        V, F = read_mesh(mesh, notes.append)
        n, m = len(V), len(F)
        if clean_first:
            V, F, vertex_index, face_index = cleaned = clean(V, F)
            notes += cleaned.changes
            n, m = int((vertex_index >= 0).sum()), int((face_index >= 0).sum())
            if m < len(F):
                notes.append(f"The filling is not in {out.name}.")
        result = disk_map(
            V, F, **options, progress=lambda phase, done: progress(phase, MAPPED * done)
        )
        with writing():
            if picture:
                progress("draw", MAPPED)
                figure = draw(V, F, result, name=mesh.name)
                with whole_file(picture) as unfinished:
                    figure.savefig(unfinished)
            progress("write", 0.9)
            if report:
                with whole_file(report) as unfinished:
                    unfinished.write_text(json.dumps(result.report(), indent=2) + "\n")
            write_map(out, V[:n], F[:m], result.uv[:n], disk=disk)  # the filling comes last
    if not quiet:
        show(str(result), notes, "green")
