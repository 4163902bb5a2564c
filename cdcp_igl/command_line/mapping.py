"""``cdcp-igl map``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import typer

from .batches import SCHEDULER, run_batch
from .messages import check_targets, exit_codes, logged, writing
from .options import (
    FORCE,
    PICTURES,
    QUIET,
    SURFACES,
    WRITABLE,
    file_option,
    takes_map_options,
    verify_target,
)
from .parts import is_parted, map_parts
from .screen import progress_bar, show_pairs

MAPPED = 0.8  # of the progress, when the map is computed


@takes_map_options
def map_command(
    options: dict[str, Any],
    files: list[Path] = typer.Argument(
        metavar="IN OUT",
        help=f"The surface ({SURFACES}), and the map: texture coordinates "
        "(.obj .ply .glb), or V, F and uv (.npz). With --out-dir, surfaces only.",
    ),
    out_dir: Path | None = typer.Option(
        None,
        metavar="DIR",
        help="Map all files named, as `batch` does, each to its name in this folder; what cannot "
        "be written in its own type as .obj.",
    ),
    force: bool = FORCE,
    report: Path | None = file_option(
        "--report", "R.json", (".json",), "Certificate, distortion, timings."
    ),
    picture: Path | None = file_option(
        *("--picture", "P.png", PICTURES),
        help="Surface, its image, and the angular distortion (.png .svg .pdf).",
    ),
    view: Path | None = file_option(
        "--view", "V.html", (".html",), "A page in which the surface turns beside its image."
    ),
    pattern: Path | None = file_option(
        *("--pattern", "P.svg", (".svg", ".dxf")),
        help="With --free or --cut, a pattern to cut, true to scale: outlines, and numbers where "
        "edges meet (.svg .dxf).",
    ),
    unit: str = typer.Option(
        "mm", metavar="mm|cm|m|in|ft", help="With --pattern, the unit of the surface."
    ),
    jobs: int | None = typer.Option(
        None, "--jobs", "-j", metavar="N", min=1, help="Processes for a surface in parts."
    ),
    scheduler: str | None = SCHEDULER,
    quiet: bool = QUIET,
) -> None:
    """Map a triangulated disk conformally onto the unit disk.

    Other surfaces take --cut, --sphere or --annulus; `check` says which. A disk goes elsewhere by
    --free or --rectangle.

    A folder that `partition` has made is mapped in parts, to OUT.npy: u and v of each vertex. Run
    again, it goes on where it was.

    Files appear whole or not at all, and only if the map is valid. A file that is there already
    is replaced only with --force, the surface itself never.

    Exit codes: 0 a valid map; 1 a file could not be written, or an extra is missing;
    2 bad input; 3 no valid map; 4 with --out-dir, some have failed.
    """
    if out_dir:
        if report or picture or view or pattern:
            raise typer.BadParameter(
                "--report, --picture, --view and --pattern are for one surface."
            )
        run_batch(files, out_dir, quiet=quiet, format="same", force=force, **options)
        return
    onto_disks = options["disk"] or options.get("outline") == "disk"
    if pattern and not options["free"] and (onto_disks or not options["cut"]):
        raise typer.BadParameter("--pattern needs --free or --cut, and no disks.")
    if len(files) != 2:
        raise typer.BadParameter("give IN and OUT; several surfaces need --out-dir DIR.")
    source, out = files
    if is_parted(source):
        targets = report, picture, view
        where = jobs, scheduler
        map_parts(source, out, targets, options, where, force=force, quiet=quiet)
        return
    if jobs or scheduler:
        raise typer.BadParameter("--jobs and --scheduler are for a surface in parts.")
    from ..defects import as_commands
    from ..errors import printable
    from ..io import read_polygons
    from ..io.neuro import neuro_type
    from ..io.output import whole_file, write_text
    from ..io.patterns import UNITS
    from ..scale.one_file import NAMES, Settings, map_one

    if unit not in UNITS:
        raise typer.BadParameter(f"--unit takes {', '.join(UNITS)}, not {unit!r}.")
    writable = (".glb", ".obj") if options["bake"] else WRITABLE
    verify_target(out, (out.suffix.lower(),) if neuro_type(out) else writable)
    name, notes = printable(source.name), list[str]()
    tried = [f"--{flag}" for flag in ("clean", "cut") if options[flag]]
    with exit_codes(files=files, tried=tried):
        flags = {flag: options.pop(flag) for flag in NAMES}
        settings = Settings(**flags, options=options)
        check_targets((out, report, picture, view, pattern), [source], force)
        with progress_bar() as progress:
            progress("read", 0)
            surface = read_polygons(source, notes.append)
            mapped = map_one(
                *(*surface, settings),
                lambda phase, done: progress(phase, MAPPED * done),
                source=source,
            )
            with writing():
                progress("draw", MAPPED)
                if picture:
                    figure = mapped.result.plot(name=name)[0].figure
                    with whole_file(picture) as unfinished:
                        figure.savefig(unfinished)
                if view:
                    mapped.result.view(view, title=name)
                progress("write", 0.9)
                drawn = mapped.result.pattern(pattern, unit=unit) if pattern else None
                if report:
                    more = {"pattern": drawn.report()} if drawn else {}
                    write_text(report, json.dumps(mapped.report() | more, indent=2) + "\n")
                with logged(notes):
                    mapped.write(out, source, settings)
    if not quiet:
        title, pairs = mapped.result.summary()
        said = [text for _, text in pairs]  # by a surface that was cut
        notes += [change for change in mapped.changes if change not in said]
        pairs = [(heading, as_commands(text)) for heading, text in pairs]
        pairs += [("pattern", str(drawn))] if drawn else []
        show_pairs(title, [*pairs, *(("note", note) for note in notes)])
