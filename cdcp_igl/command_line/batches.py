"""``cdcp-igl batch``."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from math import inf
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any

import typer

from ..extras import from_extra
from .messages import FAILED, SOME_FAILED, exit_codes, writing
from .options import FORCE, QUIET, SURFACES, file_option, takes_map_options
from .screen import print_table, progress_bar

if TYPE_CHECKING:
    from ..scale.batching import Batch

LONG = 100  # rows of a table that can still be read
WORST = 20  # of a longer one: the maps with the largest distortion
NUMBERS = ("vertices", "mean", "sd", "area_sd", "texels", "flips", "seconds", "memory")
SCHEDULER = typer.Option(
    None, metavar="tcp://...", help="Address of a Dask scheduler: map on its workers."
)
KEPT = ". What is done is kept: correct this, and run it again."
NOW_AND_THEN = 10.0  # seconds between two lines where there is no terminal


@takes_map_options
def batch_command(
    options: dict[str, Any],
    inputs: list[str] = typer.Argument(
        metavar="IN...", help=f"Surfaces ({SURFACES}), folders with everything below, or patterns."
    ),
    out: Path = typer.Argument(metavar="OUT", help="Folder of the results."),
    jobs: int = typer.Option(1, "--jobs", "-j", metavar="N", min=1, help="Processes side by side."),
    format: str = typer.Option(
        "npz",
        metavar="npz|obj|ply|glb|vtk|vtp|gii|same",
        help="Type of the results; `same` for that of each surface.",
    ),
    retry: bool = typer.Option(False, "--retry", help="Try again what failed in a former run."),
    time_limit: float = typer.Option(inf, metavar="SECONDS", min=0, help="For each surface."),
    memory_limit: float = typer.Option(inf, metavar="MIB", min=0, help="For each surface."),
    force: bool = FORCE,
    shard: str | None = typer.Option(
        None, metavar="I/N", help="Map part I of N only: for job arrays."
    ),
    report: Path | None = file_option(
        "--report", "R.html", (".html",), "One page with a histogram and a table."
    ),
    scheduler: str | None = SCHEDULER,
    quiet: bool = QUIET,
) -> None:
    """Map many surfaces, each to a file in OUT; run again, it goes on where it was.

    OUT/results.jsonl has a line for each surface, OUT/summary.csv the latest ones. Surfaces of one
    name are told apart by their folders: to go on, give the same ones, or the one above them.

    Exit codes: 0 all are mapped; 1 a file could not be written, or an extra is missing;
    2 a bad argument; 4 some are not mapped.
    """
    from ..scale.batching.names import read_shard

    with exit_codes(), executor_at(scheduler) as executor:
        run_batch(
            inputs,
            out,
            quiet=quiet,
            jobs=jobs,
            executor=executor,
            format=format,
            retry=retry,
            force=force,
            time_limit=time_limit,
            memory_limit=memory_limit,
            shard=shard and read_shard(shard),
            report=report,
            **options,
        )


def run_batch(inputs: Sequence[str | Path], out: Path, *, quiet: bool, **options: Any) -> None:
    """Run `batch` and show what it has done; typer.Exit, with its code, if not all are mapped."""
    from ..defects import as_commands
    from ..errors import printable
    from ..scale.batching import batch

    with exit_codes(), writing(KEPT), _progress(quiet) as progress:
        made = batch(inputs, out, progress=progress, **options)
    if not quiet:
        _show_done(made)
    for record in made.failed[:LONG]:
        message = as_commands(record.message).replace("cdcp-igl map", "cdcp-igl batch")
        typer.echo(f"{printable(record.name)}: {record.error}: {message}", err=quiet)
    if len(made.failed) > LONG:
        typer.echo(f"and {len(made.failed) - LONG:,} more", err=quiet)
    if not quiet:
        typer.echo(f"{made}\nOf each surface: {printable(out / 'summary.csv')}")
    if made.failed:
        raise typer.Exit(SOME_FAILED)


@contextmanager
def executor_at(scheduler: str | None) -> Iterator[Any]:
    """Let the body use the workers of a Dask scheduler; None without an address."""
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
        with progress_bar(patience=0) as progress:
            yield lambda done, failed, total: progress(
                f"{done + failed:,}/{total:,}, {failed:,} failed", (done + failed) / total
            )
    else:
        said = start = monotonic()

        def say(done: int, failed: int, total: int) -> None:
            nonlocal said
            if monotonic() - said > NOW_AND_THEN:
                said = monotonic()
                count = f"{done:,} of {total:,} mapped, {failed:,} failed"
                typer.echo(f"{said - start:,.0f} s: {count}", err=True)

        yield say


def _show_done(made: Batch) -> None:
    from ..errors import printable

    done, title = made.done, ""
    if len(done) > LONG:
        done = tuple(sorted(done, key=lambda record: record.mean, reverse=True)[:WORST])
        title = f"the {WORST} with the largest mean"
    if done:
        print_table(
            title, "surface", NUMBERS, [(printable(record.name), record) for record in done]
        )
    for record in done:
        if record.conformal is False:
            typer.echo(f"{printable(record.name)}: not conformal: {record.reasons}")
