"""``cdcp-igl compare``."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from .messages import BAD_INPUT, SOME_FAILED, check_targets, exit_codes, writing
from .options import FORCE, INPUTS, PICTURES, file_option
from .screen import progress_bar

if TYPE_CHECKING:
    from ..reference.comparison import Comparison

# Those of `reference`, spelled out: `--help` shows them, and must not wait for NumPy.
METHODS = (
    *("cdcp", "double_cover", "fdcp", "ldcp", "cem", "heat_flow", "ricci", "pgcp", "sem"),
    *("harmonic", "abf", "lscm", "spectral", "bff", "bff_disk", "arap", "slim"),
    *("sphere", "flash"),
)


def compare_command(
    meshes: list[Path] = INPUTS,
    methods: str | None = typer.Option(
        None,
        metavar="NAME,...",
        help=f"Of {', '.join(METHODS)}. [default: all that map the surface]",
    ),
    time_limit: float = typer.Option(
        600, metavar="SECONDS", min=0, help="For each method on each mesh."
    ),
    json_file: Path | None = file_option("--json", "R.json", (".json",), "The numbers."),
    csv_file: Path | None = file_option("--csv", "R.csv", (".csv",), "The numbers."),
    picture: Path | None = file_option(
        "--picture", "P.png", PICTURES, "The maps side by side, a row a mesh (.png .svg .pdf)."
    ),
    view: Path | None = file_option(
        *("--view", "V.html", (".html",)),
        help="The maps of one mesh, each beside the disk map and the turning surface.",
    ),
    force: bool = FORCE,
) -> None:
    """Compare methods on meshes: a table of distortion, validity, time and memory for each.

    Each method runs in a process of its own; one that fails has a row without numbers, and a line
    that says why. A closed surface of genus 0 is mapped onto the sphere by sphere and flash, and
    cut open for the others. Any other mesh that is no disk is named, and left out.

    Exit codes: 0 all rows are there; 1 a file could not be written, or an extra is missing;
    2 bad input; 4 some meshes were left out.
    """
    from ..defects import as_commands
    from ..errors import printable
    from ..reference.comparison import compare

    chosen = [name.strip() for name in methods.split(",")] if methods else []
    if unknown := [name for name in chosen if name not in METHODS]:
        raise typer.BadParameter(f"{unknown[0]!r} is not one of {', '.join(METHODS)}.")
    meshes = list(dict.fromkeys(meshes))
    if view and len(meshes) > 1:
        raise typer.BadParameter("--view is for one mesh.")
    files = json_file, csv_file, picture, view
    with exit_codes():
        check_targets(files, meshes, force)
    compared: dict[Path, Comparison] = {}
    unprinted: list[BaseException] = []
    for mesh in meshes:
        try:
            with exit_codes(mesh), progress_bar() as progress:
                found = compare(mesh, chosen or None, time_limit=time_limit, progress=progress)
        except typer.Exit:
            continue  # and the message has been printed
        compared[mesh] = found
        try:
            typer.echo(f"{printable(mesh)}: {as_commands(str(found))}")
        except OSError as error:  # nobody reads from a pipe
            if not any(files):
                raise
            unprinted.append(error)  # the files are still to be written
    if not compared:
        raise typer.Exit(BAD_INPUT)
    with writing():
        _write(compared, json_file, csv_file, picture)
    if view:
        with exit_codes(meshes[0]), writing():
            compared[meshes[0]].view(view, title=printable(meshes[0].name))
    if unprinted:
        raise unprinted[0]
    if len(compared) < len(meshes):
        raise typer.Exit(SOME_FAILED)


def _write(
    compared: Mapping[Path, Comparison],
    json_file: Path | None,
    csv_file: Path | None,
    picture: Path | None,
) -> None:
    """Write the numbers, a row a case, and draw the maps side by side, a row a surface."""
    from ..errors import printable
    from ..io.output import whole_file, write_table, write_text

    table = [
        {"mesh": printable(mesh), **row}
        for mesh, found in compared.items()
        for row in found.to_dict().values()
    ]
    if json_file:
        write_text(json_file, json.dumps(table, indent=2, ensure_ascii=False) + "\n")
    if csv_file:
        write_table(csv_file, table[0], table)
    if picture:
        from ..plot import side_by_side

        rows = [(mesh, row) for mesh, found in compared.items() for row in found.rows()]
        names = [printable(mesh.name) for mesh, _ in rows]
        with whole_file(picture) as unfinished:
            side_by_side([row for _, row in rows], names=names).savefig(unfinished)
