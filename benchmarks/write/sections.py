"""The tables of the report: accuracy, time, speed, ablation, other programs, and all cases."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from statistics import median
from typing import Any

import numpy as np

from ..measure.ablation import ABLATIONS, ALL, RESCUES
from ..measure.candidate import split
from ..measure.families import FAMILIES, GIVEN, family_of
from ..measure.methods import METHODS
from ..records.comparison import QUANTITIES, paired, ranking, summary
from ..records.paper import PUBLISHED, published, row_of
from ..records.results import FROM, Measured, Section, growth
from .figures.style import STYLES, in_words, style
from .table import (
    NOTHING,
    Cell,
    Content,
    Row,
    Table,
    best,
    entitled,
    measured_part,
    name,
    number,
    word,
)

COLUMNS = (
    *("method", "mean °", "SD °", "max °", "area", "texels", "flips", "boundary error", "s"),
    *("s / F", "MiB", "outcome"),
)
FORMATS = {
    **{"mean": ".3f", "sd": ".3f", "max": ".1f", "area_sd": ".3f", "texels": ".3g"},
    **{"flips": ",.0f", "boundary_error": ".0e", "seconds": ".3g"},
}

# Methods that are what others are measured by, or have tables of their own.
UNITS = ("factor", "cdcp warm", "cdcp sequence", "import")
OURS = {"disk": "cdcp", "free": "free", "sphere": "sphere"}  # of each kind, by default
BEST, SUMMED = "Which method for what", "Over all surfaces"  # titles of tables
TABLE_1 = "Table 1: angular distortion, {}"
TABLE_2 = "Table 2: seconds and memory, {}"
PAIRED = ("cdcp", "cdcp refine=5")  # against which all others are tested
COMPARED = {"mean": "mean °", "sd": "SD °", "seconds": "s"}  # in these tests
FAMILY_TITLES = {"disk": "onto the disk", "free": "free outline", "sphere": "onto the sphere"}
PURPOSES = {
    **{"mean": "least mean angular distortion", "sd": "least SD of it"},
    **{"area_sd": "evenest areas", "texels": "evenest texels"},
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
        *([("Limits", _limits(machine))] if "memory_limit" in machine else []),
        ("Again", " && ".join(dict.fromkeys(machine["commands"].values()))),
    ]


def _limits(machine: Mapping[str, Any]) -> str:
    of_each = f"{machine['time_limit']:g} s and {machine['memory_limit']:,.0f} MiB for each case"
    return f"{of_each}, in a process of its own"


def tables(measured: Measured) -> list[Table]:
    """Make the tables of all sections."""
    sections = measured.sections
    made = list(_accuracy(sections["tables"])) if "tables" in sections else []
    for section, makers in {
        "peers": (peer_table, peer_areas, peer_times),
        "speed": (_unit, _multiples, _peaks, _small, _sequences),
        "growth": (_growth,),
        "ablation": (_ablation,),
        "rescue": (rescue_table,),
    }.items():
        made += [make(sections[section]) for make in makers if section in sections]
    return [table for table in map(measured_part, made) if table.rows]


@entitled("cases")
def cases(results: Section) -> Content:
    """All cases.

    Every method on every surface. Area is the SD of the log of the ratio of areas; texels, the
    density of texels that 95 percent of the surface have at most, by that of 5 percent; the
    boundary error, the largest deviation from the unit circle.
    """
    methods = in_order(results)
    return ["surface", "n", *COLUMNS], [
        [*model_cells(results, model), *case(results, model, method)]
        for model in results.sizes
        if any(results.of(model, method) for method in methods)
        for method in methods
    ]


# -- many surfaces, Tables 1 and 2 --------------------------------------------------------


def _accuracy(results: Section) -> Iterator[Table]:
    if len(results.mapped) > 1:
        yield best_table(results)
        yield summary_table(results)
        for k, base in enumerate(PAIRED):
            title = f"{style(base).label} against each other method"
            yield replace(_paired(results, base), id=f"paired-{k}", title=title)
    for family, title in FAMILY_TITLES.items():
        for make in (_distortion, _areas, _time):
            table = make(results, family)
            yield replace(table, id=f"{table.id}-{family}", title=f"{table.title}, {title}")


@entitled("short")
def in_short(results: Section, anchor: Callable[[str], str]) -> Content:
    """In short.

    A row for each kind of map, with links to the rows behind it.
    """
    summed, rows = summary(results), []
    for family, title in FAMILY_TITLES.items():
        own = OURS[family]
        accurate, fast = (ranking(results, family, name) for name in ("mean", "seconds"))
        if own not in summed.index or not (accurate and fast):
            continue

        def link(text: str, table: str, title: str = title) -> Cell:
            known = len(results.mapped) > 1 or table not in (BEST, SUMMED)
            return word(f"[{text}]({anchor(table.format(title))})" if known else text)

        times = {method: ratio for method, ratio, _ in fast}
        of = summed.loc[own]
        lost = {m: len(results.failed(m)) for m in results.maps if results.family[m] == family}
        worst = sorted((m for m in lost if lost[m]), key=lambda m: -lost[m])[:RANKED]
        rows.append(
            [
                name(title),
                link(f"{style(accurate[0][0]).label}, on {accurate[0][2]:.0%}", TABLE_1),
                link(f"{of['mean 0.5']:.3g}°", SUMMED),
                link(f"{style(fast[0][0]).label}, on {fast[0][2]:.0%}", TABLE_2),
                link(f"{times[own]:.3g} × the least", BEST) if own in times else Cell(NOTHING),
                link(f"{of['surfaces'] * of['mapped']:.0f} of {of['surfaces']:.0f}", SUMMED),
                link(", ".join(f"{style(m).label}: {lost[m]}" for m in worst) or "none", SUMMED),
            ]
        )
    columns = ["least angular distortion", "CDCP, median", "least time", "CDCP, time"]
    return ["", *columns, "CDCP maps", "surfaces without a map"], rows


@entitled("best")
def best_table(results: Section) -> Content:
    """Which method for what.

    Of the methods that were run on all surfaces: the median of the ratio to the best one, and on
    which share of the surfaces it is that. No map, or one with flipped faces, is infinitely
    worse.
    """
    rows = []
    for family, title in FAMILY_TITLES.items():
        for quantity, purpose in PURPOSES.items():
            ranked = [
                f"{style(method).label}: {median:.3g} ({share:.0%})"
                for method, median, share in ranking(results, family, quantity)[:RANKED]
            ]
            if ranked:
                ranked += [NOTHING] * (RANKED - len(ranked))
                rows.append([name(f"{purpose}, {title}"), *map(word, ranked)])
    return ["for", "first", "second", "third"], rows


@entitled("summary")
def summary_table(results: Section) -> Content:
    """Over all surfaces.

    Share of the surfaces that a method maps (onto the disk: certified), and without a flipped
    face; then median (quartiles) over those that it maps: who fails on the hard ones has the
    lower numbers. Seconds of cases that ran side by side are a hint.
    """
    table, rows = summary(results), []
    for method in in_order(results):
        of = table.loc[method]
        row = [name(style(method).label), word(FAMILY_TITLES[results.family[method]])]
        row.append(number(of["surfaces"], ".0f"))
        row += [number(100 * of[share], ".3g") for share in ("mapped", "unflipped")]
        for quantity in QUANTITIES:
            low, middle, high = (of[f"{quantity} {q}"] for q in (0.25, 0.5, 0.75))
            text = f"{middle:.3g} ({low:.3g}–{high:.3g})"
            row.append(Cell(text, middle) if middle == middle else Cell(NOTHING))
        rows.append(row)
    shares, of = ["surfaces", "mapped, %", "no flips, %"], ["mean °", "SD °", "area", "texels"]
    return ["method", "family", *shares, *of, "s", "MiB"], rows


@entitled("paired")
def _paired(results: Section, base: str) -> Content:
    """One method against each other.

    On the surfaces that both map: on how many it has less, more, or as much (to a millionth), the
    median of the differences, and two-sided p-values of the sign test and of Wilcoxon's
    signed-rank test. A free boundary has less to keep, and less distortion.
    """
    rows = []
    for method in in_order(results) if base in results.maps else ():
        for quantity, label in COMPARED.items() if method != base else ():
            made = paired(results, base, method, quantity)
            counts = [number(k, ".0f") for k in (made.lower, made.higher, made.ties)]
            tests = [number(p, ".2g") for p in (made.median, made.sign, made.signed_rank)]
            rows.append([name(style(method).label), word(label), *counts, *tests])
    counted = ["less", "more", "equal"]
    return ["against", "of", *counted, "difference", "p, sign", "p, signed rank"], rows


@entitled("distortion")
def _distortion(results: Section, family: str) -> Content:
    """Table 1: angular distortion.

    Mean / SD over all corners in degrees, and flipped faces if there are any. A free boundary has
    less to keep: compare it on angles only. Numbers of the paper in brackets belong to its own
    surface, for which another of similar size stands.
    """
    return _beside_the_paper(results, family, distortion_cell(results, ".3f"), "mean")


@entitled("areas")
def _areas(results: Section, family: str) -> Content:
    """Areas.

    SD over the faces of the log of the ratio of areas / density of texels: how many times longer
    lengths are in the image where 95 percent of the surface have less, than where 5 percent do.
    """
    made = _beside_the_paper(results, family, area_cell(results), "")
    return made if _has_areas(results) else (made[0], [])


@entitled("time")
def _time(results: Section, family: str) -> Content:
    """Table 2: seconds and memory.

    From arrays to map, in brackets as a multiple of T, the time of CDCP in the same run; peak
    memory of the process. The paper's are of MATLAB on another machine: compare ratios.
    """
    return _beside_the_paper(results, family, seconds_cell(results, "cdcp", "T"), "seconds")


def _beside_the_paper(
    results: Section, family: str, cell: Callable[[str, str], Cell], quantity: str
) -> Content:
    """Make a column for each method of a family; those of the paper map onto the disk."""
    members = [method for method in in_order(results) if results.family[method] == family]
    labels = [style(method).label for method in members]
    rows = grid(results, members, cell)
    if family == "disk" and quantity and any(row_of(model) for model in results.sizes):
        labels += [f"paper: {style(method).label}" for method in PUBLISHED]
        rows = [[*row, *_published(row[0].model, quantity)] for row in rows]
    return ["surface", "n", *labels], rows


def _published(model: str, quantity: str) -> Row:
    """Write the paper's means and SDs or seconds, in brackets if of another surface."""
    row = row_of(model)
    if row is None:
        return [Cell(NOTHING)] * len(PUBLISHED)
    values = getattr(row, quantity)
    texts = [f"{value:.2f}" for value in values]
    if quantity == "mean":
        texts = [f"{text} / {sd:.2f}" for text, sd in zip(texts, row.sd, strict=True)]
    form = "{}" if row.own == "own" else "({})"
    return [Cell(form.format(text), value) for text, value in zip(texts, values, strict=True)]


