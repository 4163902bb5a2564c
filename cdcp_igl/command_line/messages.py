"""What the commands say, and the exit codes."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor
from contextlib import contextmanager
from pathlib import Path

import typer

from ..extras import MissingExtra

__all__ = ["BAD_INPUT", "FAILED", "SOME_FAILED", "exit_codes", "reason", "show", "writing"]

FAILED, BAD_INPUT, NO_MAP, SOME_FAILED = 1, 2, 3, 4  # exit codes


@contextmanager
def writing(remedy: str = "") -> Iterator[None]:
    """Say which file could not be written, and what to do then."""
    try:
        yield
    except OSError as error:
        typer.echo(f"Not written: {reason(error)}{remedy}", err=True)
        raise typer.Exit(FAILED) from error


@contextmanager
def exit_codes(file: Path | None = None) -> Iterator[None]:
    """Turn the errors that users can mend into a message, of this file, and an exit code."""
    from ..errors import MapError, MeshError, SolverError, printable

    try:
        yield
    except MeshError as error:
        message, code = "\n".join(f"{defect.name}: {defect}" for defect in error.defects), BAD_INPUT
    except OSError as error:
        message, code = reason(error), BAD_INPUT
    except ValueError as error:  # an option does not fit this mesh
        message, code = str(error), BAD_INPUT
    except (MapError, SolverError) as error:
        message, code = str(error), NO_MAP
    except (MissingExtra, BrokenExecutor) as error:
        message, code = str(error), FAILED
    else:
        return
    if file and printable(file) not in message:
        message = "\n".join(f"{printable(file)}: {line}" for line in message.splitlines())
    typer.echo(message, err=True)
    raise typer.Exit(code)


def reason(error: OSError) -> str:
    """Say what the system says, and of which file."""
    from ..errors import printable

    return f"{printable(error.filename)}: {error.strerror}" if error.filename else str(error)


def show(summary: str, notes: list[str], color: str) -> None:
    """Print a result: in a panel on a terminal, plain in a pipe."""
    title, *lines = [*summary.splitlines(), *(f"  note                {note}" for note in notes)]
    if not sys.stdout.isatty():
        typer.echo("\n".join([title, *lines]))
        return
    from rich.console import Console
    from rich.panel import Panel
    from rich.table import Table
    from rich.text import Text

    table = Table.grid(padding=(0, 2))
    for line in lines:
        table.add_row(*map(Text, re.split("  +", line.strip(), maxsplit=1)))
    Console().print(Panel(table, title=Text(title, "bold"), border_style=color, expand=False))
