"""Folders of surfaces, and what to do if there are none."""

from __future__ import annotations

import os
from collections.abc import Container
from pathlib import Path

import typer

__all__ = ["data", "files_of"]


def data() -> Path | None:
    """Return the folder that CDCP_IGL_DATA names, None if it is not set."""
    named = os.environ.get("CDCP_IGL_DATA")
    if not named:
        return None
    if not Path(named).is_dir():
        raise typer.BadParameter(
            f"{named!r} is no folder: set it to one with surfaces, or unset it",
            param_hint="CDCP_IGL_DATA",
        )
    return Path(named)


def files_of(folder: Path | None, kinds: Container[str]) -> list[Path]:
    """List the files of a folder, by default of `any` in that of the data, that end so."""
    above = data() if folder is None else None
    folder = above / "any" if above else folder
    if folder is None:
        text = "give one, or set CDCP_IGL_DATA to a folder in which `any` has surfaces"
        raise typer.BadParameter(text, param_hint="FOLDER")
    files = sorted(path for path in folder.glob("*") if path.suffix in kinds)
    if not files:
        text = f"there are no surfaces in {str(folder)!r}: give another folder"
        raise typer.BadParameter(text, param_hint="FOLDER")
    return files
