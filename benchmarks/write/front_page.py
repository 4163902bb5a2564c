"""The table of measured numbers in the README, from the results."""

from __future__ import annotations

from pathlib import Path

from cdcp_igl.io import whole_file

from ..records.results import Section
from ..records.store import ROOT, read_results
from .sections import model_cells
from .table import Cell, Table, markdown

__all__ = ["BEGIN", "END", "MODELS", "README", "rewrite"]

README = ROOT / "README.md"
BEGIN, END = "<!-- measured: begin -->", "<!-- measured: end -->"

MODELS = ("chinese_lion", "human_face", "human_brain", "left_hand", "gcanyon_996999")
COLUMNS = {
    "cdcp": "**CDCP**",
    "cdcp refine=5": "**CDCP, refine=5**",
    "fdcp": "FDCP",
    "ldcp": "LDCP",
    "harmonic": "harmonic, arc length",
    "lscm": "LSCM, *free boundary*",
}


def rewrite(page: Path, results: Path) -> None:
    """Rewrite the table between the two markers of a page."""
    about, records = read_results(results)
    head, rest = page.read_text(encoding="utf-8").split(BEGIN)
    _, tail = rest.split(END)
    section = Section(record for record in records if record.section == "tables")
    table = Table(
        *("readme", "", "", ["surface", "vertices", *COLUMNS.values()]),
        [
            [*model_cells(section, model), *(_cell(section, model, m) for m in COLUMNS)]
            for model in MODELS
        ],
    )
    note = (
        "Mean / SD of the angular distortion in degrees, and time as a multiple of F, one CHOLMOD "
        f"analysis and factorization of L_II ({about['cores']} cores, {about['cpu']}, libigl "
        f"{about['versions']['libigl']}, scikit-sparse {about['versions']['scikit-sparse']}). "
        "LSCM is conformal but its image is no disk; the harmonic map is a disk but not "
        "conformal. Written by `python -m benchmarks readme`; all surfaces, the paper's own "
        f"numbers and the figures: [benchmarks/results](benchmarks/results/{results.stem}.md)."
    )
    with whole_file(page) as unfinished:
        text = f"{head}{BEGIN}\n{markdown(table)}\n\n{note}\n{END}{tail}"
        unfinished.write_text(text, encoding="utf-8")


def _cell(results: Section, model: str, method: str) -> Cell:
    if results.failure(model, method):
        return Cell("no map")
    mean, sd, flips, seconds = (
        results.median(model, method, of) for of in ("mean", "sd", "flips", "seconds")
    )
    folded = f", {flips:,.0f} flips" if flips else ""
    unit = results.median(model, "factor")
    return Cell(f"{mean:.3f} / {sd:.3f}{folded} ({seconds / unit:.1f} F)", mean)
