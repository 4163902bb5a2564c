"""The report for the browser: self-contained HTML, one file and one for each surface."""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined, select_autoescape
from matplotlib import colormaps
from matplotlib.colors import to_hex
from PIL import Image

from cdcp_igl.io import whole_file

from .ablation import ABLATIONS
from .figures import Measured, NotMeasured, encode
from .figures.accuracy import histogram
from .figures.style import STYLES, model_name, style
from .findings import findings
from .methods import maps
from .paper import PUBLISHED, published, row_of
from .raster import Bytes
from .scene import SCALE, Scene
from .store import EDGES, Record

__all__ = ["write_pages"]

PIXELS = 300  # of the pictures on the page of a surface
MOST = 0.95  # of the corners are within the colour scale of the angular distortion

TEMPLATES = Environment(
    loader=FileSystemLoader(Path(__file__).parent / "templates"),
    autoescape=select_autoescape(["html"]),
    undefined=StrictUndefined,
    trim_blocks=True,
)


@dataclass(frozen=True)
class Cell:
    """Of a table: what is read, what it is sorted by, and how it looks."""

    text: str
    value: float | None = None
    title: str = ""
    kind: str = ""
    link: str = ""


def write_pages(
    folder: Path,
    machine: Mapping[str, Any],
    measured: Measured,
    figures: Sequence[Mapping[str, Any]],
    advance: Callable[[str], None],
) -> Path:
    """Write index.html and a page for each surface.

    Parameters
    ----------
    folder : Path
    machine : mapping
        As `benchmarks.machine.describe` returns it.
    measured : Measured
    figures : sequence of mapping
        ``title``, ``caption``, ``id``, and ``file`` (Path), or ``missing`` (why there is none).
    advance : callable
        Called with the name of a surface before its page is made.

    Returns
    -------
    Path
        The index.
    """
    links = {}
    for model in measured.sizes:
        advance(model)
        links[model] = _write_model(folder, measured, model)
    index = folder / "index.html"
    shown = [f | _embedded(f["file"]) if "file" in f else f | {"data": ""} for f in figures]
    _render(
        index,
        "index.html",
        about=_about(machine),
        findings=findings(measured),
        sections=list(_sections(measured, {model: link["link"] for model, link in links.items()})),
        figures=shown,
        models=list(links.values()),
    )
    return index


def _render(path: Path, template: str, **content: Any) -> None:
    steps = (to_hex(colormaps[SCALE](t)) for t in np.linspace(0, 1, 9))
    text = TEMPLATES.get_template(template).render(scale=", ".join(steps), **content)
    with whole_file(path) as unfinished:
        unfinished.write_text(text, encoding="utf-8")


def _about(machine: Mapping[str, Any]) -> list[tuple[str, str]]:
    versions = machine["versions"] | {
        "Python": machine["python"],
        "SuiteSparse": machine["suitesparse"],
    }
    return [
        ("Hardware", f"{machine['cpu']}, {machine['cores']} cores, {machine['memory_gib']} GiB"),
        ("System", machine["system"]),
        ("Versions", ", ".join(f"{name} {version}" for name, version in versions.items())),
        ("BLAS", f"{', '.join(machine['blas'])}, threads: {machine['blas_threads']}"),
        ("Date", machine["date"]),
        ("cdcp_igl", f"{machine['cdcp_igl']}, commit {machine['commit']}"),
        (
            "Limits",
            f"{machine['time_limit']:g} s and {machine['memory_limit']:,.0f} MiB for each case, "
            "in a process of its own",
        ),
        ("Again", f"{machine['command']} && python -m benchmarks figures"),
    ]


# -- tables ----------------------------------------------------------------------------


