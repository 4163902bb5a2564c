"""What notebooks show in place of text."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from html import escape

__all__ = ["html_table", "table_of"]


def table_of(text: str) -> str:
    """Return a table of what is printed: a title, then lines of a name, spaces, and a text."""
    caption, *lines = text.splitlines()
    return html_table(
        caption, [re.split(r"  +|(?<=-) ", line.strip(), maxsplit=1) for line in lines]
    )


def html_table(caption: str, rows: Iterable[Sequence[str]]) -> str:
    """Return a small table: in each row a name and what is said about it."""
    cells = "".join(
        f'<tr><th scope="row" style="text-align: left; font-weight: normal; opacity: 0.7">'
        f'{escape(name)}</th><td style="text-align: left">{escape(text)}</td></tr>'
        for name, text in rows
    )
    style = "text-align: left; font-weight: 600; white-space: nowrap"
    head = f'<caption style="{style}">{escape(caption)}</caption>'
    return f"<table>{head}<tbody>{cells}</tbody></table>"
