"""What the cells of the tables of the report say."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from ..records.paper import PUBLISHED, published
from ..records.results import Section
from .figures.style import STYLES, in_words, style
from .table import NOTHING, Cell, Row, best, number

COLUMNS = (
    *("method", "mean °", "SD °", "max °", "area", "flips", "boundary error", "s", "s / F"),
    *("MiB", "outcome"),
)
FORMATS = {
    **{"mean": ".3f", "sd": ".3f", "max": ".1f", "area": ".3f", "flips": ",.0f"},
    **{"boundary_error": ".0e", "seconds": ".3g"},
}


def case(results: Section, model: str, method: str) -> Row:
    """Make the row of a method, under `COLUMNS`."""
    outcome = results.failure(model, method) or "ok"
    cells = [Cell(style(method).label, kind="text name")]
    free = any(record.case.boundary == "free" for record in results.of(model, method))
    for name, form in FORMATS.items():
        hidden = free and name == "boundary_error"
        cells.append(number(np.nan if hidden else results.median(model, method, name), form))
    ratio = results.median(model, method) / results.median(model, "factor")
    cells += [number(ratio, ".2f"), number(results.median(model, method, "memory"), ",.0f")]
    return [*cells, Cell(outcome, kind="text" if outcome == "ok" else "text missing")]


def in_order(methods: Iterable[str]) -> list[str]:
    """Those of the paper first, then as in the legends."""
    known = list(STYLES)
    return sorted(methods, key=lambda m: known.index(m) if m in known else len(known))


def model_cells(results: Section, model: str) -> Row:
    """Name, what it stands for, and size."""
    row, there = published(model), results.mapped.get(model, 0)
    name = in_words(model, there)
    name = model if name in results.sizes else name  # another one is called so
    name += ", opened" * (model in results.opened)
    if row:
        other = f", for {row.name}" if row.own == "stand-in" else f" ({row.own})"
        name = row.name if row.own == "own" else name + other
    return [Cell(name, kind="text name", model=model), number(there or np.nan, ",.0f")]


def grid(
    results: Section,
    methods: Sequence[str],
    cell: Callable[[str, str], Cell],
    paper: Callable[[str], Row] = lambda model: [],
) -> list[Row]:
    """One row a model, one column a method."""
    rows = []
    for model in results.sizes:
        made = [failure_cell(results, model, m) or cell(model, m) for m in methods]
        compared = [k for k, method in enumerate(methods) if method in PUBLISHED]
        made = best(made, compared) if len(compared) > 1 else made
        rows.append([*model_cells(results, model), *made, *paper(model)])
    return rows


def failure_cell(results: Section, model: str, method: str) -> Cell | None:
    """Say why there is no number; None if there is one."""
    outcome = results.failure(model, method)
    if outcome in ("", "not run"):
        return Cell(NOTHING) if outcome else None
    missing = outcome.startswith("not to be had")
    return Cell(NOTHING if missing else "no map", note=outcome, kind="missing")


def distortion_cell(results: Section, form: str) -> Callable[[str, str], Cell]:
    """Write mean and SD of the angular distortion, and flips."""

    def cell(model: str, method: str) -> Cell:
        mean, sd, flips = (results.median(model, method, q) for q in ("mean", "sd", "flips"))
        folded = f", {flips:,.0f} flips" if flips > 0 else ""
        return Cell(f"{mean:{form}} / {sd:{form}}{folded}", mean)

    return cell


def seconds_cell(results: Section, unit: str, letter: str) -> Callable[[str, str], Cell]:
    """Write seconds, in brackets as a multiple of the time of a method."""

    def cell(model: str, method: str) -> Cell:
        time, one = results.median(model, method), results.median(model, unit)
        multiple = f" ({time / one:.3g} {letter})" if one > 0 else ""
        return Cell(f"{time:.3g}{multiple}", time)

    return cell
