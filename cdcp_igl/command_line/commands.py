"""The commands of ``cdcp-igl``."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from .. import __version__
from ..algorithm import disk_map
from ..errors import MapError, MeshError, SolverError
from ..extras import MissingExtra, from_extra
from ..io import READABLE, WRITABLE, read_mesh, whole_file, write_map
from ..reference import METHODS
from ..reference.case import Case, run_case
from ..surface.cleaning import clean
from ..surface.mesh import DiskMesh
from ..surface.report import check
from .progress import progress_bar
from .tables import table, write_csv, write_json

if TYPE_CHECKING:
    from ..plot import MapRow

__all__ = ["app"]

FAILED, BAD_INPUT, NO_MAP = 1, 2, 3  # exit codes
MAPPED = 0.8  # of the progress, when the map is computed

app = typer.Typer(
    add_completion=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


class Mobius(StrEnum):
    """Values of --mobius."""

    angle = "angle"
    area = "area"
    none = "none"


class Preset(StrEnum):
    """Values of --preset."""

    paper = "paper"


def _target(*suffixes: str) -> Callable[[Path | None], Path | None]:
    """Make a check that a file of one of these types can be put where it is wanted."""

    def verify(path: Path | None) -> Path | None:
        if path is None:
            return None
        if path.suffix.lower() not in suffixes:
            raise typer.BadParameter(f"{path.name!r} must end in {' or '.join(suffixes)}.")
        if not path.parent.is_dir():
            raise typer.BadParameter(f"there is no folder {str(path.parent)!r}.")
        if path.is_dir():
            raise typer.BadParameter(f"{str(path)!r} is a folder.")
        return path

    return verify


def _center(text: str | None) -> str | int | None:
    if text is None or text in ("torsion", "heat", "centroid"):
        return text
    if not text.isdecimal():
        raise typer.BadParameter("must be torsion, heat, centroid or a face counted from 0.")
    return int(text)


def _methods(text: str | None) -> str | None:
    unknown = [name for name in (text or "cdcp").split(",") if name not in METHODS]
    if unknown:
        raise typer.BadParameter(f"{unknown[0]!r} is not one of {', '.join(METHODS)}.")
    return text


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"cdcp-igl {__version__}")
        raise typer.Exit


Input = Annotated[
    Path, typer.Argument(metavar="IN", help=f"Triangulated surface ({' '.join(READABLE)}).")
]


@app.callback()
def cdcp_igl(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version."),
    ] = False,
) -> None:
    """Disk conformal maps of triangulated surfaces: accurate, fast, certified."""


@app.command("check")
def check_command(mesh: Input) -> None:
    """Report every defect of a mesh.

    Exit codes: 0 a disk, 2 not a disk or not readable.
    """
    notes: list[str] = []
    with _exit_codes():
        V, F = read_mesh(mesh, notes.append)
    report = check(V, F)
    _show(str(report), notes, "green" if report.is_disk else "red")
    if not report.is_disk:
        raise typer.Exit(BAD_INPUT)


@app.command("map")
def map_command(
    mesh: Input,
    out: Annotated[
        Path,
        typer.Argument(
            metavar="OUT",
            callback=_target(*WRITABLE),
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
    center: Annotated[
        str | None,
        typer.Option(
            metavar="torsion|heat|centroid|FACE",
            callback=_center,
            help="The face that carries the dipole, or how to find it. [default: torsion]",
        ),
    ] = None,
    mobius: Annotated[
        Mobius | None,
        typer.Option(help="What the Möbius transformation minimises. [default: angle]"),
    ] = None,
    refine: Annotated[
        int,
        typer.Option(metavar="N", min=0, help="Steps of refinement after the harmonic map."),
    ] = 0,
    refine_seconds: Annotated[
        float | None,
        typer.Option(metavar="S", min=0, help="Begin no step of refinement after S seconds."),
    ] = None,
    preset: Annotated[
        Preset | None, typer.Option(help="Follow the paper; sets --center and --mobius itself.")
    ] = None,
    report: Annotated[
        Path | None,
        typer.Option(
            metavar="R.json", callback=_target(".json"), help="Certificate, distortion, timings."
        ),
    ] = None,
    picture: Annotated[
        Path | None,
        typer.Option(
            metavar="P.png",
            callback=_target(".png"),
            help="Surface, disk and histogram of the angular distortion.",
        ),
    ] = None,
) -> None:
    """Map a triangulated disk conformally onto the unit disk.

    Files appear whole or not at all, and only if the map is valid.

    Exit codes: 0 a valid map; 1 a file could not be written, or an extra is missing;
    2 bad input; 3 no valid map.
    """
    if preset and (center, mobius) != (None, None):
        raise typer.BadParameter("--preset paper sets --center and --mobius itself.")
    given = {"center": center, "mobius": mobius, "preset": preset}
    options: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    if mobius is Mobius.none:
        options["mobius"] = None
    if refine:
        options["refine"] = refine
    if refine_seconds is not None:
        options["refine_seconds"] = refine_seconds

    notes: list[str] = []
    with _exit_codes(), progress_bar() as progress:
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
        if isinstance(center, int) and center >= len(F):
            raise typer.BadParameter(f"--center {center}: the mesh has {len(F):,} faces.")
        result = disk_map(
            V, F, **options, progress=lambda phase, done: progress(phase, MAPPED * done)
        )
        with _writing():
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
    _show(str(result), notes, "green")


@app.command("compare")
def compare_command(
    meshes: Annotated[
        list[Path],
        typer.Argument(metavar="IN...", help=f"Triangulated surfaces ({' '.join(READABLE)})."),
    ],
    methods: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,...",
            callback=_methods,
            help=f"Of {', '.join(METHODS)}. [default: all of them]",
        ),
    ] = None,
    time_limit: Annotated[
        float, typer.Option(metavar="SECONDS", min=0, help="For each method on each mesh.")
    ] = 600,
    json_file: Annotated[
        Path | None,
        typer.Option("--json", metavar="R.json", callback=_target(".json"), help="The numbers."),
    ] = None,
    csv_file: Annotated[
        Path | None,
        typer.Option("--csv", metavar="R.csv", callback=_target(".csv"), help="The numbers."),
    ] = None,
    picture: Annotated[
        Path | None,
        typer.Option(
            metavar="P.png", callback=_target(".png"), help="The maps side by side, a row a mesh."
        ),
    ] = None,
) -> None:
    """Compare methods on meshes: a table of distortion, flips, time and memory for each.

    Each method runs in a process of its own; one that fails has a row that says so.

    Exit codes: 0 all rows are there; 1 a file could not be written, or an extra is missing;
    2 bad input.
    """
    names = (methods or ",".join(METHODS)).split(",")
    cases: dict[str, list[Case]] = {}
    rows: list[MapRow] = []
    with _exit_codes():
        if picture:
            with from_extra("plot"):
                from ..plot import side_by_side
        surfaces = {str(path): read_mesh(path) for path in meshes}
        for V, F in surfaces.values():
            DiskMesh(V, F)
    for mesh, (V, F) in surfaces.items():
        made = []
        with progress_bar() as progress:
            for done, name in enumerate(names):
                progress(name, done / len(names))
                made.append(run_case(name, V, F, time_limit=time_limit))
        cases[mesh] = [case for case, _ in made]
        rows.append((V, F, [(case.method, case.mean, uv) for case, uv in made]))
        width = None if sys.stdout.isatty() else 120
        Console(width=width).print(table(f"{mesh}: {len(V):,} vertices", cases[mesh]))
    with _writing():
        for target, write in ((json_file, write_json), (csv_file, write_csv)):
            if target:
                with whole_file(target) as unfinished:
                    write(unfinished, cases)
        if picture:
            with whole_file(picture) as unfinished:
                side_by_side(rows).savefig(unfinished)


@contextmanager
def _writing() -> Iterator[None]:
    """Say which file could not be written."""
    try:
        yield
    except OSError as error:
        typer.echo(f"Not written: {_reason(error)}", err=True)
        raise typer.Exit(FAILED) from error


@contextmanager
def _exit_codes() -> Iterator[None]:
    """Turn the errors that users can mend into a message and an exit code."""
    try:
        yield
    except MeshError as error:
        message, code = "\n".join(f"{defect.name}: {defect}" for defect in error.defects), BAD_INPUT
    except OSError as error:
        message, code = _reason(error), BAD_INPUT
    except (MapError, SolverError) as error:
        message, code = str(error), NO_MAP
    except MissingExtra as error:
        message, code = str(error), FAILED
    else:
        return
    typer.echo(message, err=True)
    raise typer.Exit(code)


def _reason(error: OSError) -> str:
    return f"{error.filename}: {error.strerror}" if error.filename else str(error)


def _show(summary: str, notes: list[str], color: str) -> None:
    """Print a result: in a panel on a terminal, plain in a pipe."""
    title, *lines = [*summary.splitlines(), *(f"  note                {note}" for note in notes)]
    if not sys.stdout.isatty():
        typer.echo("\n".join([title, *lines]))
        return
    table = Table.grid(padding=(0, 2))
    for line in lines:
        table.add_row(*map(Text, re.split("  +", line.strip(), maxsplit=1)))
    Console().print(Panel(table, title=Text(title, "bold"), border_style=color, expand=False))
