"""Tables on a terminal, of any width."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

__all__ = ["print_table"]

PIPE = 120  # columns where there is no terminal
FOLDED = 20  # characters of a name where the terminal is too narrow


def _number_table(title: str, headings: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    """Make a table with a column of names and then columns of numbers, as narrow as can be."""
    made = Table(
        title=Text(title, "table.title") if title else None,
        title_justify="left",
        box=SIMPLE_HEAD,
        show_edge=False,
        pad_edge=False,
        padding=(0, 1, 0, 0),
    )
    made.add_column(headings[0], overflow="fold")
    for heading in headings[1:]:
        made.add_column(heading, justify="right", no_wrap=True)
    for name, *numbers in rows:
        made.add_row(Text(name), *numbers)
    return made


def print_table(title: str, headings: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print such a table; where the terminal is too narrow names fold, and no number is cut."""
    made = _number_table(title, headings, rows)
    console = Console(width=None if sys.stdout.isatty() else PIPE)
    unbounded = console.options.update(max_width=sys.maxsize)
    longest = max(Text(name).cell_len for name, *_ in rows)
    least = console.measure(made, options=unbounded).maximum - max(longest - FOLDED, 0)
    console.width = max(console.width, least)
    console.print(made)