# -- speed ---------------------------------------------------------------------------------


@entitled("factor")
def _unit(results: Section) -> Content:
    """The unit of time.

    F is one CHOLMOD analysis (AMD) and factorization of the interior Laplacian, measured in the
    same run in processes of its own. Medians (least–greatest) of fresh processes; the methods
    take turns.
    """  # noqa: D401 - a title
    rows = []
    for model in results.sizes:
        if runs := results.of(model, "factor"):
            parts = [run.case.details["seconds"]["analyse"] for run in runs if run.ok]
            seconds = [run.case.seconds for run in runs]
            row = model_cells(results, model)
            row.append(failure_cell(results, model, "factor") or _spread(seconds, ".3g"))
            row.append(Cell(str(len(runs))))
            row.append(number(median(parts) if len(parts) == len(runs) else np.nan, ".2g"))
            rows.append([*row, number(results.median(model, "factor", "memory"), ",.0f")])
    return ["surface", "n", "F, s", "runs", "analysis, s", "peak, MiB"], rows


@entitled("multiples")
def _multiples(results: Section) -> Content:
    """Time as a multiple of F."""

    def times(model: str, method: str) -> Cell:
        runs = results.of(model, method)
        values = [run.case.seconds / results.median(model, "factor") for run in runs]
        if len(values) > 1:
            return _spread(values, ".2f")
        return number(median(values), "{:.2f} (one run)".format)

    return _in_units(results, times)


