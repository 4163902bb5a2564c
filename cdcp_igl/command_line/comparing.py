"""``cdcp-igl compare``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..extras import from_extra
from .arguments import READABLE, target
from .messages import exit_codes, writing
from .progress import progress_bar

if TYPE_CHECKING:
    from ..plot import MapRow
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
        typer.Option("--json", metavar="R.json", callback=target(".json"), help="The numbers."),
    ] = None,
    csv_file: Annotated[
        Path | None,
        typer.Option("--csv", metavar="R.csv", callback=target(".csv"), help="The numbers."),
    ] = None,
    picture: Annotated[
        Path | None,
        typer.Option(
            metavar="P.png", callback=target(".png"), help="The maps side by side, a row a mesh."
        ),
    ] = None,
) -> None:
    """Compare methods on meshes: a table of distortion, flips, time and memory for each.

    Each method runs in a process of its own; one that fails has a row that says so.

    Exit codes: 0 all rows are there; 1 a file could not be written, or an extra is missing;
    2 bad input.
    """
    from rich.console import Console

    from ..io import read_mesh, whole_file
    from ..reference.case import run_case
    from ..surface.mesh import DiskMesh
    from .tables import table, write_csv, write_json

    names = (methods or ",".join(METHODS)).split(",")
    cases: dict[str, list[Case]] = {}
    rows: list[MapRow] = []
    with exit_codes():
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
    with writing():
        for target, write in ((json_file, write_json), (csv_file, write_csv)):
            if target:
                with whole_file(target) as unfinished:
                    write(unfinished, cases)
        if picture:
            with whole_file(picture) as unfinished:
                side_by_side(rows).savefig(unfinished)