def _sections(measured: Measured, links: Mapping[str, str]) -> Iterator[dict[str, Any]]:
    tables = measured.sections.get("tables")
    if tables:
        methods = _in_order(tables.methods(maps()))
        labels = [style(method).label for method in methods]
        paper = [f"paper: {style(method).label}" for method in PUBLISHED]
        yield {
            "id": "distortion",
            "title": "Table 1: angular distortion",
            "text": "Mean / SD over all corners in degrees; columns sort by the mean. Why there is "
            "no map is told under All cases. A free boundary is conformal but no disk: compare it "
            "on angles only; the harmonic map is a disk but not conformal. Numbers of the paper "
            "in brackets belong to its own surface, for which another of similar size stands.",
            "headings": ["surface", "n", *labels, *paper],
            "rows": [
                [
                    *_model(measured, model, links),
                    *_best([_distortion(measured, "tables", model, m) for m in methods], methods),
                    *_published(model, "distortion"),
                ]
                for model in tables.models()
            ],
        }
        yield {
            "id": "time",
            "title": "Table 2: seconds",
            "text": "From arrays to map, in brackets as a multiple of one CHOLMOD analysis and "
            "factorization of the interior Laplacian in the same run. The paper's are of MATLAB on "
            "another machine: compare ratios.",
            "headings": ["surface", "n", *labels, *paper],
            "rows": [
                [
                    *_model(measured, model, links),
                    *(_seconds(measured, "tables", model, method) for method in methods),
                    *_published(model, "seconds"),
                ]
                for model in tables.models()
            ],
        }
    if "ablation" in measured.sections:
        results = measured.sections["ablation"]
        models = list(measured.models("ablation"))
        yield {
            "id": "ablation",
            "title": "Ablation",
            "text": "CDCP with one step changed and without fallbacks: mean / SD of the angular "
            "distortion in degrees. The default is torsion with a well-shaped face, the whitened "
            "exterior trace, the zipper, and Möbius for least angular distortion.",
            "headings": ["variant", *(_model(measured, model, {})[0].text for model in models)],
            "rows": [
                [
                    Cell(variant),
                    *(_distortion(measured, "ablation", model, variant) for model in models),
                ]
                for variant in results.methods(ABLATIONS)
            ],
        }
    if tables:
        yield {
            "id": "cases",
            "title": "All cases",
            "text": "Every method on every surface. Area is the mean |log of the ratio of areas|; "
            "the boundary error is the largest deviation from the unit circle.",
            "headings": ["surface", "n", *COLUMNS],
            "rows": [
                [*_model(measured, model, links), *_case(measured, model, method)]
                for model in tables.models()
                for method in methods
            ],
        }


COLUMNS = (
    *("method", "mean °", "SD °", "max °", "area", "flips", "boundary error", "s", "s / F"),
    *("MiB", "outcome"),
)
FORMATS = {
    **{"mean": ".3f", "sd": ".3f", "max": ".1f", "area": ".3f", "flips": ",.0f"},
    **{"boundary_error": ".0e", "seconds": ".3g"},
}


def _in_order(methods: Sequence[str]) -> list[str]:
    """Those of the paper first, then as in the legends."""
    return sorted(methods, key=list(STYLES).index)


def _model(measured: Measured, model: str, links: Mapping[str, str]) -> list[Cell]:
    n = measured.sizes.get(model, 0)
    row, note = published(model), ""
    if row:
        note = "the paper's" if row.own == "own" else f"for the paper's {row.name}"
        note = note if row.own in ("own", "stand-in") else f"{row.name}: {row.own}"
    name = model.removesuffix(f"_{n}").replace("_", " ")
    return [
        Cell(name, title=note, link=links.get(model, "")),
        Cell(f"{n:,}", n) if n else Cell("–"),
    ]


def _distortion(measured: Measured, section: str, model: str, method: str) -> Cell:
    results = measured.sections[section]
    failure = results.failure(model, method)
    if failure:
        return _failure(failure)
    mean, sd = (results.median(model, method, name) for name in ("mean", "sd"))
    return Cell(f"{mean:.3f} / {sd:.3f}", mean)


def _seconds(measured: Measured, section: str, model: str, method: str) -> Cell:
    results = measured.sections[section]
    failure = results.failure(model, method)
    if failure:
        return _failure(failure)
    seconds, unit = results.median(model, method), results.median(model, "factor")
    multiple = f" ({seconds / unit:.1f} F)" if unit > 0 else ""
    return Cell(f"{seconds:.3g}{multiple}", seconds)


def _failure(outcome: str) -> Cell:
    text = "–" if outcome == "not run" else "no map"
    return Cell(text, title=outcome, kind="missing")


def _best(cells: list[Cell], methods: Sequence[str]) -> list[Cell]:
    """Mark the least value among the published methods, all that read the same."""
    of = [k for k, m in enumerate(methods) if m in PUBLISHED and cells[k].value is not None]
    least = min((round(cells[k].value or 0, 3) for k in of), default=None)
    return [
        Cell(cell.text, cell.value, cell.title, "best")
        if k in of and round(cell.value or 0, 3) == least
        else cell
        for k, cell in enumerate(cells)
    ]