@entitled("peak")
def _peaks(results: Section) -> Content:
    """Peak memory as a multiple of that of F.

    Python and mesh in both.
    """

    def memory(model: str, method: str) -> Cell:
        peak, unit = (results.median(model, m, "memory") for m in (method, "factor"))
        return number(peak / unit, ".2f")

    return _in_units(results, memory)


def _in_units(results: Section, cell: Callable[[str, str], Cell]) -> Content:
    methods = results.methods(m for m in METHODS if m not in UNITS)
    rows = grid(results, methods, cell)
    measured = [row for row in rows if results.of(row[0].model, "factor")]
    return ["surface", "n", *(style(method).label for method in methods)], measured


@entitled("small")
def _small(results: Section) -> Content:
    """Once imported, and the import.

    Milliseconds: medians (least–greatest) of many calls of `cdcp` in one process, and of `import
    cdcp_igl` in fresh processes.
    """
    rows = []
    for model in results.sizes:
        for method, text in (("cdcp warm", f"`cdcp` on {model}"), ("import", "`import cdcp_igl`")):
            ms = [1000 * run.case.seconds for run in results.of(model, method) if run.ok]
            if ms:
                rows.append([name(text), _spread(ms, ".4g")])
    return ["what", "ms"], rows


@entitled("sequences")
def _sequences(results: Section) -> Content:
    """Sequences.

    The same faces with moved vertices, in one process: T is `disk_map`, S is
    `DiskMapper.moved(V).map()`, which keeps the check of the faces and the analysis of the
    factor. Medians.
    """
    rows = []
    for model in results.sizes:
        runs = [run for run in results.of(model, "cdcp sequence") if run.ok]
        if runs:
            S = median(run.case.seconds for run in runs)
            T = median(run.case.details["seconds"]["afresh"] for run in runs)
            values = number(T, ".3g"), number(S, ".3g"), number(S / T, ".2f"), number(1 / S, ".2g")
            rows.append([*model_cells(results, model), *values])
    return ["surface", "n", "T, s", "S, s", "S/T", "maps a second"], rows


