"""The report: a page in Markdown, and a folder of figures with pages for the browser."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from cdcp_igl.io.output import whole_file

from ..records.results import Measured, NotMeasured
from .figures import PLOTS
from .figures.style import Plot, encode
from .pages import write_pages
from .sections import about, tables
from .table import markdown, told


def as_markdown(machine: Mapping[str, Any], measured: Measured) -> str:
    """Write the report: what was measured on, and the tables.

    Parameters
    ----------
    machine : mapping
        As `describe` returns it, with "commands" and the limits.
    measured : Measured

    Returns
    -------
    str
    """
    parts = ["# Measured results", "\n".join(_fact(*fact) for fact in about(machine))]
    for table in tables(measured):
        parts += [part for part in (f"## {table.title}", table.text, markdown(table)) if part]
    return "\n\n".join(parts) + "\n"


def _fact(name: str, text: str) -> str:
    return f"- {name}: `{text}`" if name == "Again" else f"- {name}: {text}"


def draw(folder: Path, about: Mapping[str, Any], measured: Measured) -> Path:
    """Write the figures and the report for the browser into a folder; return its index."""
    folder.mkdir(parents=True, exist_ok=True)
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=len(PLOTS) + len(measured.sizes))
        drawn = []
        for plot in PLOTS:
            bar.update(task, description=plot.file)
            drawn.append(_figure(folder / plot.file, plot, measured))
            bar.advance(task)

        def advance(model: str) -> None:
            bar.update(task, description=model, advance=1)

        index = write_pages(folder, about, measured, drawn, advance)
    with whole_file(folder / "README.md") as unfinished:
        unfinished.write_text(_gallery(drawn), encoding="utf-8")
    return index


def _figure(target: Path, plot: Plot, measured: Measured) -> dict[str, Any]:
    """Draw one; return what the pages show of it."""
    title, caption = told(plot.draw)
    shown: dict[str, Any] = {"title": title, "caption": caption, "id": target.stem}
    try:
        picture = encode(plot(measured), target.suffix)
    except NotMeasured as reason:
        target.unlink(missing_ok=True)  # it would show something else
        return shown | {"missing": str(reason)}
    with whole_file(target) as unfinished:
        unfinished.write_bytes(picture)
    return shown | {"file": target}


def _gallery(drawn: Sequence[Mapping[str, Any]]) -> str:
    """Return the figures as a page for where HTML is not shown."""
    parts = ["# Figures\n\nWritten by `python -m benchmarks figures`.\n"]
    for shown in drawn:
        if "file" in shown:
            body = f"![{shown['title']}]({shown['file'].name})"
            parts.append(f"## {shown['title']}\n\n{body}\n\n{shown['caption']}\n")
    return "\n".join(parts)
