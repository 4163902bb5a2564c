"""``cdcp-igl map``."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..extras import from_extra
from .arguments import READABLE, WRITABLE, Quiet, target
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
from .messages import BAD_INPUT, SOME_FAILED, exit_codes, show, writing
from .progress import progress_bar

if TYPE_CHECKING:
    from ..atlas.surface import SurfaceMap
    from ..one_file import Mapped, Settings
    from ..result.disk_map import DiskMap

__all__ = ["map_command"]

MAPPED = 0.8  # of the progress, when the map is computed


def map_command(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="IN OUT",
            help=f"The surface ({' '.join(READABLE)}), and the map: texture coordinates "
            "(.obj .ply .glb), or V, F and uv (.npz). With --out-dir, surfaces only.",
        ),
    ],
    out_dir: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Map all files named, each to its name in this folder; what cannot be written "
            "in its own type as .obj.",
        ),
    ] = None,
    force: Annotated[
        bool,
        typer.Option("--force", help="Replace files that are there."),
    ] = False,
    clean: Annotated[
        bool,
        typer.Option(
            "--clean",
            help="Mend the surface first and say how: merge equal vertices, drop bad faces, "
            "orient, keep the largest component, fill holes. OUT has what is left of IN, in its "
            "order, without the filling.",
        ),
    ] = False,
    cut: Annotated[
        bool,
        typer.Option(
            "--cut",
            help="Map a surface that is no disk: closed, with handles, holes or several parts. It "
            "is cut open, and each part mapped; texture coordinates show the disks side by side.",
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
            callback=target(".png", ".svg", ".pdf"),
            help="Surface, disk or disks, and the angular distortion (.png .svg .pdf).",
        ),
    ] = None,
    view: Annotated[
        Path | None,
        typer.Option(
            metavar="V.html",
            callback=target(".html"),
            help="A page in which the surface turns beside the disk.",
        ),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Map a triangulated disk conformally onto the unit disk.

    Files appear whole or not at all, and only if the map is valid. A file that is there already
    is replaced only with --force, the surface itself never.

    Exit codes: 0 a valid map; 1 a file could not be written, or an extra is missing;
    2 bad input; 3 no valid map; 4 with --out-dir, some have failed.
    """
    options = chosen_options(center, mobius, align, refine, refine_norm, refine_seconds, preset)
    pairs = _pairs(files, out_dir)
    if len(pairs) > 1 and (report or picture or view):
        raise typer.BadParameter("--report, --picture and --view are for one surface.")
    from ..one_file import Settings

    with exit_codes():
        jobs = [
            _Job(
                *(source, out, report, picture, view),
                Settings(out.suffix[1:].lower(), disk, clean, cut, options),
                force,
            )
            for source, out in pairs
        ]
    failed = 0
    for job in jobs:
        try:
            with exit_codes(job.source if len(pairs) > 1 else None):
                result, notes = job.run()
            if not quiet:
                show(str(result), notes, "green")
        except typer.Exit:
            if not out_dir:
                raise
            failed += 1
    if failed:
        typer.echo(f"{failed} of {len(pairs)} surfaces are not mapped", err=True)
        raise typer.Exit(SOME_FAILED)


def _pairs(files: list[Path], out_dir: Path | None) -> list[tuple[Path, Path]]:
    """Return each surface with the file to write."""
    if not out_dir:
        if len(files) != 2:
            raise typer.BadParameter("give IN and OUT; several surfaces need --out-dir DIR.")
        source, out = files
        target(*WRITABLE)(out)
        return [(source, out)]
    from ..batching.names import located, result_names

    surfaces = {located(file): file for file in files}  # each once
    pairs = []
    for source, name in zip(surfaces.values(), result_names(list(surfaces)), strict=True):
        suffix = source.suffix if source.suffix.lower() in WRITABLE else ".obj"
        pairs.append((source, out_dir / f"{name}{suffix}"))
    return pairs


@dataclass(frozen=True)
class _Job:
    """One surface, and what is to be written of it."""

    source: Path
    out: Path
    report: Path | None
    picture: Path | None
    view: Path | None
    settings: Settings
    force: bool

    def run(self) -> tuple[DiskMap | SurfaceMap, list[str]]:
        """Map the surface; typer.Exit, with its code, if something is wrong."""
        from ..io import read_polygons, whole_file
        from ..one_file import map_one

        notes: list[str] = []
        self._check_targets()
        with progress_bar() as progress:
            progress("read", 0)
            surface = read_polygons(self.source, notes.append)
            mapped = map_one(
                *surface, self.settings, lambda phase, done: progress(phase, MAPPED * done)
            )
            with writing():
                progress("draw", MAPPED)
                self._draw(mapped)
                progress("write", 0.9)
                if self.report:
                    report = json.dumps(mapped.report(), indent=2)
                    with whole_file(self.report) as unfinished:
                        unfinished.write_text(f"{report}\n", encoding="utf-8")
                mapped.write(self.out, self.source, self.settings)
        if not self.settings.cut:  # the summary of a surface that was cut has them
            notes += mapped.changes
        return mapped.result, notes

    def _check_targets(self) -> None:
        """Know before the map whether everything can be written afterwards."""
        from ..io.output import try_to_write

        if self.picture or self.view:
            with from_extra("plot"):
                import matplotlib  # noqa: F401

        for path in filter(None, (self.out, self.report, self.picture, self.view)):
            with writing():
                path.parent.mkdir(parents=True, exist_ok=True)
            with writing():
                self._check_what_is_there(path)
                try_to_write(path)

    def _check_what_is_there(self, path: Path) -> None:
        """Refuse to replace a file, unless that is asked for, and the surface itself."""
        from ..errors import printable

        if not os.path.isfile(path):  # and no error where a name is too long to be one
            return
        if os.path.exists(self.source) and path.samefile(self.source):
            message = f"{printable(path)} is the surface itself; give the result another place."
        elif not self.force:
            message = f"{printable(path)} is there; --force replaces it."
        else:
            return
        typer.echo(message, err=True)
        raise typer.Exit(BAD_INPUT)

    def _draw(self, mapped: Mapped) -> None:
        """Draw the picture and the page."""
        from ..errors import printable
        from ..io import whole_file

        name = printable(self.source.name)
        if self.picture:
            figure = mapped.result.plot(name=name)[0].figure
            with whole_file(self.picture) as unfinished:
                figure.savefig(unfinished)
        if self.view:
            with whole_file(self.view) as unfinished:
                unfinished.write_text(mapped.result.view_html(title=name), encoding="utf-8")
