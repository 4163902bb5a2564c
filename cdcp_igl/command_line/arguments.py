"""Arguments that several commands take, and their checks."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

__all__ = ["READABLE", "WRITABLE", "Inputs", "Quiet", "target"]

# Those of `io`, spelled out: `--help` shows them, and must not wait for NumPy.
READABLE = (".mat", ".npz", ".obj", ".off", ".ply", ".stl")
WRITABLE = (".glb", ".npz", ".obj", ".ply")

Inputs = Annotated[
    list[Path],
    typer.Argument(metavar="IN...", help=f"Triangulated surfaces ({' '.join(READABLE)})."),
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but what went wrong.")]


def target(*suffixes: str) -> Callable[[Path | None], Path | None]:
    """Make a check that a file of one of these types can be put where it is wanted."""

    def verify(path: Path | None) -> Path | None:
        if path is None:
            return None
        if path.suffix.lower() not in suffixes:
            raise typer.BadParameter(f"{path.name!r} must end in {' or '.join(suffixes)}.")
        if not os.path.isdir(path.parent):  # and no error where a name is too long to be one
            raise typer.BadParameter(f"there is no folder {str(path.parent)!r}.")
        if os.path.isdir(path):
            raise typer.BadParameter(f"{str(path)!r} is a folder.")
        return path

    return verify
