"""The tables of the report: accuracy, time, speed, ablation, and all cases."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from statistics import median
from typing import Any

import numpy as np

from ..measure.ablation import ABLATIONS
from ..measure.methods import METHODS
from ..records.paper import PUBLISHED, row_of
from ..records.results import FROM, Measured, Section, growth
from .cells import (
    COLUMNS,
    case,
    distortion_cell,
    failure_cell,
    grid,
    in_order,
    model_cells,
    seconds_cell,
)
from .comparisons import paired_table, peer_tables, summary_table
from .figures.style import style
from .table import NOTHING, Cell, Row, Table, number

# Methods that are what others are measured by, or have tables of their own.
UNITS = ("factor", "cdcp warm", "cdcp sequence", "import")


def about(machine: Mapping[str, Any]) -> list[tuple[str, str]]:
    """List what the numbers were measured on, with what, and how to do it again."""
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
        (
            "cdcp_igl",
            f"{machine['cdcp_igl']}, commit {machine['commit']}, sources {machine['code']}",
        ),
        (
            "Limits",
            f"{machine['time_limit']:g} s and {machine['memory_limit']:,.0f} MiB for each case, "
            "in a process of its own",
        ),
        ("Again", " && ".join(dict.fromkeys(machine["commands"].values()))),
    ]


def tables(measured: Measured) -> Iterator[Table]:
    """Make the tables of all sections."""
    sections = {
        **{"tables": _accuracy, "peers": peer_tables, "speed": _speed, "growth": _growth},
        "ablation": _ablation,
    }
    for section, make in sections.items():
        if section in measured.sections:
            made = make(measured.sections[section])
            yield from (table for table in made if table.rows)


def cases(results: Section) -> Table:
    """Make the table with a row for each method on each surface."""
    methods = in_order(results.maps)
    return Table(
        "cases",
        "All cases",
        "Every method on every surface. Area is the mean |log of the ratio of areas|; the boundary "
        "error is the largest deviation from the unit circle.",
        ["surface", "n", *COLUMNS],
        [
            [*model_cells(results, model), *case(results, model, method)]
            for model in results.sizes
            if any(results.of(model, method) for method in methods)
            for method in methods
        ],
    )


def _accuracy(results: Section) -> Iterator[Table]:
    def paper_distortion(model: str) -> Row:
        row = row_of(model)
        pairs = zip(row.mean, row.sd, strict=True) if row else []
        texts = [f"{mean:.2f} / {sd:.2f}" for mean, sd in pairs]
        return _published(model, texts, row.mean if row else ())

    def paper_seconds(model: str) -> Row:
        row = row_of(model)
        seconds = row.seconds if row else ()
        return _published(model, [f"{s:.2f}" for s in seconds], seconds)

    methods = in_order(results.maps)
    labels = [style(method).label for method in methods]
    if len(results.mapped) > 1:
        yield summary_table(results, methods)
        yield paired_table(results, methods)
    headings = ["surface", "n", *labels, *(f"paper: {style(m).label}" for m in PUBLISHED)]
    yield Table(
        "distortion",
        "Table 1: angular distortion",
        "Mean / SD over all corners in degrees, and flipped faces if there are any. A free "
        "boundary is conformal but no disk: compare it on angles only; the harmonic map is a disk "
        "but not conformal. Numbers of the paper in brackets belong to its own surface, for which "
        "another of similar size stands.",
        headings,
        grid(results, methods, distortion_cell(results, ".3f"), paper_distortion),
    )
    yield Table(
        "time",
        "Table 2: seconds",
        "From arrays to map, in brackets as a multiple of F, one CHOLMOD analysis (AMD) and "
        "factorization of the interior Laplacian in the same run. The paper's are of MATLAB on "
        "another machine: compare ratios.",
        headings,
        grid(results, methods, seconds_cell(results, "factor", "F"), paper_seconds),
    )


def _published(model: str, texts: Sequence[str], values: Sequence[float]) -> Row:
    row = row_of(model)
    if row is None:
        return [Cell(NOTHING)] * len(PUBLISHED)
    form = "{}" if row.own == "own" else "({})"
    return [Cell(form.format(text), value) for text, value in zip(texts, values, strict=True)]


def _speed(results: Section) -> Iterator[Table]:
    methods = results.methods(m for m in METHODS if m not in UNITS)
    labels = [style(method).label for method in methods]
    large = [model for model in results.sizes if results.of(model, "factor")]

    def times(model: str, method: str) -> Cell:
        runs = results.of(model, method)
        values = [run.case.seconds / results.median(model, "factor") for run in runs]
        spread = f"({min(values):.2f}–{max(values):.2f})" if len(values) > 1 else "(one run)"
        return number(median(values), lambda value: f"{value:.2f} {spread}")

    def memory(model: str, method: str) -> Cell:
        peak, unit = (results.median(model, m, "memory") for m in (method, "factor"))
        return number(peak / unit, ".2f")

    yield Table(
        "factor",
        "The unit of time",
        "F is one CHOLMOD analysis (AMD) and factorization of the interior Laplacian, measured in "
        "the same run in processes of its own. Medians (least–greatest) of fresh processes; the "
        "methods take turns.",
        ["surface", "n", "F, s", "runs", "analysis, s", "peak, MiB"],
        [[*model_cells(results, model), *_unit(results, model)] for model in large],
    )
    for id, title, text, cell in (
        ("multiples", "Time as a multiple of F", "", times),
        ("peak", "Peak memory as a multiple of that of F", "Python and mesh in both.", memory),
    ):
        rows = [row for row in grid(results, methods, cell) if row[0].model in large]
        yield Table(id, title, text, ["surface", "n", *labels], rows)
    yield Table(
        "steps",
        "T, the time of CDCP, and the others",
        "A step of refinement: the first is refine=1 less CDCP, the further ones (refine=5 less "
        "refine=1)/4.",
        ["surface", "n", "T, s", "LSCM/T", "harmonic/T", "first step/T", "further steps/T"],
        [[*model_cells(results, model), *_by_cdcp(results, model)] for model in large],
    )
    yield Table(
        "small",
        "Once imported, and the import",
        "Milliseconds: medians (least–greatest) of many calls of `cdcp` in one process, and of "
        "`import cdcp_igl` in fresh processes.",
        ["what", "ms"],
        list(_small(results)),
    )
    yield Table(
        "sequences",
        "Sequences",
        "The same faces with moved vertices, in one process: T is `disk_map`, S is "
        "`DiskMapper.moved(V).map()`, which keeps the check of the faces and the analysis of the "
        "factor. Medians.",
        ["surface", "n", "T, s", "S, s", "S/T", "maps a second"],
        list(_sequences(results)),
    )


def _growth(results: Section) -> Iterator[Table]:
    n = np.array(list(results.mapped.values()), dtype=float)
    columns = [("factor", "seconds"), ("cdcp", "seconds"), ("factor", "memory"), ("cdcp", "memory")]
    values = [results.values(method, name) for method, name in columns]
    exponents = [growth(n, column)[0] for column in values]
    rows = [
        [*model_cells(results, model), *(number(column[i], ",.4g") for column in values)]
        for i, model in enumerate(results.mapped)
    ]
    fitted = [Cell("exponent of n", kind="name"), Cell(f"from {FROM:,}")]
    yield Table(
        "growth",
        "Growth",
        "One terrain, each triangle cut into four again and again: seconds and peak MiB of F and "
        f"of CDCP, and the power of n that fits those with {FROM:,} vertices or more.",
        ["surface", "n", "F, s", "T, s", "F, MiB", "T, MiB"],
        [*rows, [*fitted, *(number(p, ".2f") for p in exponents)]],
    )


def _unit(results: Section, model: str) -> Row:
    failure, runs = failure_cell(results, model, "factor"), results.of(model, "factor")
    if failure:
        return [failure, Cell(str(len(runs))), Cell(NOTHING), Cell(NOTHING)]
    seconds = [run.case.seconds for run in runs]
    return [
        _spread(seconds, ".3g"),
        Cell(str(len(runs))),
        number(median(run.case.details["seconds"]["analyse"] for run in runs), ".2g"),
        number(results.median(model, "factor", "memory"), ",.0f"),
    ]


def _spread(values: Sequence[float], form: str) -> Cell:
    text = f"({min(values):{form}}–{max(values):{form}})"
    return number(median(values), lambda value: f"{value:{form}} {text}")


def _by_cdcp(results: Section, model: str) -> Row:
    T, one, five, lscm, harmonic = (
        results.median(model, method)
        for method in ("cdcp", "cdcp refine=1", "cdcp refine=5", "lscm", "harmonic")
    )
    ratios = [lscm / T, harmonic / T, (one - T) / T, (five - one) / 4 / T]
    return [number(T, ".3g"), *(number(ratio, ".2f") for ratio in ratios)]


def _small(results: Section) -> Iterator[Row]:
    for model in results.sizes:
        for method, text in (("cdcp warm", f"`cdcp` on {model}"), ("import", "`import cdcp_igl`")):
            ms = [1000 * run.case.seconds for run in results.of(model, method) if run.ok]
            if ms:
                yield [Cell(text, kind="text name"), _spread(ms, ".4g")]


def _sequences(results: Section) -> Iterator[Row]:
    for model in results.sizes:
        runs = [run for run in results.of(model, "cdcp sequence") if run.ok]
        if runs:
            S = median(run.case.seconds for run in runs)
            T = median(run.case.details["seconds"]["afresh"] for run in runs)
            values = number(T, ".3g"), number(S, ".3g"), number(S / T, ".2f"), number(1 / S, ".2g")
            yield [*model_cells(results, model), *values]


def _ablation(results: Section) -> Iterator[Table]:
    headings = ["variant", *(model_cells(results, model)[0].text for model in results.sizes)]

    def rows(cell: Callable[[str, str], Cell]) -> list[Row]:
        return [
            [
                Cell(variant, kind="text name"),
                *(failure_cell(results, m, variant) or cell(m, variant) for m in results.sizes),
            ]
            for variant in results.methods(ABLATIONS)
        ]

    def seconds(model: str, variant: str) -> Cell:
        return number(results.median(model, variant) / results.median(model, "default"), ".2f")

    yield Table(
        "ablation",
        "Ablation",
        "CDCP with one step changed and without fallbacks: mean / SD of the angular distortion in "
        'degrees. "default" is torsion with a well-shaped face, whitened exterior trace, zipper, '
        "Möbius for least angular distortion; the other centres are the most central face whatever "
        "its shape.",
        headings,
        rows(distortion_cell(results, ".4f")),
    )
    yield Table(
        "ablation-time",
        "Ablation: time as a multiple of the default",
        "One run each: a hint only.",
        headings,
        rows(seconds),
    )