def _spread(values: Sequence[float], form: str) -> Cell:
    ends = f"({min(values):{form}}–{max(values):{form}})"
    return number(median(values), lambda value: f"{value:{form}} {ends}")


def _growth(results: Section) -> Table:
    n = np.array(list(results.mapped.values()), dtype=float)
    columns = [("factor", "seconds"), ("cdcp", "seconds"), ("factor", "memory"), ("cdcp", "memory")]
    values = [results.values(method, quantity) for method, quantity in columns]
    exponents = [growth(n, column)[0] for column in values]
    rows = [
        [*model_cells(results, model), *(number(column[i], ",.4g") for column in values)]
        for i, model in enumerate(results.mapped)
    ]
    fitted = [Cell("exponent of n", kind="name"), Cell(f"from {FROM:,}")]
    return Table(
        "growth",
        "Growth",
        "One terrain, each triangle cut into four again and again: seconds and peak MiB of F and "
        f"of CDCP, and the power of n that fits those with {FROM:,} vertices or more.",
        ["surface", "n", "F, s", "T, s", "F, MiB", "T, MiB"],
        [*rows, [*fitted, *(number(p, ".2f") for p in exponents)]],
    )


# -- ablation, other programs --------------------------------------------------------------


@entitled("ablation")
def _ablation(results: Section) -> Content:
    """Ablation.

    CDCP with one step changed and without fallbacks: mean / SD of the angular distortion in
    degrees. "default" is torsion with a well-shaped face, whitened exterior trace, zipper, Möbius
    for least angular distortion; the other centres are the most central face whatever its shape.
    """
    cell = distortion_cell(results, ".4f")
    return ["variant", *(model_cells(results, model)[0].text for model in results.sizes)], [
        [
            name(variant),
            *(failure_cell(results, m, variant) or cell(m, variant) for m in results.sizes),
        ]
        for variant in results.methods(ABLATIONS)
    ]


