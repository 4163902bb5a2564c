"""The one form of a table, and the same table as Markdown."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import ParamSpec

import rich.table

NOTHING = "–"
P = ParamSpec("P")


@dataclass(frozen=True)
class Cell:
    """What is read in a table.

    Attributes
    ----------
    text : str
    value : float, optional
        By which it is sorted.
    note : str
        Why there is no number.
    kind : str
        How it looks: words from "name", "text", "missing", "best".
    model : str
        The surface whose name it is.
    """

    text: str
    value: float | None = None
    note: str = ""
    kind: str = ""
    model: str = ""


Row = list[Cell]
Content = tuple[Sequence[str], Sequence[Row]]  # of a table: headings, rows


@dataclass(frozen=True)
class Table:
    """Rows under headings, with what a reader has to know."""

    id: str
    title: str
    text: str
    headings: Sequence[str]
    rows: Sequence[Row]


def told(function: Callable[..., object]) -> tuple[str, str]:
    """Title and text of what a function makes: the first line of its docstring, and the rest."""
    title, _, text = inspect.cleandoc(function.__doc__ or "").partition("\n")
    return title.removesuffix("."), " ".join(text.split())


def entitled(id: str) -> Callable[[Callable[P, Content]], Callable[P, Table]]:
    """Make of a function that returns headings and rows one that returns the table."""

    def decorate(function: Callable[P, Content]) -> Callable[P, Table]:
        def table(*args: P.args, **options: P.kwargs) -> Table:
            return Table(id, *told(function), *function(*args, **options))

        return table

    return decorate


def name(text: str) -> Cell:
    """Make the head of a row."""
    return Cell(text, kind="text name")


def word(text: str) -> Cell:
    """Make a cell of text."""
    return Cell(text, kind="text")


def number(value: float, form: str | Callable[[float], str]) -> Cell:
    """Write a number, NaN as nothing."""
    if value != value:
        return Cell(NOTHING)
    return Cell(form(value) if callable(form) else format(value, form), value)


def measured_part(table: Table) -> Table:
    """Leave out the columns in which nothing is, behind name and size."""
    at = range(len(table.headings))
    kept = [k for k in at if k < 2 or any(r[k].text != NOTHING or r[k].note for r in table.rows)]
    rows = [[row[k] for k in kept] for row in table.rows]
    return replace(table, headings=[table.headings[k] for k in kept], rows=rows)


def best(cells: Row, among: Sequence[int]) -> Row:
    """Mark the least value among some columns, all that read the same."""
    values = {k: round(cells[k].value or 0, 3) for k in among if cells[k].value is not None}
    least = min(values.values(), default=None)
    return [
        replace(cell, kind=f"{cell.kind} best".strip()) if values.get(k, -1) == least else cell
        for k, cell in enumerate(cells)
    ]


def markdown(table: Table) -> str:
    """Write the rows as Markdown, the notes numbered below them."""
    notes: list[str] = []

    def text(cell: Cell) -> str:
        if not cell.note:
            return f"**{cell.text}**" if "best" in cell.kind else cell.text
        if cell.note not in notes:
            notes.append(cell.note)
        return f"{cell.text} [{notes.index(cell.note) + 1}]"

    first = table.rows[0] if table.rows else []
    rules = ["---" if "text" in cell.kind or cell.model else "---:" for cell in first]
    lines = [list(table.headings), rules, *([text(cell) for cell in row] for row in table.rows)]
    escaped = ([text.replace("|", r"\|") for text in line] for line in lines)
    rows = "\n".join("| " + " | ".join(line) + " |" for line in escaped)
    told = "\n".join(f"[{k}] {note}  " for k, note in enumerate(notes, 1))
    return rows + (f"\n\n{told}" if told else "")


def printed(table: Table, headings: Sequence[str]) -> rich.table.Table:
    """Make some of the columns a table for the terminal."""
    shown = rich.table.Table(title=table.title)
    columns = [table.headings.index(heading) for heading in headings]
    for k in columns:
        text = bool(table.rows) and "text" in table.rows[0][k].kind
        shown.add_column(table.headings[k], justify="left" if text else "right")
    for row in table.rows:
        shown.add_row(*(row[k].text for k in columns))
    return shown
