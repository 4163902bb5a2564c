"""``cdcp-igl compare``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..extras import from_extra
from .arguments import Inputs, target
from .messages import BAD_INPUT, SOME_FAILED, exit_codes, writing
from .progress import progress_bar

if TYPE_CHECKING:
    from ..plot.pictures import MapRow
    from ..reference.case import Case

__all__ = ["compare_command"]

# Those of `reference`, spelled out: `--help` shows them, and must not wait for NumPy.
METHODS = ("cdcp", "double_cover", "fdcp", "ldcp", "harmonic", "lscm", "spectral")


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
        Path | None,
        typer.Option("--json", metavar="R.json", callback=target(".json"), help="The numbers."),
    ] = None,
    csv_file: Annotated[
        Path | None,
        typer.Option("--csv", metavar="R.csv", callback=target(".csv"), help="The numbers."),
    ] = None,
    picture: Annotated[
        Path | None,
        typer.Option(
            metavar="P.png",
            callback=target(".png", ".svg", ".pdf"),
            help="The maps side by side, a row a mesh (.png .svg .pdf).",
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace files that are there.")] = False,
) -> None:
    """Compare methods on meshes: a table of distortion, flips, time and memory for each.

    Each method runs in a process of its own; one that fails has a row without numbers, and a line
    that says why. A mesh that is no disk is named, and left out.

    Exit codes: 0 all rows are there; 1 a file could not be written, or an extra is missing;
    2 bad input; 4 some meshes were left out.
    """
    from ..errors import printable
    from ..io import read_polygons, whole_file
    from ..io.output import try_to_write
    from ..io.polygons import naming_polygons
    from ..reference.case import run_case
    from ..surface.mesh import DiskMesh
    from .cases import print_cases, write_csv, write_json

    chosen = (methods or ",".join(METHODS)).split(",")
    meshes = list(dict.fromkeys(meshes))
    cases: dict[Path, list[Case]] = {}
    rows: list[MapRow] = []
    unprinted: list[BaseException] = []
    outputs = list(filter(None, (json_file, csv_file, picture)))
    with exit_codes(), writing():
        if picture:
            with from_extra("plot"):
                from ..plot import side_by_side
        for path in outputs:
            if path.exists() and not force:
                raise typer.BadParameter(f"{printable(path)} is there; --force replaces it.")
            try_to_write(path)
    for mesh in meshes:
        try:
            with exit_codes(mesh):
                V, F, whole = read_polygons(mesh)
                with naming_polygons(whole):
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
            if not outputs:
                raise
            unprinted.append(error)  # the files are still to be written
    if not cases:
        raise typer.Exit(BAD_INPUT)
    with writing():
        for target_file, write in ((json_file, write_json), (csv_file, write_csv)):
            if target_file:
                with whole_file(target_file) as unfinished:
                    write(unfinished, cases)
        if picture:
            with whole_file(picture) as unfinished:
                names = [printable(mesh.name) for mesh in cases]
                side_by_side(rows, names=names).savefig(unfinished)
    if unprinted:
        raise unprinted[0]
    if len(cases) < len(meshes):
        raise typer.Exit(SOME_FAILED)
