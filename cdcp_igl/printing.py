"""What is printed of a result or a report: a title, and pairs of a name and what is said of it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

Pairs = Sequence[tuple[str, str]]

NAME = 20  # characters from the start of a name to its text


def as_text(title: str, pairs: Pairs) -> str:
    """Return the title, and below it a line for each pair."""
    return "\n".join([title, *(f"  {name:<{NAME}}{text}" for name, text in pairs)])


def as_html(title: str, pairs: Pairs) -> str:
    """Return a small table with a row for each pair."""
    cells = "".join(
        f'<tr><th scope="row" style="text-align: left; font-weight: normal; opacity: 0.7">'
        f'{escape(name)}</th><td style="text-align: left">{escape(text)}</td></tr>'
        for name, text in pairs
    )
    style = "text-align: left; font-weight: 600; white-space: nowrap"
    head = f'<caption style="{style}">{escape(title)}</caption>'
    return f"<table>{head}<tbody>{cells}</tbody></table>"


def table_as_text(title: str, headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return the title, and below it the headings and rows, the first two columns to the left."""
    widths = [max(map(len, column)) for column in zip(headings, *rows, strict=True)]
    lines = (
        "  ".join(f"{text:{'<' if k < 2 else '>'}{widths[k]}}" for k, text in enumerate(row))
        for row in (headings, *rows)
    )
    return "\n".join([title, *(line.rstrip() for line in lines)])


def table_as_html(
    title: str, headings: Sequence[str], rows: Sequence[Sequence[str]], notes: Sequence[str]
) -> str:
    """Return the same as a table, and notes below it, a line each."""

    def line(row: Sequence[str], tag: str) -> str:
        cells = (
            f'<{tag} style="text-align: {"left" if k < 2 else "right"}">{escape(text)}</{tag}>'
            for k, text in enumerate(row)
        )
        return f"<tr>{''.join(cells)}</tr>"

    body = "".join(line(row, "td") for row in rows)
    head = f"<caption>{escape(title)}</caption><thead>{line(headings, 'th')}</thead>"
    told = "".join(f"<p>{escape(note)}</p>" for note in notes)
    return f"<table>{head}<tbody>{body}</tbody></table>{told}"


def finite(row: Mapping[str, Any]) -> dict[str, Any]:
    """Put None for NaN and infinity, which JSON does not have."""
    return {
        name: None if isinstance(value, float) and not math.isfinite(value) else value
        for name, value in row.items()
    }
