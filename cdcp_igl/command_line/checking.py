"""``cdcp-igl check``."""

from __future__ import annotations

import typer

from .arguments import Input
from .messages import BAD_INPUT, exit_codes, show

__all__ = ["check_command"]


def check_command(mesh: Input) -> None:
    """Report every defect of a mesh.

    Exit codes: 0 a disk, 2 not a disk or not readable.
    """
    from ..io import read_mesh
    from ..surface.report import check

    notes: list[str] = []
    with exit_codes():
        V, F = read_mesh(mesh, notes.append)
    report = check(V, F)
    show(str(report), notes, "green" if report.is_disk else "red")
    if not report.is_disk:
        raise typer.Exit(BAD_INPUT)
