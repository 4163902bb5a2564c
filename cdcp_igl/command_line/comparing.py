"""``cdcp-igl compare``."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..extras import from_extra
from .messages import BAD_INPUT, SOME_FAILED, check_targets, exit_codes, writing
from .options import PICTURES, Force, Inputs, file_option
from .screen import print_table, progress_bar

if TYPE_CHECKING:
    from ..plot.pictures import MapRow
    from ..reference.case import Case

# Those of `reference`, spelled out: `--help` shows them, and must not wait for NumPy.
METHODS = ("cdcp", "double_cover", "fdcp", "ldcp", "harmonic", "lscm", "spectral")
HEADINGS = ("method", "mean °", "SD °", "max °", "area", "flips", "boundary", "s", "MiB")
FORMATS = {
    "mean": ".3f",
    "sd": ".3f",
    "max": ".1f",
    "area": ".3f",
    "flips": ",.0f",
    "boundary_error": ".0e",
    "seconds": ".2f",
    "memory": ",.0f",
}


def _methods(text: str | None) -> str | None:
    unknown = [name for name in (text or "cdcp").split(",") if name not in METHODS]
    if unknown:
        raise typer.BadParameter(f"{unknown[0]!r} is not one of {', '.join(METHODS)}.")
    return text


def compare_command(
    meshes: Inputs,
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
        Path | None, file_option("--json", "R.json", (".json",), "The numbers.")
    ] = None,
    csv_file: Annotated[
        Path | None, file_option("--csv", "R.csv", (".csv",), "The numbers.")
    ] = None,
    picture: Annotated[
        Path | None,
        file_option(
            *("--picture", "P.png", PICTURES),
            help="The maps side by side, a row a mesh (.png .svg .pdf).",
        ),
    ] = None,
    force: Force = False,
) -> None:
    """Compare methods on meshes: a table of distortion, flips, time and memory for each.

    Each method runs in a process of its own; one that fails has a row without numbers, and a line
    that says why. A mesh that is no disk is named, and left out.

    Exit codes: 0 all rows are there; 1 a file could not be written, or an extra is missing;
    2 bad input; 4 some meshes were left out.
    """
    from ..errors import printable
    from ..io import read_polygons
    from ..io.output import whole_file
    from ..io.polygons import naming_polygons
    from ..reference.case import run_case
    from ..surface.mesh import DiskMesh

    chosen = (methods or ",".join(METHODS)).split(",")
    meshes = list(dict.fromkeys(meshes))
    cases: dict[Path, list[Case]] = {}
    rows: list[MapRow] = []
    unprinted: list[BaseException] = []
    with exit_codes():
        if picture:
            with from_extra("plot"):
                from ..plot import side_by_side
        check_targets((json_file, csv_file, picture), meshes, force)
    for mesh in meshes:
        try:
            with exit_codes(mesh):
                V, F, polygon_of_face = read_polygons(mesh)
                with naming_polygons(polygon_of_face):
                    DiskMesh(V, F)
        except typer.Exit:
            continue  # and the message has been printed
        made = []
        with writing(), progress_bar() as progress:  # what each process is given is a file
            for done, method in enumerate(chosen):
                progress(method, done / len(chosen))
                made.append(run_case(method, V, F, time_limit=time_limit))
        cases[mesh] = [case for case, _ in made]
        rows.append((V, F, [(case.method, case.mean, uv) for case, uv in made]))
        try:
            print_cases(f"{printable(mesh)}: {len(V):,} vertices", cases[mesh])
        except (OSError, SystemExit) as error:  # Rich exits where nobody reads from a pipe
            if not (json_file or csv_file or picture):
                raise
            unprinted.append(error)  # the files are still to be written
    if not cases:
        raise typer.Exit(BAD_INPUT)
    with writing():
        for path, write in ((json_file, _write_json), (csv_file, _write_csv)):
            if path:
                with whole_file(path) as unfinished:
                    write(unfinished, cases)
        if picture:
            with whole_file(picture) as unfinished:
                names = [printable(mesh.name) for mesh in cases]
                side_by_side(rows, names=names).savefig(unfinished)
    if unprinted:
        raise unprinted[0]
    if len(cases) < len(meshes):
        raise typer.Exit(SOME_FAILED)


def print_cases(title: str, cases: Sequence[Case]) -> None:
    """Print a row a method, and below why one has no map."""
    print_table(
        title,
        HEADINGS,
        [[case.method + " *" * _is_free(case), *_numbers(case)] for case in cases],
    )
    if any(map(_is_free, cases)):
        typer.echo("* no disk: a map with free boundary; compare it on angles only")
    for case in cases:
        if case.outcome != "ok":
            typer.echo(f"{case.method}: {case.outcome}")


def _is_free(case: Case) -> bool:
    return case.boundary == "free" and case.outcome == "ok"


def _numbers(case: Case) -> list[str]:
    row = case.as_json()
    if case.boundary == "free":
        row["boundary_error"] = None
    return ["–" if row[name] is None else format(row[name], form) for name, form in FORMATS.items()]


def _write_json(path: Path, cases: Mapping[Path, Sequence[Case]]) -> None:
    """Write a list of objects, one a case, null where there is no number."""
    path.write_text(json.dumps(_rows(cases), indent=2, ensure_ascii=False) + "\n", encoding="utf-8")


def _write_csv(path: Path, cases: Mapping[Path, Sequence[Case]]) -> None:
    """Write one line a case, empty where there is no number."""
    rows = _rows(cases)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)


def _rows(cases: Mapping[Path, Sequence[Case]]) -> list[dict[str, object]]:
    from ..errors import printable

    return [
        {"mesh": printable(mesh), **case.as_json()} for mesh, made in cases.items() for case in made
    ]