def _published(model: str, quantity: str) -> list[Cell]:
    row = row_of(model)
    if row is None:
        return [Cell("–") for _ in PUBLISHED]
    form = "{}" if row.own == "own" else "({})"
    if quantity == "seconds":
        return [Cell(form.format(f"{s:.2f}"), s) for s in row.seconds]
    return [
        Cell(form.format(f"{mean:.2f} / {sd:.2f}"), mean)
        for mean, sd in zip(row.mean, row.sd, strict=True)
    ]


def _case(measured: Measured, model: str, method: str) -> list[Cell]:
    results = measured.sections["tables"]
    outcome = results.failure(model, method) or "ok"
    cells = [Cell(style(method).label, kind="text name")]
    for name, form in FORMATS.items():
        value = results.median(model, method, name)
        free = name == "boundary_error" and method in ("lscm", "spectral")
        cells.append(Cell("–") if np.isnan(value) or free else Cell(format(value, form), value))
    ratio = results.median(model, method) / results.median(model, "factor")
    memory = results.median(model, method, "memory")
    cells.append(Cell("–") if np.isnan(ratio) else Cell(f"{ratio:.2f}", ratio))
    cells.append(Cell("–") if np.isnan(memory) else Cell(f"{memory:,.0f}", memory))
    return [*cells, Cell(outcome, kind="text" if outcome == "ok" else "text missing")]


# -- the page of a surface -------------------------------------------------------------


def _write_model(folder: Path, measured: Measured, model: str) -> dict[str, str]:
    """Write the page and return how the index refers to it."""
    name = model_name(model, measured.sizes[model])
    try:
        V, F = measured.surface(model)
    except NotMeasured as error:
        return {"name": name, "link": "", "missing": str(error)}
    results = measured.sections.get("tables") or next(iter(measured.sections.values()))
    methods = _in_order(results.methods(maps()))
    scene = Scene(V, F.astype(np.int64), PIXELS)
    most = _most(results.of(model, "cdcp"))
    surface = _webp(scene.by_normal())
    shown = []
    for method in methods:
        drawn: dict[str, Any] = {"label": style(method).label, "numbers": "", "disk": ""}
        uv = measured.map(model, method)
        if uv is None:
            drawn["missing"] = results.failure(model, method) or "its map was not kept"
        else:
            drawn["numbers"] = _distortion(measured, "tables", model, method).text + " degrees"
            drawn["disk"] = _webp(scene.disk(uv))
            drawn["checkerboard"] = _webp(scene.checkerboard(uv))
            drawn["distortion"] = _webp(scene.distortion(uv, most))
        shown.append(drawn)
    try:
        counted = {"data": _data(encode(histogram(measured, model), ".png"), "png")} | HISTOGRAM
    except NotMeasured as error:
        counted = {"data": "", "missing": str(error)}
    file = folder / f"{model.replace('/', '_').replace(' ', '_')}.html"
    _render(
        file,
        "model.html",
        name=name,
        surface=surface,
        about=list(_facts(results.first(model), results.of(model, "cdcp"))),
        headings=list(COLUMNS),
        rows=[_case(measured, model, method) for method in methods],
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


def _facts(of: Record, cases: Sequence[Record]) -> Iterator[tuple[str, str]]:
    yield "Vertices", f"{of.vertices:,}"
    yield "Faces", f"{of.faces:,}"
    yield "Boundary vertices", f"{of.boundary_vertices:,}"
    row = published(of.model)
    if row:
        yield "In the paper", row.name if row.own == "own" else f"{row.name} ({row.own})"
    if cases and cases[0].ok and "boundary" in cases[0].details:
        details = cases[0].details
        yield "Boundary map of CDCP", details["boundary"]["method"]
        repair = details["repair"]
        flipped, rounds = repair["flipped_faces"], repair["rounds"]
        yield "Repair", f"{flipped:,} faces in {rounds} rounds" if flipped else "not needed"
        w = np.hypot(*details["mobius"]["w"])
        yield "Möbius", f"{details['mobius']['method']}, |w| = {w:.4f}"
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
