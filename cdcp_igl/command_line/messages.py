"""What goes wrong: messages and exit codes."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import BrokenExecutor
from contextlib import contextmanager
from logging import Handler, LogRecord, getLogger
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING

import typer

from ..extras import MissingExtra, from_extra
from .options import PICTURES

if TYPE_CHECKING:
    from ..errors import Defect

FAILED, BAD_INPUT, NO_MAP, SOME_FAILED = 1, 2, 3, 4  # exit codes


@contextmanager
def writing(remedy: str = "") -> Iterator[None]:
    """Say which file could not be written, and what to do then."""
    try:
        yield
    except OSError as error:
        if isinstance(error, FileExistsError):  # and nothing has been done
            remedy = ""
        typer.echo(f"Not written: {reason(error)}{remedy}", err=True)
        raise typer.Exit(FAILED) from error


class _Notes(Handler):
    def __init__(self, notes: list[str]) -> None:
        super().__init__()
        self.notes = notes

    def emit(self, record: LogRecord) -> None:
        self.notes.append(record.getMessage())


@contextmanager
def logged(notes: list[str]) -> Iterator[None]:
    """Take down what is logged meanwhile, such as what a file cannot hold."""
    log, handler = getLogger("cdcp_igl"), _Notes(notes)
    log.addHandler(handler)
    try:
        yield
    finally:
        log.removeHandler(handler)


@contextmanager
def exit_codes(
    file: Path | None = None, *, files: Sequence[Path] = (), tried: Sequence[str] = ()
) -> Iterator[None]:
    """Turn the errors that users can correct into a message, of this file, and an exit code.

    Where `map` was to map `files`, IN and OUT, with some options, it says which ones do it.
    """
    from ..defects import as_commands
    from ..errors import MapError, MeshError, SolverError, printable

    try:
        yield
    except MeshError as error:
        found = [f"{defect.name}: {defect.in_shell}" for defect in error.defects]
        if files and (options := _options_that_map(error.defects, tried)):
            named = " ".join(quote(printable(path)) for path in files)
            found.append(f"Next: cdcp-igl map {options} {named}")
        message, code = "\n".join(found), BAD_INPUT
    except OSError as error:
        message, code = reason(error), BAD_INPUT
    except ValueError as error:  # an option does not fit this mesh
        message, code = str(error), BAD_INPUT
    except (MapError, SolverError) as error:
        message, code = as_commands(str(error)), NO_MAP
    except (MissingExtra, BrokenExecutor) as error:
        message, code = str(error), FAILED
    else:
        return
    if file and printable(file) not in message:
        message = "\n".join(f"{printable(file)}: {line}" for line in message.splitlines())
    typer.echo(message, err=True)
    raise typer.Exit(code)


def _options_that_map(defects: Iterable[Defect], tried: Sequence[str]) -> str:
    from ..defects import CLEAN, CUT, DEFECTS

    ways = [DEFECTS[defect.name].by for defect in defects]
    if not all(ways):
        return ""
    cleans = CLEAN in tried or not all(CUT in by for by in ways)
    options = [CLEAN, CUT] if cleans else [CUT]
    return "" if options == list(tried) else " ".join(options)


def reason(error: OSError) -> str:
    """Say what the system says, and of which file."""
    from ..errors import printable

    return f"{printable(error.filename)}: {error.strerror}" if error.filename else str(error)


def check_targets(targets: Iterable[Path | None], sources: Iterable[Path], force: bool) -> None:
    """Before anything is computed, see that all can be written, and nothing is lost by it."""
    from ..errors import printable
    from ..io.output import try_to_write

    for path in filter(None, targets):
        if path.suffix.lower() in (".html", *PICTURES):
            with from_extra("plot"):
                import matplotlib  # noqa: F401
        if os.path.isfile(path):  # and no error where a name is too long to be one
            message = "" if force else f"{printable(path)} is there; --force replaces it."
            if any(os.path.exists(source) and path.samefile(source) for source in sources):
                message = f"{printable(path)} is the surface itself; give the result another place."
            if message:
                typer.echo(message, err=True)
                raise typer.Exit(BAD_INPUT)
        with writing():
            try_to_write(path)
