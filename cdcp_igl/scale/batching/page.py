"""The report of a batch: one page that needs nothing else."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from importlib.resources import files
from math import isfinite
from string import Template

import numpy as np

from ... import __version__
from ...errors import printable
from .journal import DONE, Record

# How the page begins, by which the next run knows it.
PAGE_BEGINS = """\
<!DOCTYPE html>
<html lang="en">
<meta charset="utf-8">
<meta name="generator" content="cdcp_igl.batch">
"""

BINS = 30
WIDTH, HEIGHT, MARGIN = 720, 200, 24  # of the histogram

COLUMNS = (  # of the table: heading, attribute of the record, format
    ("vertices", "vertices", ",d"),
    ("charts", "charts", ",d"),
    ("mean °", "mean", ".3f"),
    ("SD °", "sd", ".3f"),
    ("area", "area_sd", ".3f"),
    ("texels", "texels", ".3g"),
    ("flips", "flips", ",d"),
    ("s", "seconds", ".2f"),
    ("MiB", "memory", ",.0f"),
)


def report_page(title: str, summary: str, records: Sequence[Record]) -> str:
    """Return an HTML page with all records."""
    done = [record for record in records if record.status == DONE]
    template = Template(files(__package__).joinpath("page.html").read_text(encoding="utf-8"))
    return PAGE_BEGINS + template.substitute(
        title=escape(title),
        summary="<br>".join(map(escape, [*summary.splitlines(), f"cdcp_igl {__version__}"])),
        histogram=_histogram(np.array([record.mean for record in done])) if done else "",
        failures=_failures([record for record in records if record.status != DONE]),
        table=_table(done) if done else "",
    )


def _histogram(means: np.ndarray) -> str:
    """Count the surfaces by their mean angular distortion."""
    counts, edges = np.histogram(means, BINS, range=(0, max(float(means.max()), 1e-3)))
    step, tall = WIDTH / BINS, (HEIGHT - 2 * MARGIN) / counts.max()
    bars = "".join(
        f'<rect x="{i * step + 1:.1f}" y="{HEIGHT - MARGIN - tall * count:.1f}" '
        f'width="{step - 2:.1f}" height="{tall * count:.1f}">'
        f"<title>{edges[i]:.3f} to {edges[i + 1]:.3f} degrees: {count:,}</title></rect>"
        for i, count in enumerate(counts)
    )
    labels = "".join(
        f'<text x="{i * step:.1f}" y="{HEIGHT - 6}" text-anchor="{anchor}">{edges[i]:.2f}°</text>'
        for i, anchor in ((0, "start"), (BINS // 2, "middle"), (BINS, "end"))
    )
    return (
        "<h2>Mean angular distortion</h2>"
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="Histogram of the mean '
        f'angular distortion">{bars}{labels}<text x="0" y="14">at most {counts.max():,}</text>'
        "</svg>"
    )


def _failures(records: Sequence[Record]) -> str:
    if not records:
        return ""
    rows = "".join(
        f'<tr><td>{escape(printable(record.name))}</td><td class="text">{escape(record.error)}</td>'
        f'<td class="text">{escape(record.message)}</td></tr>'
        for record in records
    )
    return f"<h2>Not mapped</h2><table><tbody>{rows}</tbody></table>"


def _table(records: Sequence[Record]) -> str:
    headings = ["surface", *(heading for heading, _, _ in COLUMNS), "conformal"]
    heads = "".join(f"<th><button>{heading}</button></th>" for heading in headings)
    rows = "".join(map(_row, records))
    return f"<h2>Mapped</h2><table><thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table>"


def _row(record: Record) -> str:
    name = escape(printable(record.name))
    values = [(heading, getattr(record, column), form) for heading, column, form in COLUMNS]
    cells = "".join(
        f'<td data-name="{heading}" data-key="{x if isfinite(x) else ""}">'
        f"{format(x, form) if isfinite(x) else '–'}</td>"
        for heading, x, form in values
    )
    doubt = f'<span class="warning">no: {escape(record.reasons)}</span>'
    verdict = {True: "yes", None: "not asked for"}.get(record.conformal, doubt)
    return (
        f'<tr><td data-key="{name}" title="{escape(printable(record.input))}">{name}</td>{cells}'
        f'<td class="text" data-name="conformal" data-key="{int(bool(record.conformal))}">'
        f"{verdict}</td></tr>"
    )
