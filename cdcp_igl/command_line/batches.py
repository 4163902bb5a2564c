"""``cdcp-igl batch``."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..extras import from_extra
from .arguments import READABLE, Quiet, target
from .map_options import (
    Align,
    Center,
    Mobius,
    Preset,
    Refine,
    RefineNorm,
    RefineSeconds,
    chosen_options,
)
from .messages import FAILED, SOME_FAILED, exit_codes, writing

if TYPE_CHECKING:
    from ..batching import Batch, Record

__all__ = ["batch_command"]

LONG = 100  # rows of a table that can still be read
WORST = 20  # of a longer one: the maps with the largest distortion
HEADINGS = ("surface", "vertices", "mean °", "SD °", "area", "flips", "s", "MiB")
KEPT = ". What is done is kept: mend this, and run the batch again."
NOW_AND_THEN = 10.0  # seconds between two lines where there is no terminal


class Format(StrEnum):
    """Values of --format."""

    glb = "glb"
    npz = "npz"
    obj = "obj"
    ply = "ply"


def _shard(text: str | None) -> tuple[int, int] | None:
    from ..batching.shards import read_shard

    try:
        return None if text is None else read_shard(text)
    except ValueError as error:
        raise typer.BadParameter(str(error)) from error


def batch_command(
    inputs: Annotated[
        list[str],
        typer.Argument(
            metavar="IN...",
            help=f"Surfaces ({' '.join(READABLE)}), folders with everything below, or patterns.",
        ),
    ],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="Folder of the results.")],
    jobs: Annotated[
        int, typer.Option("--jobs", "-j", metavar="N", min=1, help="Processes side by side.")
    ] = 1,
    format: Annotated[Format, typer.Option(help="Type of the results.")] = Format.npz,
    disk: Annotated[
        bool, typer.Option("--disk", help="Texture coordinates in the unit disk.")
    ] = False,
    clean: Annotated[bool, typer.Option("--clean", help="Mend each surface first.")] = False,
    cut: Annotated[
        bool, typer.Option("--cut", help="Cut surfaces open that are no disks.")
    ] = False,
    retry: Annotated[
        bool, typer.Option("--retry", help="Try again what failed in a former run.")
    ] = False,
    time_limit: Annotated[
        float | None, typer.Option(metavar="SECONDS", min=0, help="For each surface.")
    ] = None,
    memory_limit: Annotated[
        float | None, typer.Option(metavar="MIB", min=0, help="For each surface.")
    ] = None,
    shard: Annotated[
        str | None,
        typer.Option(metavar="I/N", callback=_shard, help="Map part I of N only: for job arrays."),
    ] = None,
    report: Annotated[
        Path | None,
        typer.Option(
            metavar="R.html",
            callback=target(".html"),
            help="One page with a histogram, a table and a picture of every disk.",
        ),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="tcp://...", help="Address of a Dask scheduler: map on its workers."),
    ] = None,
    center: Center = None,
    mobius: Mobius = None,
    align: Align = None,
    refine: Refine = 0,
    refine_norm: RefineNorm = None,
    refine_seconds: RefineSeconds = None,
    preset: Preset = None,
    quiet: Quiet = False,
) -> None:
    """Map many surfaces, each to a file in OUT; run again, it goes on where it was.

    OUT/results.jsonl has a line for each surface, OUT/summary.csv the latest ones. Surfaces of one
    name are told apart by their folders: to go on, give the same ones, or the one above them.

    Exit codes: 0 all are mapped; 1 a file could not be written, or an extra is missing;
    2 a bad argument; 4 some are not mapped.
    """
    options = chosen_options(center, mobius, align, refine, refine_norm, refine_seconds, preset)
    limits = {"time_limit": time_limit, "memory_limit": memory_limit}
    options |= {name: limit for name, limit in limits.items() if limit is not None}

    from ..batching import batch

    with (
        exit_codes(),
        writing(KEPT),
        _executor(scheduler) as executor,
        _progress(quiet) as progress,
    ):
        made = batch(
            inputs,
            out,
            jobs=jobs,
            executor=executor,
            format=format.value,
            disk=disk,
            clean=clean,
            cut=cut,
            retry=retry,
            shard=shard,  # type: ignore[arg-type] # what the callback has made of it
            report=report,
            progress=progress,
            **options,
        )
    if not quiet:
        _show(made, out)
    if made.failed:
        raise typer.Exit(SOME_FAILED)


@contextmanager
def _executor(scheduler: str | None) -> Iterator[Any]:
    if scheduler is None:
        yield None
        return
    with from_extra("batch"):
        from distributed import Client
    try:
        client = Client(scheduler)
    except OSError as error:
        typer.echo(f"No scheduler answers at {scheduler}: {error}", err=True)
        raise typer.Exit(FAILED) from error
    with client:
        yield client


@contextmanager
def _progress(quiet: bool) -> Iterator[Callable[[int, int, int], None] | None]:
    """Show a bar on a terminal, and elsewhere a line now and then, on stderr."""
    if quiet:
        yield None
    elif sys.stderr.isatty():
        from rich.console import Console
        from rich.progress import (
            BarColumn,
            MofNCompleteColumn,
            Progress,
            TextColumn,
            TimeRemainingColumn,
        )

        columns = (MofNCompleteColumn(), TextColumn("{task.description}"), BarColumn())
        console = Console(stderr=True)
        with Progress(*columns, TimeRemainingColumn(), console=console, transient=True) as bar:
            task = bar.add_task("", total=None)
            yield lambda done, failed, total: bar.update(
                task, completed=done + failed, total=total, description=f"{failed:,} failed"
            )
    else:
        said = start = monotonic()

        def say(done: int, failed: int, total: int) -> None:
            nonlocal said
            if monotonic() - said > NOW_AND_THEN:
                said = monotonic()
                typer.echo(
                    f"{said - start:,.0f} s: {done:,} of {total:,} mapped, {failed:,} failed",
                    err=True,
                )

        yield say


def _show(made: Batch, out: Path) -> None:
    from ..errors import printable
    from .tables import print_table

    done, title = made.done, ""
    if len(done) > LONG:
        done = tuple(sorted(done, key=lambda record: record.mean, reverse=True)[:WORST])
        title = f"the {WORST} with the largest mean"
    if done:
        print_table(title, HEADINGS, [_row(record) for record in done])
    for record in done:
        if not record.conformal:
            typer.echo(f"{printable(record.name)}: not conformal: {record.boundary}")
    for record in made.failed[:LONG]:
        typer.echo(f"{printable(record.name)}: {record.error}: {record.message}")
    if len(made.failed) > LONG:
        typer.echo(f"and {len(made.failed) - LONG:,} more")
    typer.echo(f"{made}\nOf each surface: {printable(out / 'summary.csv')}")


def _row(record: Record) -> list[str]:
    from ..errors import printable

    return [
        printable(record.name),
        f"{record.vertices:,}",
        f"{record.mean:.3f}",
        f"{record.sd:.3f}",
        f"{record.area:.3f}",
        f"{record.flips:,}",
        f"{record.seconds:.2f}",
        f"{record.memory:,.0f}",
    ]
