"""The table of measured numbers in the README, from the results."""

from __future__ import annotations

import re
from pathlib import Path

import typer

from cdcp_igl.io import whole_file

from .measure import MACHINE, Machine
from .paper import published
from .report import Results
from .store import RESULTS, read_results

__all__ = ["readme"]

README = Path(__file__).parents[1] / "README.md"
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


def readme(machine: Machine = MACHINE) -> None:
    """Rewrite the table between the two markers of README.md from the results."""
    results = RESULTS / f"{machine}.json"
    if not results.exists():
        raise typer.BadParameter(f"there is no {results}; first run: python -m benchmarks tables")
    about, records = read_results(results)
    text = README.read_text(encoding="utf-8")
    head, rest = text.split(BEGIN)
    _, tail = rest.split(END)
    table = _table(Results(records, "tables"))
    note = (
        "Mean / SD of the angular distortion in degrees, and time as a multiple of F, one CHOLMOD "
        f"analysis and factorization of L_II ({about['cores']} cores, {about['cpu']}, libigl "
        f"{about['versions']['libigl']}, scikit-sparse {about['versions']['scikit-sparse']}). "
        "LSCM is conformal but its image is no disk; the harmonic map is a disk but not "
        "conformal. Written by `python -m benchmarks readme`; all surfaces, the paper's own "
        f"numbers and the figures: [benchmarks/results](benchmarks/results/{machine}.md)."
    )
    with whole_file(README) as unfinished:
        unfinished.write_text(f"{head}{BEGIN}\n{table}\n\n{note}\n{END}{tail}", encoding="utf-8")


def _table(results: Results) -> str:
    rows = [
        "| surface | vertices | " + " | ".join(COLUMNS.values()) + " |",
        "|---" * (2 + len(COLUMNS)) + "|",
    ]
    for model in MODELS:
        row = published(model)
        name = row.name if row and row.own != "stand-in" else re.sub(r"_\d+$", "", model)
        cells = [_cell(results, model, method) for method in COLUMNS]
        vertices = results.first(model).vertices
        rows.append(f"| {name.replace('_', ' ')} | {vertices:,} | " + " | ".join(cells) + " |")
    return "\n".join(rows)


def _cell(results: Results, model: str, method: str) -> str:
    if results.failure(model, method):
        return "no map"
    mean, sd, flips, seconds = (
        results.median(model, method, of) for of in ("mean", "sd", "flips", "seconds")
    )
    folded = f", {flips:,.0f} flips" if flips else ""
    return f"{mean:.3f} / {sd:.3f}{folded} ({seconds / results.median(model, 'factor'):.1f} F)"
