"""``cdcp-igl certify``."""

from __future__ import annotations

import json
from pathlib import Path

import typer

from .messages import BAD_INPUT, NO_MAP, exit_codes
from .options import TEXTURED
from .screen import show_text

MAPS = typer.Argument(
    metavar="IN...", help=f"Surfaces with texture coordinates ({' '.join(TEXTURED)})."
)


def certify_command(
    meshes: list[Path] = MAPS,
    as_json: bool = typer.Option(False, "--json", help="Print a list of objects, one a file."),
) -> None:
    """Verify texture coordinates, whoever made them: flipped faces, overlaps, distortion.

    Exit codes: 0 all are valid, 3 one is not valid, 2 one is not readable or has none.
    """
    from ..errors import printable
    from ..io.texture import read_texture
    from ..verdict.any_map import certify

    rows, code = [], 0
    for mesh in meshes:
        try:
            with exit_codes(mesh):
                found = certify(*read_texture(mesh))
        except typer.Exit:
            code = BAD_INPUT
            continue  # and the message has been printed
        rows.append({"file": printable(mesh), **found.report()})
        code = code or (0 if found.valid else NO_MAP)
        if not as_json:
            name = f"{printable(mesh)}: " if len(meshes) > 1 else ""
            show_text(f"{name}{found}", "green" if found.valid else "red")
    if as_json:
        typer.echo(json.dumps(rows, indent=2))
    if code:
        raise typer.Exit(code)
