"""The tables over many surfaces, and those of other programs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ..measure.methods import METHODS
from ..records.comparison import QUANTITIES, paired, summary
from ..records.results import Section
from .cells import distortion_cell, grid, seconds_cell
from .figures.style import style
from .table import NOTHING, Cell, Table, number


def summary_table(results: Section, methods: Sequence[str]) -> Table:
    """Make the table with a row for each method: how often, how good, how fast."""
    table, rows = summary(results), []
    for method in methods:
        of = table.loc[method]
        row = [Cell(style(method).label, kind="text name"), number(of["surfaces"], ".0f")]
        row += [number(100 * of[share], ".3g") for share in ("mapped", "unflipped")]
        for name in QUANTITIES:
            low, middle, high = (of[f"{name} {q}"] for q in (0.25, 0.5, 0.75))
            text = f"{middle:.3g} ({low:.3g}–{high:.3g})"
            row.append(Cell(text, middle) if middle == middle else Cell(NOTHING))
        rows.append(row)
    return Table(
        "summary",
        "Over all surfaces",
        "Share of the surfaces that a method maps (onto the disk: certified), and without a "
        "flipped face; then median (quartiles) over those that it maps: who fails on the hard "
        "ones has the lower numbers. Seconds of cases that ran side by side are a hint.",
        [
            *("method", "surfaces", "mapped, %", "no flips, %", "mean °", "SD °", "area"),
            *("s", "MiB"),
        ],
        rows,
    )


def paired_table(results: Section, methods: Sequence[str]) -> Table:
    """Make the table of CDCP against each other method, with tests."""
    names = {"mean": "mean °", "sd": "SD °", "seconds": "s"}
    rows = []
    for method in (m for m in methods if m != "cdcp" and "cdcp" in methods):
        for name, label in names.items():
            made = paired(results, "cdcp", method, name)
            counts = [number(k, ".0f") for k in (made.lower, made.higher, made.ties)]
            tests = [number(p, ".2g") for p in (made.sign, made.signed_rank)]
            titles = [Cell(style(method).label, kind="text name"), Cell(label, kind="text")]
            rows.append([*titles, *counts, number(made.median, ".2g"), *tests])
    return Table(
        "paired",
        "CDCP against each other method",
        "On the surfaces that both map: on how many CDCP has less, more, or as much (to a "
        "millionth), the median of the differences, and two-sided p-values of the sign test and "
        "of Wilcoxon's signed-rank test. A free boundary has less to keep, and less distortion.",
        ["against", "of", "less", "more", "equal", "difference", "p, sign", "p, signed rank"],
        rows,
    )


def peer_tables(results: Section) -> Iterator[Table]:
    """Make the tables of other programs."""

    def heading(method: str) -> str:
        label, of = style(method).label, METHODS[method]
        free = of.boundary == "free" and "free boundary" not in label
        marks = ["not certified" if of.onto_disk else "free boundary"] * free
        return ", ".join([label, *marks, *["single precision"] * of.single])

    headings = ["surface", "n", *(heading(method) for method in results.maps)]
    yield Table(
        "peers",
        "Other programs: angular distortion",
        "Mean / SD over all corners in degrees, and flipped faces if there are any. A map with "
        "free boundary is onto no disk: compare it on angles only. MeshLab's harmonic map and BFF "
        "disk are onto the disk, but in too few digits for a certificate. SLIM, ARAP and Blender's "
        "minimum stretch keep lengths, which costs angles.",
        headings,
        grid(results, results.maps, distortion_cell(results, ".3f")),
    )
    yield Table(
        "peers-time",
        "Other programs: seconds",
        "From arrays to map, in brackets as a multiple of T, the time of CDCP. Programs that work "
        "on files have their writing and reading counted.",
        headings,
        grid(results, results.maps, seconds_cell(results, "cdcp", "T")),
    )
