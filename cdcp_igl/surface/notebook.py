"""What notebooks show in place of text."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape

__all__ = ["html_table"]


def html_table(caption: str, rows: Mapping[str, str]) -> str:
    """Return a small table: a name and what is said about it in each row."""
    cells = "".join(
        f'<tr><th scope="row" style="text-align: left; font-weight: normal; opacity: 0.7">'
        f'{escape(name)}</th><td style="text-align: left">{escape(text)}</td></tr>'
        for name, text in rows.items()
    )
    style = "text-align: left; font-weight: 600; white-space: nowrap"
    head = f'<caption style="{style}">{escape(caption)}</caption>'
    return f"<table>{head}<tbody>{cells}</tbody></table>"
