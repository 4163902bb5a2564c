"""``cdcp-igl check``."""

from __future__ import annotations

import json
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING

import typer

from .messages import BAD_INPUT, exit_codes, reason
from .options import INPUTS
from .screen import show_text

if TYPE_CHECKING:
    from ..errors import Defect, MeshError


def check_command(
    meshes: list[Path] = INPUTS,
    as_json: bool = typer.Option(False, "--json", help="Print a list of objects, one a file."),
) -> None:
    """Report every defect of meshes, what kind of surface each is, and how to go on.

    Exit codes: 0 all are disks, 2 one is not a disk or not readable.
    """
    from ..errors import MeshError, printable
    from ..io import read_polygons
    from ..printing import as_text
    from ..surface.checking import MeshReport, check

    rows, disks = [], 0
    for mesh in meshes:
        notes: list[str] = []
        try:
            with exit_codes(mesh if len(meshes) > 1 else None):
                try:
                    V, F, polygon_of_face = read_polygons(mesh, notes.append)
                    report = check(V, F, polygon_of_face=polygon_of_face)
                except (MeshError, OSError) as error:
                    if not as_json:
                        raise
                    report = MeshReport(0, 0, defects=_defects(error))
        except typer.Exit:
            continue  # and the message has been printed
        disks += report.is_disk
        rows.append({"file": printable(mesh), **report.report(), "notes": notes})
        if not as_json:
            name = f"{printable(mesh)}: " if len(meshes) > 1 else ""
            files = f"{quote(printable(mesh))} {quote(printable(mesh.stem) + '_map.obj')}"
            said = report.in_shell.replace("IN OUT", files)
            text = as_text(f"{name}{said}", [("note", note) for note in notes])
            show_text(text, "green" if report.is_disk else "red")
    if as_json:
        typer.echo(json.dumps(rows, indent=2))
    if disks < len(meshes):
        raise typer.Exit(BAD_INPUT)


def _defects(error: MeshError | OSError) -> tuple[Defect, ...]:
    from ..errors import Defect, MeshError

    if isinstance(error, MeshError):
        return error.defects
    return (Defect.of("unreadable file", reason=reason(error)),)
