"""``cdcp-igl partition``, and ``cdcp-igl map`` of what it has made."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import typer

from .batches import KEPT, executor_at
from .messages import check_targets, exit_codes, writing
from .options import QUIET, verify_target
from .screen import progress_bar, show_pairs


def partition_command(
    source: Path = typer.Argument(
        metavar="IN",
        help="A surface: a folder with V*.npy and F*.npy; a binary ply of triangles; any other "
        "file that `map` takes, which is read as a whole.",
    ),
    folder: Path = typer.Argument(metavar="FOLDER", help="Where the parts go; made by this."),
    parts: int | None = typer.Option(
        None, metavar="N", help="How many, a power of 2. [default: by size and memory]"
    ),
    quiet: bool = QUIET,
) -> None:
    """Part a surface that is larger than memory, for `map FOLDER OUT.npy`.

    Exit codes: 0 it is parted; 1 a file could not be written; 2 bad input.
    """
    from ..errors import printable
    from ..scale.parts import partition

    with exit_codes(), progress_bar() as progress:
        partition(source, folder, parts, progress=progress)
    if not quiet:
        out = printable(folder)
        typer.echo(f"{out} has the parts. Next: cdcp-igl map {out} {out}.npy")


def is_parted(source: Path) -> bool:
    """Whether `partition` has made it."""
    return (source / "parts.json").is_file()


def map_parts(
    folder: Path,
    out: Path,
    outputs: tuple[Path | None, ...],
    options: dict[str, Any],
    where: tuple[int | None, str | None],
    *,
    force: bool,
    quiet: bool,
) -> None:
    """Map a surface in parts to an npy file.

    `outputs` are a report, a picture and a page; `where` are how many processes, and a scheduler.
    """
    verify_target(out, (".npy",))
    from ..errors import printable
    from ..scale.one_file import NAMES, refuse_unknown
    from ..scale.parts import parts_map

    chosen = {name: options[name] for name in options if name not in NAMES or options[name]}
    with exit_codes(), executor_at(where[1]) as executor:
        refuse_unknown("parts", parts_map, chosen)
        check_targets((out, *outputs), [], force)
        with progress_bar() as progress, writing(KEPT):
            result = parts_map(folder, executor=executor or where[0], progress=progress, **chosen)
            result.assemble(out)
            for path in filter(None, outputs):
                result.save(path)
    if not quiet:
        title, pairs = result.summary()
        show_pairs(title, [*pairs, ("uv", printable(out))])
