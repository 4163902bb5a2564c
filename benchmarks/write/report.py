"""The report: a page in Markdown; figures, and self-contained pages for the browser."""

from __future__ import annotations

import base64
import re
from collections.abc import Iterator, Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined, select_autoescape
from matplotlib import colormaps
from matplotlib.colors import to_hex
from PIL import Image
from rich.console import Console
from rich.progress import track

from cdcp_igl.io.output import whole_file, write_text
from cdcp_igl.plot.raster import Bytes
from cdcp_igl.plot.scene import SCALE, Scene

from ..measure.models import TIERS
from ..records.paper import published
from ..records.record import EDGES, Record
from ..records.results import Measured, NotMeasured, Section
from .figures import PLOTS
from .figures.charts import histogram
from .figures.style import Plot, encode, model_name, style
from .sections import COLUMNS, about, case, cases, in_order, in_short, tables
from .table import Table, markdown, told

PIXELS = 300  # of the pictures on the page of a surface
MOST = 0.95  # of the corners are within the colour scale of the angular distortion

TEMPLATES = Environment(
    loader=FileSystemLoader(Path(__file__).parent / "templates"),
    autoescape=select_autoescape(["html"]),
    undefined=StrictUndefined,
    trim_blocks=True,
)


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
    parts = [f"# {_title(machine)}"]
    results = measured.sections.get("tables")
    if results and (short := in_short(results, anchor)).rows:
        parts += ["## In short", markdown(short)]
    parts += ["## What was measured on", facts(machine)]
    for table in tables(measured):
        parts += [part for part in (f"## {table.title}", table.text, markdown(table)) if part]
    return "\n\n".join(parts) + "\n"


def _title(machine: Mapping[str, Any]) -> str:
    """Say in words which surfaces were mapped, and where."""
    commands = " ".join(machine["commands"].values())
    tiers = [tier for tier in TIERS if f"--tier {tier}" in commands]
    of = f"CDCP-bench {tiers[0]}" if tiers else "The paper's surfaces, and others"
    return f"{of}, on {machine['cores']} cores, {machine['date']}"


def anchor(title: str) -> str:
    """Return the link to a section of the page."""
    return "#" + re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-")


def facts(machine: Mapping[str, Any]) -> str:
    """List what was measured on, and with."""
    lines = [f"- {k}: `{text}`" if k == "Again" else f"- {k}: {text}" for k, text in about(machine)]
    return "\n".join(lines)


def draw(folder: Path, machine: Mapping[str, Any], measured: Measured) -> Path:
    """Write the figures, and index.html with a page for each surface; return the index."""
    folder.mkdir(parents=True, exist_ok=True)
    shown: dict[str, Any] = {"console": Console(stderr=True), "transient": True}
    drawn = [_figure(folder / plot.file, plot, measured) for plot in track(PLOTS, **shown)]
    write_text(folder / "README.md", _gallery(drawn))
    pages = [_write_model(folder, measured, model) for model in track(measured.sizes, **shown)]
    sections = tables(measured)
    if "tables" in measured.sections:
        sections.append(cases(measured.sections["tables"]))
    index = folder / "index.html"
    _render(
        index,
        "index.html",
        {model: page["link"] for model, page in zip(measured.sizes, pages, strict=True)},
        about=about(machine),
        sections=sections,
        figures=[{"data": ""} | f | (_embedded(f["file"]) if "file" in f else {}) for f in drawn],
        models=pages,
    )
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


def _render(path: Path, template: str, links: Mapping[str, str], **content: Any) -> None:
    steps = (to_hex(colormaps[SCALE](t)) for t in np.linspace(0, 1, 9))
    text = TEMPLATES.get_template(template).render(scale=", ".join(steps), links=links, **content)
    write_text(path, text)


# -- the page of a surface -------------------------------------------------------------


