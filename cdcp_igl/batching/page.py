"""The report of a batch: one page that needs nothing else."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template

import numpy as np

from .. import __version__
from ..errors import printable
from .records import DONE, Record

__all__ = ["report_page"]

BINS = 30
WIDTH, HEIGHT, MARGIN = 720, 200, 24  # of the histogram


def report_page(
    title: str, summary: str, records: Sequence[Record], thumbnails: Mapping[str, Path]
) -> str:
    """Return an HTML page with all records.

    Parameters
    ----------
    title, summary : str
    records : sequence of Record
    thumbnails : mapping of str to Path
        JPEG files by name of the record; those that do not exist are left out.
    """
    done = [record for record in records if record.status == DONE]
    template = Template(files(__package__).joinpath("page.html").read_text(encoding="utf-8"))
    return template.substitute(
        title=escape(title),
        summary="<br>".join(map(escape, [*summary.splitlines(), f"cdcp_igl {__version__}"])),
        histogram=_histogram(np.array([record.mean for record in done])) if done else "",
        failures=_failures([record for record in records if record.status != DONE]),
        table=_table(done, thumbnails) if done else "",
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
    return f'<h2>Not mapped</h2><div class="scroll"><table><tbody>{rows}</tbody></table></div>'


def _table(records: Sequence[Record], thumbnails: Mapping[str, Path]) -> str:
    columns = ("surface", "map", "vertices", "disks", "mean °", "SD °", "area", "flips", "s", "MiB")
    heads = "".join(f"<th><button>{name}</button></th>" for name in (*columns, "conformal"))
    rows = "".join(_row(record, thumbnails.get(record.name)) for record in records)
    return (
        '<h2>Mapped</h2><div class="scroll"><table>'
        f"<thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table></div>"
    )


def _row(record: Record, thumbnail: Path | None) -> str:
    image = ""
    if thumbnail and thumbnail.exists():
        data = b64encode(thumbnail.read_bytes()).decode()
        image = f'<img loading="lazy" alt="" src="data:image/jpeg;base64,{data}">'
    name = escape(printable(record.name))
    numbers: tuple[tuple[float, str], ...] = (
        (record.vertices, ",d"),
        (record.disks, ",d"),
        (record.mean, ".3f"),
        (record.sd, ".3f"),
        (record.area, ".3f"),
        (record.flips, ",d"),
        (record.seconds, ".2f"),
        (record.memory, ",.0f"),
    )
    cells = "".join(f'<td data-key="{value}">{value:{form}}</td>' for value, form in numbers)
    doubt = f'<span class="warning">no: {escape(record.boundary)}</span>'
    verdict = "yes" if record.conformal else doubt
    return (
        f'<tr><td data-key="{name}" title="{escape(printable(record.input))}">{name}</td>'
        f'<td data-key="{name}">{image}</td>{cells}'
        f'<td data-key="{int(record.conformal)}">{verdict}</td></tr>'
    )
