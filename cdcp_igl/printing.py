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


def finite(row: Mapping[str, Any]) -> dict[str, Any]:
    """Put None for NaN and infinity, which JSON does not have."""
    return {
        name: None if isinstance(value, float) and not math.isfinite(value) else value
        for name, value in row.items()
    }
