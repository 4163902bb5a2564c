"""The table of measured numbers in the README, from the results."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from statistics import median

from cdcp_igl.io.output import write_text

from ..records.comparison import ranking
from ..records.results import Measured, Section
from ..records.store import ROOT, read_results
from .figures.style import style
from .sections import FAMILY_TITLES, model_cells
from .table import Cell, Table, markdown, name, number

README = ROOT / "README.md"
BEGIN, END = "<!-- measured: begin -->", "<!-- measured: end -->"

MODELS = (
    *("chinese_lion", "human_face", "human_brain", "left_hand", "camelhead_11381", "femur_2411"),
    "gcanyon_216196",
)
SHOWN = ("human_face", "chinese_lion", "human_brain", "left_hand", "gcanyon_216196")
METHODS = (
    *("cdcp", "cdcp refine=5", "free refine=5", "lscm", "bff", "abf"),
    "Blender angle-based",
)


def rewrite(page: Path, file: Path) -> None:
    """Rewrite the table between the two markers of a page."""
    about, records = read_results(file)
    head, rest = page.read_text(encoding="utf-8").split(BEGIN)
    _, tail = rest.split(END)
    sections = Measured(records).sections
    # Other programs were measured beside CDCP, so that their times compare.
    results = sections.get("peers") or sections["tables"]
    names = [_name(results, model) for model in SHOWN]
    headings = ["method", "mean °", "flips", "time"]
    rows = [_row(results, method) for method in METHODS if _mapped(results, method)]
    table = Table("readme", "", "", headings, rows)
    note = (
        f"Mean angular distortion of {', '.join(names[:-1])} and {names[-1]} in degrees: their "
        "median (least–greatest); flipped faces on all five; median time as a multiple of CDCP's. "
        "The first two fill the disk; the others have a free outline, which has less to keep. "
        f"{_best(file, sections)}Measured on {about['cpu']}, {about['cores']} cores, commit "
        f"{about['commit']}, two cases side by side, by `make bench`; "
        f"[all numbers](benchmarks/results/{file.stem}.md)."
    )
    write_text(page, f"{head}{BEGIN}\n{markdown(table)}\n\n{note}\n{END}{tail}")


def _best(file: Path, sections: Mapping[str, Section]) -> str:
    """Say which method has the least mean, on many surfaces if they were measured."""
    tier = file.with_name(f"{file.stem}-standard.json")
    if tier.exists():
        sections = Measured(read_results(tier)[1]).sections
    results = sections.get("tables")
    if not results:
        return ""
    found = []
    for family, title in FAMILY_TITLES.items():
        for method, _, share in ranking(results, family, "mean")[:1]:
            found.append(f'{title} "{style(method).label}" (on {share:.0%})')
    page = f"[CDCP-bench standard](benchmarks/results/{tier.stem}.md)"
    of = page if tier.exists() else "the tables"
    mapped = len(results.mapped) - len(results.failed("cdcp"))
    of = f"{mapped} of the {len(results.mapped)} surfaces of {of}"
    return f"CDCP maps {of}. Least mean: {'; '.join(found)}. "


def _name(results: Section, model: str) -> str:
    """Name a surface, without what it stands for."""
    name, _ = (cell.text for cell in model_cells(results, model))
    return name.partition(", for ")[0].partition(" (")[0]


def _mapped(results: Section, method: str) -> list[str]:
    return [model for model in SHOWN if not results.failure(model, method)]


def _row(results: Section, method: str) -> list[Cell]:
    """Make the row of a method: its name, means, flipped faces, time; and where there is no map."""
    label = style(method).label.removesuffix(", free boundary")
    done = _mapped(results, method)
    means = [results.median(model, method, "mean") for model in done]
    flips = sum(results.median(model, method, "flips") for model in done)
    times = [results.median(model, method) / results.median(model, "cdcp") for model in done]
    lost = len([model for model in SHOWN if results.of(model, method)]) - len(done)
    ends = f"{median(means):.2f} ({min(means):.2f}–{max(means):.2f})"
    return [
        name(label),
        Cell(ends + f", no map of {lost}" * bool(lost)),
        Cell(f"{flips:,.0f}"),
        number(median(times), lambda t: f"{float(f'{t:.2g}'):,g}\N{NO-BREAK SPACE}×"),
    ]
