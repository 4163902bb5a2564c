"""The table of measured numbers in the README, from the results."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from cdcp_igl.io.output import whole_file

from ..records.results import Measured, Section
from ..records.store import ROOT, read_results
from .figures.style import style
from .sections import model_cells
from .table import NOTHING, Cell, Table, markdown

README = ROOT / "README.md"
BEGIN, END = "<!-- measured: begin -->", "<!-- measured: end -->"

MODELS = (
    *("chinese_lion", "human_face", "human_brain", "left_hand", "camelhead_11381", "femur_2411"),
    "gcanyon_216196",
)
METHODS = {
    **{"cdcp": "disk", "cdcp refine=5": "disk", "fdcp": "disk", "ldcp": "disk"},
    **{"harmonic": "disk", "BFF disk": "disk", "lscm": "free", "BFF free": "free"},
    **{"Blender angle-based": "free", "Blender conformal": "free", "MeshLab LSCM": "free"},
    **{"SLIM conformal": "free", "SLIM": "free"},
}


def rewrite(page: Path, results: Path) -> None:
    """Rewrite the table between the two markers of a page."""
    about, records = read_results(results)
    head, rest = page.read_text(encoding="utf-8").split(BEGIN)
    _, tail = rest.split(END)
    sections = Measured(records).sections
    shown = [sections[name] for name in ("tables", "peers") if name in sections]
    rows = [
        [
            Cell(style(method).label.removesuffix(", free boundary"), kind="text name"),
            Cell(boundary, kind="text"),
            *(_cell(shown, model, method) for model in MODELS),
        ]
        for method, boundary in METHODS.items()
    ]
    measured = [row for row in rows if any(cell.value is not None for cell in row)]
    names = [_name(shown[0], model) for model in MODELS]
    table = Table("readme", "", "", ["method", "boundary", *names], measured)
    versions = ", ".join(f"{name} {number}" for name, number in about["versions"].items())
    note = (
        "Mean / SD / greatest angular distortion in degrees, flipped faces if there are any, and "
        "time as a multiple of T, the time of CDCP in the same run: a hint, as `make bench` runs "
        "two cases side by side; times measured alone are in the results. A free boundary has less "
        "to keep, so less distortion, but its image is no disk; the harmonic map is onto the disk "
        "but not conformal; SLIM keeps lengths rather than angles unless told so. "
        f"{about['cores']} cores, {about['cpu']}; {versions}. Written by "
        "`python -m benchmarks readme`; all surfaces, the paper's own numbers and the figures: "
        f"[benchmarks/results](benchmarks/results/{results.stem}.md)."
    )
    with whole_file(page) as unfinished:
        text = f"{head}{BEGIN}\n{markdown(table)}\n\n{note}\n{END}{tail}"
        unfinished.write_text(text, encoding="utf-8")


def _name(results: Section, model: str) -> str:
    """Name a surface and its size, without what it stands for."""
    name, size = (cell.text for cell in model_cells(results, model))
    return f"{name.partition(', for ')[0].partition(' (')[0]} {size}"


def _cell(sections: Sequence[Section], model: str, method: str) -> Cell:
    """Take the numbers of the first section in which the method was run."""
    results = next((s for s in sections if s.of(model, method)), None)
    if results is None:
        return Cell(NOTHING)
    if results.failure(model, method):
        return Cell("no map")
    mean, sd, most, flips, seconds = (
        results.median(model, method, of) for of in ("mean", "sd", "max", "flips", "seconds")
    )
    folded = f", {flips:,.0f} flips" if flips else ""
    times = seconds / results.median(model, "cdcp")
    return Cell(f"{mean:.3f} / {sd:.3f} / {most:.0f}{folded} ({times:.3g} T)", mean)
