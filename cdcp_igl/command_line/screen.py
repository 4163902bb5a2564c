"""What is shown on a terminal, of any width, and in a pipe: results, tables, progress."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from math import isfinite
from threading import Timer
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from rich.console import RenderableType

    from ..phases import Progress
    from ..printing import Pairs

PATIENCE = 1.0  # seconds before the bar appears
PIPE = 120  # columns where there is no terminal
FOLDED = 20  # characters of a name where the terminal is too narrow
COLUMNS = {  # heading and format of the numbers in a table
    "vertices": ("vertices", ","),
    "mean": ("mean °", ".3f"),
    "sd": ("SD °", ".3f"),
    "max": ("max °", ".1f"),
    "area_sd": ("area", ".3f"),
    "texels": ("texels", ".3g"),
    "flips": ("flips", ",.0f"),
    "seconds": ("s", ".2f"),
    "memory": ("MiB", ",.0f"),
}


def show_pairs(title: str, pairs: Pairs) -> None:
    """Print a result: in a panel on a terminal, plain in a pipe."""
    from rich.table import Table
    from rich.text import Text

    from ..printing import as_text

    table = Table.grid(padding=(0, 2))
    for name, text in pairs:
        table.add_row(Text(name), Text(text))
    _show(as_text(title, pairs), table, "green", title)


def show_text(text: str, color: str) -> None:
    """Print a text: in a panel on a terminal, plain in a pipe."""
    from rich.text import Text

    _show(text, Text(text), color)


def _show(text: str, content: RenderableType, color: str, title: str = "") -> None:
    if not sys.stdout.isatty():
        typer.echo(text)
        return
    from rich.console import Console
    from rich.panel import Panel
    from rich.text import Text

    Console().print(Panel(content, title=Text(title, "bold"), border_style=color, expand=False))


def print_table(
    title: str, heading: str, columns: Sequence[str], rows: Sequence[tuple[str, object]]
) -> None:
    """Print names, and beside each the numbers that its object has as attributes, or a dash.

    Where the terminal is too narrow for it, names fold, and no number is cut.
    """
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(
        title=Text(title, "table.title") if title else None,
        title_justify="left",
        box=SIMPLE_HEAD,
        show_edge=False,
        pad_edge=False,
        padding=(0, 1, 0, 0),
    )
    table.add_column(heading, overflow="fold")
    for column in columns:
        table.add_column(COLUMNS[column][0], justify="right", no_wrap=True)
    for name, row in rows:
        values = [(getattr(row, column), COLUMNS[column][1]) for column in columns]
        table.add_row(Text(name), *(format(x, form) if isfinite(x) else "–" for x, form in values))
    console = Console(width=None if sys.stdout.isatty() else PIPE)
    unbounded = console.options.update(max_width=sys.maxsize)
    longest = max(Text(name).cell_len for name, _ in rows)
    least = console.measure(table, options=unbounded).maximum - max(longest - FOLDED, 0)
    console.width = max(console.width, least)
    console.print(table)


@contextmanager
def progress_bar(patience: float = PATIENCE) -> Iterator[Progress]:
    """Show a bar on stderr while the body runs; the body calls ``progress(phase, fraction)``.

    The bar appears after a while and vanishes at the end. Where stderr is no terminal, there is
    none.
    """
    if not sys.stderr.isatty():
        yield lambda phase, fraction: None
        return
    from rich import progress as rich
    from rich.console import Console

    bar = rich.Progress(
        *(rich.SpinnerColumn(), rich.TextColumn("{task.description:<11}"), rich.BarColumn()),
        *(rich.TaskProgressColumn(), rich.TimeElapsedColumn(), rich.TimeRemainingColumn()),
        console=Console(stderr=True),
        transient=True,
    )
    task = bar.add_task("", total=1)
    appear = Timer(patience, bar.start)
    appear.start()
    try:
        yield lambda phase, fraction: bar.update(task, description=phase, completed=fraction)
    finally:
        appear.cancel()
        appear.join()  # it may just have fired
        if bar.live.is_started:
            bar.stop()
