"""The tables of the report: accuracy, time, speed, ablation, other programs, and all cases."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from statistics import median
from typing import Any

import numpy as np

from ..measure.ablation import ABLATIONS
from ..measure.families import FAMILIES, GIVEN, family_of
from ..measure.mechanisms import ALL, RESCUES
from ..measure.methods import METHODS
from ..records.comparison import QUANTITIES, paired, ranking, summary
from ..records.paper import PUBLISHED, published, row_of
from ..records.results import FROM, Measured, Section, growth
from .figures.style import STYLES, in_words, style
from .table import NOTHING, Cell, Row, Table, best, number

COLUMNS = (
    *("method", "mean °", "SD °", "max °", "area", "flips", "boundary error", "s", "s / F"),
    *("MiB", "outcome"),
)
FORMATS = {
    **{"mean": ".3f", "sd": ".3f", "max": ".1f", "area": ".3f", "flips": ",.0f"},
    **{"boundary_error": ".0e", "seconds": ".3g"},
}

# Methods that are what others are measured by, or have tables of their own.
UNITS = ("factor", "cdcp warm", "cdcp sequence", "import")
PAIRED = ("cdcp", "cdcp refine=5")  # against which all others are tested
FAMILY_TITLES = {"disk": "onto the disk", "free": "free outline", "sphere": "onto the sphere"}
PURPOSES = {
    **{"mean": "least mean angular distortion", "sd": "least SD of it", "area": "evenest areas"},
    **{"seconds": "least time", "memory": "least memory"},
}
RANKED = 3  # methods that are named for each purpose
CHANGED = 0.05  # of the mean angular distortion, from which on a map is another one


def about(machine: Mapping[str, Any]) -> list[tuple[str, str]]:
    """List what the numbers were measured on, with what, and how to do it again."""
    versions = machine["versions"] | {"Python": machine["python"]}
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
        **{"ablation": _ablation, "rescue": rescue_tables},
    }
    for section, make in sections.items():
        if section in measured.sections:
            made = make(measured.sections[section])
            yield from (table for table in made if table.rows)


def cases(results: Section) -> Table:
    """Make the table with a row for each method on each surface."""
    methods = in_order(results)
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

    methods = in_order(results)
    if len(results.mapped) > 1:
        yield best_table(results)
        yield summary_table(results, methods)
        yield from (paired_table(results, base, methods) for base in PAIRED if base in methods)
    for family, title in FAMILY_TITLES.items():
        members = [method for method in methods if results.family[method] == family]
        if not members:
            continue
        with_paper = family == "disk" and any(row_of(model) for model in results.sizes)
        headings = ["surface", "n", *(style(method).label for method in members)]
        headings += [f"paper: {style(m).label}" for m in PUBLISHED] * with_paper
        yield Table(
            f"distortion-{family}",
            f"Table 1: angular distortion, {title}",
            "Mean / SD over all corners in degrees, and flipped faces if there are any. A free "
            "boundary has less to keep: compare it on angles only. Numbers of the paper in "
            "brackets belong to its own surface, for which another of similar size stands.",
            headings,
            grid(
                *(results, members, distortion_cell(results, ".3f")),
                *([paper_distortion] * with_paper),
            ),
        )
        yield Table(
            f"time-{family}",
            f"Table 2: seconds and memory, {title}",
            "From arrays to map, in brackets as a multiple of T, the time of CDCP in the same "
            "run; peak memory of the process. The paper's are of MATLAB on another machine: "
            "compare ratios.",
            headings,
            grid(
                *(results, members, seconds_cell(results, "cdcp", "T")),
                *([paper_seconds] * with_paper),
            ),
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

    cell = distortion_cell(results, ".4f")
    yield Table(
        "ablation",
        "Ablation",
        "CDCP with one step changed and without fallbacks: mean / SD of the angular distortion in "
        'degrees. "default" is torsion with a well-shaped face, whitened exterior trace, zipper, '
        "Möbius for least angular distortion; the other centres are the most central face whatever "
        "its shape.",
        headings,
        [
            [
                Cell(variant, kind="text name"),
                *(failure_cell(results, m, variant) or cell(m, variant) for m in results.sizes),
            ]
            for variant in results.methods(ABLATIONS)
        ],
    )


def rescue_tables(results: Section) -> Iterator[Table]:
    """Make the table with a row for each part of the rescue that is left out."""
    families = {
        family: [model for model in results.mapped if family_of(model) == family]
        for family in (*FAMILIES, GIVEN)
    }
    families = {family: models for family, models in families.items() if models}
    headings = [f"{family}, {len(models)}" for family, models in families.items()]
    yield Table(
        "rescue",
        "The rescue, without each of its parts",
        "In each family of disks: valid maps; conformal maps; maps that are worse + better by more "
        f"than {CHANGED:.0%} than with all of the rescue, lost ones worse; mean angular distortion "
        "over the valid maps; seconds, a hint.",
        ["CDCP with", *headings],
        [
            [
                Cell(method, kind="text name"),
                *(_rescued(results, method, models) for models in families.values()),
            ]
            for method in results.methods(RESCUES)
        ],
    )


def _rescued(results: Section, method: str, models: Sequence[str]) -> Cell:
    means, before = (
        np.array([results.median(model, name, "mean") for model in models])
        for name in (method, ALL)
    )
    worse = np.isnan(means) > np.isnan(before)
    better = np.isnan(means) < np.isnan(before)
    worse |= means > (1 + CHANGED) * before
    better |= means < (1 - CHANGED) * before
    conformal = sum(
        run.case.details["conformal"]
        for model in models
        for run in results.of(model, method)
        if run.ok
    )
    valid = np.isfinite(means).sum()
    mean = f"{np.nanmean(means):.2f}°" if valid else NOTHING
    seconds = np.nansum([results.median(model, method) for model in models])
    changed = f"{worse.sum()}+{better.sum()}"
    return Cell(f"{valid}; {conformal}; {changed}; {mean}; {seconds:.1f} s")


# -- many surfaces, other programs -------------------------------------------------------


def best_table(results: Section) -> Table:
    """Make the table of which method is best for what."""
    rows = []
    for family, title in FAMILY_TITLES.items():
        for name, purpose in PURPOSES.items():
            ranked = [
                Cell(f"{style(method).label}: {median:.3g} ({share:.0%})", kind="text")
                for method, median, share in ranking(results, family, name)[:RANKED]
            ]
            ranked += [Cell(NOTHING, kind="text")] * (RANKED - len(ranked))
            rows.append([Cell(f"{purpose}, {title}", kind="text name"), *ranked])
    return Table(
        "best",
        "Which method for what",
        "Of the methods that were run on all surfaces: the median of the ratio to the best one, "
        "and on which share of the surfaces it is that. No map, or one with flipped faces, is "
        "infinitely worse.",
        ["for", "first", "second", "third"],
        rows,
    )


def summary_table(results: Section, methods: Sequence[str]) -> Table:
    """Make the table with a row for each method: how often, how good, how fast."""
    table, rows = summary(results), []
    for method in methods:
        of = table.loc[method]
        family = FAMILY_TITLES[results.family[method]]
        row = [Cell(style(method).label, kind="text name"), Cell(family, kind="text")]
        row.append(number(of["surfaces"], ".0f"))
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
            *("method", "family", "surfaces", "mapped, %", "no flips, %", "mean °", "SD °"),
            *("area", "s", "MiB"),
        ],
        rows,
    )


def paired_table(results: Section, base: str, methods: Sequence[str]) -> Table:
    """Make the table of one method against each other, with tests."""
    names = {"mean": "mean °", "sd": "SD °", "seconds": "s"}
    rows = []
    for method in (m for m in methods if m != base):
        for name, label in names.items():
            made = paired(results, base, method, name)
            counts = [number(k, ".0f") for k in (made.lower, made.higher, made.ties)]
            tests = [number(p, ".2g") for p in (made.sign, made.signed_rank)]
            titles = [Cell(style(method).label, kind="text name"), Cell(label, kind="text")]
            rows.append([*titles, *counts, number(made.median, ".2g"), *tests])
    return Table(
        f"paired-{PAIRED.index(base)}",
        f"{style(base).label} against each other method",
        "On the surfaces that both map: on how many it has less, more, or as much (to a "
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
        "free boundary is onto no disk: compare it on angles only. MeshLab's harmonic map is "
        "onto the disk, but in too few digits for a certificate. SLIM, ARAP and Blender's "
        "minimum stretch keep lengths, which costs angles.",
        headings,
        grid(results, results.maps, distortion_cell(results, ".3f")),
    )
    yield Table(
        "peers-time",
        "Other programs: seconds and memory",
        "From arrays to map, in brackets as a multiple of T, the time of CDCP; peak memory of the "
        "process.",
        headings,
        grid(results, results.maps, seconds_cell(results, "cdcp", "T")),
    )


# -- cells and rows ----------------------------------------------------------------------


def case(results: Section, model: str, method: str) -> Row:
    """Make the row of a method, under `COLUMNS`."""
    outcome = results.failure(model, method) or "ok"
    cells = [Cell(style(method).label, kind="text name")]
    for name, form in FORMATS.items():
        hidden = results.family[method] == "free" and name == "boundary_error"
        cells.append(number(np.nan if hidden else results.median(model, method, name), form))
    ratio = results.median(model, method) / results.median(model, "factor")
    cells += [number(ratio, ".2f"), number(results.median(model, method, "memory"), ",.0f")]
    return [*cells, Cell(outcome, kind="text" if outcome == "ok" else "text missing")]


def in_order(results: Section) -> list[str]:
    """Methods that map, onto the disk first, then as in the legends."""
    known, families = [*STYLES, *results.maps], list(FAMILY_TITLES)
    return sorted(results.maps, key=lambda m: (families.index(results.family[m]), known.index(m)))


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
        if not any(results.of(model, method) for method in methods):
            continue
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
    """Write seconds, in brackets as a multiple of the time of a method, and peak memory."""

    def cell(model: str, method: str) -> Cell:
        time, one = results.median(model, method), results.median(model, unit)
        multiple = f" ({time / one:.3g} {letter})" if one > 0 else ""
        peak = f", {results.median(model, method, 'memory'):,.0f} MiB"
        return Cell(f"{time:.3g}{multiple}{peak}", time)

    return cell
