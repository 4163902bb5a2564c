"""The report in Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from ..records.findings import sentences
from ..records.results import Measured
from .sections import about, tables
from .table import markdown


def as_markdown(machine: Mapping[str, Any], measured: Measured) -> str:
    """Write the report: what was measured on, what was found, the tables.

    Parameters
    ----------
    machine : mapping
        As `describe` returns it, with "commands" and the limits.
    measured : Measured

    Returns
    -------
    str
    """
    parts = ["# Measured results", _list(_fact(*fact) for fact in about(machine))]
    if found := sentences(measured):
        parts += ["## Findings", _list(found)]
    for table in tables(measured):
        parts += [part for part in (f"## {table.title}", table.text, markdown(table)) if part]
    return "\n\n".join(parts) + "\n"


def _list(items: Iterable[str]) -> str:
    return "\n".join(f"- {item}" for item in items)


def _fact(name: str, text: str) -> str:
    return f"{name}: `{text}`" if name == "Again" else f"{name}: {text}"