def _write_model(folder: Path, measured: Measured, model: str) -> dict[str, str]:
    """Write the page and return how the index refers to it."""
    name = model_name(model, measured.sizes[model])
    try:
        V, F = measured.surface(model)
    except NotMeasured as error:
        return {"name": name, "link": "", "missing": str(error)}
    known = sorted(measured.sections, key=lambda section: section != "tables")
    sections = (measured.sections[section] for section in known)
    results = next(section for section in sections if model in section.sizes)
    methods = in_order(results)
    scene = Scene(V, F, PIXELS)
    most = _most(results.of(model, "cdcp"))
    surface = _webp(scene.by_normal())
    shown = []
    for method in methods:
        drawn: dict[str, Any] = {"label": style(method).label, "numbers": "", "disk": ""}
        uv = measured.map(model, method)
        if uv is None:
            drawn["missing"] = results.failure(model, method) or "its map was not kept"
        else:
            mean, sd = (results.median(model, method, name) for name in ("mean", "sd"))
            drawn["numbers"] = f"{mean:.3f} / {sd:.3f} degrees"
            drawn["disk"] = _webp(scene.disk(uv))
            drawn["checkerboard"] = _webp(scene.checkerboard(uv))
            drawn["distortion"] = _webp(scene.distortion(uv, most))
        shown.append(drawn)
    try:
        counted = {"data": _data(encode(histogram(measured, model), ".png"), "png")} | HISTOGRAM
    except NotMeasured as error:
        counted = {"data": "", "missing": str(error)}
    # Other characters by number: two names never share a page, and links need no escapes.
    file = folder / (re.sub(r"[^\w.-]", lambda other: f"~{ord(other[0]):x}", model) + ".html")
    _render(
        file,
        "model.html",
        {},
        name=name,
        surface=surface,
        about=list(_facts(results, model)),
        table_of_methods=Table(
            *("methods", f"Methods on {name}", "", COLUMNS),
            [case(results, model, method) for method in methods],
        ),
        most=f"{most:g}",
        maps=shown,
        histogram=counted,
    )
    return {"name": name, "link": file.name, "thumbnail": surface}


HISTOGRAM = {"width": 840, "height": 384}


def _most(cases: Sequence[Record]) -> float:
    """Where the colour scale ends: most corners of CDCP's map are below, in half degrees."""
    counts = np.array(cases[0].histogram if cases and cases[0].ok else [1])
    last = int(np.searchsorted(counts.cumsum() / counts.sum(), MOST)) + 1
    return float(np.clip(np.ceil(2 * EDGES[min(last, len(EDGES) - 1)]) / 2, 1, EDGES[-1]))


def _facts(results: Section, model: str) -> Iterator[tuple[str, str]]:
    of = next(record for record in results.records if record.model == model)
    yield "Vertices", f"{of.vertices:,}"
    yield "Faces", f"{of.faces:,}"
    yield "Boundary vertices", f"{of.boundary_vertices:,}"
    if model in results.opened:
        yield "Opened", "the largest disk of its surface_map, holes filled"
    row = published(model)
    if row:
        yield "In the paper", row.name if row.own == "own" else f"{row.name} ({row.own})"
    for record in results.of(model, "cdcp")[:1]:
        details = record.case.details
        if "boundary" in details:
            yield "Boundary map of CDCP", details["boundary"]["method"]
            flipped, rounds = details["repair"]["flipped_faces"], details["repair"]["rounds"]
            yield "Repair", f"{flipped:,} faces in {rounds} rounds" if flipped else "not needed"
            w = np.hypot(*details["mobius"]["w"])
            yield "Möbius", f"{details['mobius']['method']}, moves w to the centre, |w| = {w:.4f}"
            yield "Solver", details["solver"]


# -- pictures --------------------------------------------------------------------------


def _webp(picture: Bytes) -> str:
    file = BytesIO()
    Image.fromarray(picture).save(file, format="webp", quality=80, method=4)
    return _data(file.getvalue(), "webp")


def _embedded(path: Path) -> dict[str, Any]:
    with Image.open(path) as picture:
        width, height = picture.size
    kind = "jpeg" if path.suffix == ".jpg" else "png"
    return {"data": _data(path.read_bytes(), kind), "width": width, "height": height}


def _data(content: bytes, kind: str) -> str:
    return f"data:image/{kind};base64,{base64.b64encode(content).decode()}"