def rescue_table(results: Section) -> Table:
    """Make the table with a row for each part of the rescue that is left out."""
    members = {
        family: [model for model in results.mapped if family_of(model) == family]
        for family in (*FAMILIES, GIVEN)
    }
    families = {family: models for family, models in members.items() if models}
    return Table(
        "rescue",
        "The rescue, without each of its parts",
        "In each family of disks: valid maps; conformal maps; maps that are worse + better by more "
        f"than {CHANGED:.0%} than with all of the rescue, lost ones worse; mean angular distortion "
        "over the valid maps; seconds, a hint.",
        ["CDCP with", *(f"{family}, {len(models)}" for family, models in families.items())],
        [
            [name(method), *(_rescued(results, method, models) for models in families.values())]
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
    runs = [run for model in models for run in results.of(model, method) if run.ok]
    conformal = sum(run.case.details["conformal"] for run in runs)
    valid = np.isfinite(means).sum()
    mean = f"{np.nanmean(means):.2f}°" if valid else NOTHING
    seconds = np.nansum([results.median(model, method) for model in models])
    changed = f"{worse.sum()}+{better.sum()}"
    return Cell(f"{valid}; {conformal}; {changed}; {mean}; {seconds:.1f} s")


@entitled("peers")
def peer_table(results: Section) -> Content:
    """Other programs: angular distortion.

    Mean / SD over all corners in degrees, and flipped faces if there are any. A map with free
    boundary is onto no disk: compare it on angles only. MeshLab's harmonic map is onto the disk,
    but in too few digits for a certificate. SLIM, ARAP and Blender's minimum stretch keep
    lengths, which costs angles.
    """
    return _beside_cdcp(results, distortion_cell(results, ".3f"))


@entitled("peers-areas")
def peer_areas(results: Section) -> Content:
    """Other programs: areas.

    SD of the log of the ratio of areas / density of texels, as above.
    """
    made = _beside_cdcp(results, area_cell(results))
    return made if _has_areas(results) else (made[0], [])


@entitled("peers-time")
def peer_times(results: Section) -> Content:
    """Other programs: seconds and memory.

    From arrays to map, in brackets as a multiple of T, the time of CDCP; peak memory of the
    process.
    """
    return _beside_cdcp(results, seconds_cell(results, "cdcp", "T"))


def _beside_cdcp(results: Section, cell: Callable[[str, str], Cell]) -> Content:
    def heading(method: str) -> str:
        label, of = style(method).label, METHODS.get(split(method)[0])  # none: has another name
        if results.family[method] == "free" and "free boundary" not in label:
            label += ", not certified" if of and of.onto_disk else ", free boundary"
        return label + ", single precision" * bool(of and of.single)

    headings = ["surface", "n", *(heading(method) for method in results.maps)]
    return headings, grid(results, results.maps, cell)


# -- cells and rows ----------------------------------------------------------------------


def case(results: Section, model: str, method: str) -> Row:
    """Make the row of a method, under `COLUMNS`."""
    outcome = results.failure(model, method) or "ok"
    cells = [name(style(method).label)]
    for quantity, form in FORMATS.items():
        hidden = results.family[method] == "free" and quantity == "boundary_error"
        cells.append(number(np.nan if hidden else results.median(model, method, quantity), form))
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
    text = in_words(model, there)
    text = model if text in results.sizes else text  # another one is called so
    text += ", opened" * (model in results.opened)
    if row:
        other = f", for {row.name}" if row.own == "stand-in" else f" ({row.own})"
        text = row.name if row.own == "own" else text + other
    return [replace(name(text), model=model), number(there or np.nan, ",.0f")]


def grid(results: Section, methods: Sequence[str], cell: Callable[[str, str], Cell]) -> list[Row]:
    """One row a model, one column a method."""
    rows = []
    for model in results.sizes:
        if any(results.of(model, method) for method in methods):
            made = [failure_cell(results, model, m) or cell(model, m) for m in methods]
            made = best(made, range(len(made))) if len(made) > 1 else made
            rows.append([*model_cells(results, model), *made])
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


def _has_areas(results: Section) -> bool:
    """Whether they were measured, which old results were not."""
    return bool(results.medians["area_sd"].notna().any())


def area_cell(results: Section) -> Callable[[str, str], Cell]:
    """Write the SD of the log of the ratio of areas and the density of texels."""

    def cell(model: str, method: str) -> Cell:
        area, texels = (results.median(model, method, q) for q in ("area_sd", "texels"))
        return Cell(f"{area:.3f} / {texels:.3g}", area)

    return cell


def seconds_cell(results: Section, unit: str, letter: str) -> Callable[[str, str], Cell]:
    """Write seconds, in brackets as a multiple of the time of a method, and peak memory."""

    def cell(model: str, method: str) -> Cell:
        time, one = results.median(model, method), results.median(model, unit)
        multiple = f" ({time / one:.3g} {letter})" if one > 0 else ""
        peak = f", {results.median(model, method, 'memory'):,.0f} MiB"
        return Cell(f"{time:.3g}{multiple}{peak}", time)

    return cell
