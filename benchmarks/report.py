"""Markdown tables from stored records."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from cdcp_igl.arrays import Floats

from .ablation import ABLATIONS
from .methods import METHODS, maps
from .paper import PAPER, PUBLISHED, published, row_of
from .store import Record

__all__ = ["FROM", "Results", "claim", "growth", "markdown"]

MARGIN = 0.005  # degrees by which CDCP's mean may be above that of FDCP or LDCP
REFINED = ("cdcp", "cdcp refine=1", "cdcp refine=5", "cdcp refine=10 p=1.2")
FROM, TO = 17_000, 1_100_000  # vertices between which growth is fitted
NOTHING = "–"


class Results:
    """The records of one section, the latest of each case.

    Parameters
    ----------
    records : iterable of Record
        In the order of measurement.
    section : str
    """

    def __init__(self, records: Iterable[Record], section: str) -> None:
        latest = {
            (r.model, r.method, r.repeat): r for r in records if r.section == section
        }  # a model that has come or changed replaces what it was
        self.records = list(latest.values())

    def models(self) -> list[str]:
        """List the paper's models or stand-ins in its order, then the others by size."""
        sizes = {r.model: r.vertices for r in self.records}
        order = [row.model or row.name for row in PAPER]
        return sorted(
            sizes,
            key=lambda name: (order.index(name) if name in order else len(order), sizes[name]),
        )

    def methods(self, among: Iterable[str]) -> list[str]:
        """Those that were run."""
        run = {r.method for r in self.records}
        return [method for method in among if method in run]

    def of(self, model: str, method: str) -> list[Record]:
        """All repeats."""
        return [r for r in self.records if (r.model, r.method) == (model, method)]

    def first(self, model: str) -> Record:
        """Any record of a model, for its size."""
        return next(r for r in self.records if r.model == model)

    def median(self, model: str, method: str, name: str = "seconds") -> float:
        """Median over the repeats, NaN if one of them failed or there is none."""
        values = [getattr(r, name) for r in self.of(model, method)]
        return float(np.median(values)) if values else float("nan")

    def failure(self, model: str, method: str) -> str:
        """Why there is no number; empty if there is one."""
        runs = self.of(model, method)
        return next((r.outcome for r in runs if not r.ok), "" if runs else "not run")


def markdown(machine: Mapping[str, Any], records: Sequence[Record]) -> str:
    """Write the page of results.

    Parameters
    ----------
    machine : mapping
        As `benchmarks.machine.describe` returns it.
    records : sequence of Record

    Returns
    -------
    str
    """
    parts = [_header(machine)]
    for section, write in (("tables", _tables), ("speed", _speed), ("ablation", _ablation)):
        results = Results(records, section)
        if results.records:
            parts.append(write(results))
    return "\n\n".join(parts) + "\n"


def _header(machine: Mapping[str, Any]) -> str:
    versions = ", ".join(f"{name} {number}" for name, number in machine["versions"].items())
    return "\n".join(
        [
            "# Measured results",
            "",
            f"- {machine['cpu']}, {machine['cores']} cores, {machine['memory_gib']} GiB, "
            f"{machine['system']}",
            f"- Python {machine['python']}, {versions}, SuiteSparse {machine['suitesparse']}, "
            f"BLAS: {', '.join(machine['blas'])}, **{machine['blas_threads']} thread"
            f"{'s' if machine['blas_threads'] > 1 else ''}**",
            f"- cdcp_igl {machine['cdcp_igl']}, commit {machine['commit']}, sources "
            f"{machine['code']}, {machine['date']}",
            f"- limits of a case: {machine['time_limit']:g} s, "
            f"{machine['memory_limit']:,.0f} MiB; each case in a process of its own",
            f"- again: `{machine['command']}`",
        ]
    )


def _rows(heading: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [heading, ["---"] + ["---:"] * (len(heading) - 1), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _model(results: Results, model: str) -> list[str]:
    """Name, what it stands for, and size."""
    row, size = published(model), results.first(model).vertices
    if row:
        name = row.name if row.own == "own" else f"{model}, for {row.name}"
        if row.own not in ("own", "stand-in"):
            name = f"{row.name} ({row.own})"
    else:
        name = model
    return [name, f"{size:,}" if size else NOTHING]


class _Notes:
    """Failures, numbered and told below the table."""

    def __init__(self) -> None:
        self._texts: list[str] = []

    def __call__(self, text: str) -> str:
        if text == "not run":
            return NOTHING
        if text not in self._texts:
            self._texts.append(text)
        missing = text.startswith("not to be had")
        return f"{NOTHING if missing else 'failed'} [{self._texts.index(text) + 1}]"

    def __str__(self) -> str:
        return "\n".join(f"[{k}] {text}  " for k, text in enumerate(self._texts, 1))


def _table(
    results: Results,
    methods: Sequence[str],
    cell: Callable[[str, str], str],
    *,
    models: Sequence[str] | None = None,
    paper: str = "",
) -> str:
    """One row a model, one column a method; what failed is told below.

    `models` are all unless given; `paper` names the published quantity for columns beside, ""
    for none.
    """
    notes = _Notes()
    heading = ["surface", "n", *methods]
    if paper:
        heading += [f"*paper: {method}*" for method in PUBLISHED]
    rows = []
    for model in results.models() if models is None else models:
        row = _model(results, model)
        for method in methods:
            failure = results.failure(model, method)
            row.append(notes(failure) if failure else cell(model, method))
        if paper:
            row += _published(model, paper)
        rows.append(row)
    return _rows(heading, rows) + (f"\n\n{notes}" if str(notes) else "")


def _published(model: str, quantity: str) -> list[str]:
    row = row_of(model)
    if row is None:
        return [NOTHING] * len(PUBLISHED)
    values = (
        [f"{mean:.2f}/{sd:.2f}" for mean, sd in zip(row.mean, row.sd, strict=True)]
        if quantity == "distortion"
        else [f"{seconds:.2f}" for seconds in row.seconds]
    )
    if row.own == "own":
        return values
    return [f"({value})" for value in values]


def _tables(results: Results) -> str:
    def distortion(model: str, method: str) -> str:
        flips = results.median(model, method, "flips")
        return (
            f"{results.median(model, method, 'mean'):.3f}/{results.median(model, method, 'sd'):.3f}"
            + (f", {flips:,.0f} flips" if flips else "")
        )

    def seconds(model: str, method: str) -> str:
        time, unit = results.median(model, method), results.median(model, "factor")
        return f"{time:.3g} ({time / unit:.1f}\N{NO-BREAK SPACE}F)" if unit > 0 else f"{time:.3g}"

    main = results.methods(PUBLISHED)
    others = results.methods(m for m in maps() if m not in PUBLISHED and m not in REFINED)
    refined = results.methods(REFINED)
    parts = [
        "## Table 1: angular distortion",
        "Mean/SD over all corners, in degrees. Numbers of the paper in brackets belong to its "
        'own surface, for which another of similar size stands ("for"); without brackets it is '
        "the same surface.",
        _table(results, main, distortion, paper="distortion"),
        "### Other methods",
        "lscm and spectral have a free boundary: conformal, but onto no disk; compare them on "
        "angles only. harmonic is onto the disk, but not conformal.",
        _table(results, others, distortion),
        "### Refinement",
        _table(results, refined, distortion),
        "### CDCP against FDCP and LDCP",
        claim(results),
        "## Table 2: seconds",
        "From arrays to map, in brackets as a multiple of F, one CHOLMOD analysis (AMD) and "
        "factorization of L_II. The paper's are of MATLAB on another machine: compare ratios.",
        _table(results, main, seconds, paper="seconds"),
        "### Other methods",
        _table(results, [*others, *results.methods(["factor"])], seconds),
        "### Refinement",
        _table(results, refined, seconds),
    ]
    return "\n\n".join(parts)


def claim(results: Results) -> str:
    """Whether CDCP's mean is at most those of FDCP and LDCP plus the margin."""
    compared, above = [], []
    for model in results.models():
        means = {m: results.median(model, m, "mean") for m in PUBLISHED}
        if np.isfinite(list(means.values())).all():
            compared.append(model)
            above += [
                f"{model}: {means['cdcp']:.4f} against {means[m]:.4f} of {m.upper()}"
                for m in ("fdcp", "ldcp")
                if not means["cdcp"] <= means[m] + MARGIN
            ]
    skipped = [model for model in results.models() if model not in compared]
    text = f"All three are valid on {len(compared)} surfaces. "
    if above:
        text += f"CDCP's mean is more than {MARGIN} degrees above on: " + "; ".join(above) + "."
    elif compared:
        text += (
            f"On each of them CDCP's mean is at most FDCP's + {MARGIN} and LDCP's + {MARGIN} "
            "degrees."
        )
    if skipped:
        text += f" Not compared, because one is missing or failed: {', '.join(skipped)}."
    return text


def _speed(results: Results) -> str:
    unit = "factor"
    methods = results.methods(m for m in METHODS if m not in (unit, "cdcp warm", "import"))
    large = [model for model in results.models() if results.of(model, unit)]

    def ratio(quantity: str) -> Callable[[str, str], str]:
        def cell(model: str, method: str) -> str:
            base = results.median(model, unit, quantity)
            values = [getattr(r, quantity) / base for r in results.of(model, method)]
            if not np.isfinite(values).all():
                return NOTHING
            spread = f" ({min(values):.2f}–{max(values):.2f})" if len(values) > 1 else " (one run)"
            return f"{statistics.median(values):.2f}" + (spread if quantity == "seconds" else "")

        return cell

    parts = [
        "## Speed",
        "F is one CHOLMOD analysis (AMD) and factorization of L_II, measured in the same run in "
        "processes of its own. Medians (least–greatest) of fresh processes; the methods take "
        "turns.",
        _rows(["surface", "n", "F, s", "runs", "analysis, s", "peak, MiB"], _units(results, large)),
        "### Time as a multiple of F",
        _table(results, methods, ratio("seconds"), models=large),
        "### Peak memory as a multiple of that of F",
        "Python and the mesh included in both.",
        _table(results, methods, ratio("memory"), models=large),
        "### T, the time of CDCP, and the others",
        _rows(
            ["surface", "n", "T, s", "lscm/T", "harmonic/T", "first step/T", "further steps/T"],
            [_by_cdcp(results, model) for model in large],
        ),
        "A step of refinement: the first is refine=1 less CDCP, the further ones "
        "(refine=5 less refine=1)/4.",
        "### Growth",
        _growth(results),
        "### Once imported, and the import",
        _small(results),
    ]
    return "\n\n".join(parts)


def _units(results: Results, models: Sequence[str]) -> list[list[str]]:
    rows = []
    for model in models:
        runs = results.of(model, "factor")
        failure = results.failure(model, "factor")
        if failure:
            rows.append([*_model(results, model), failure, str(len(runs)), NOTHING, NOTHING])
            continue
        seconds = [r.seconds for r in runs]
        analysis = statistics.median(r.details["seconds"]["analyse"] for r in runs)
        rows.append(
            [
                *_model(results, model),
                f"{statistics.median(seconds):.3g} ({min(seconds):.3g}–{max(seconds):.3g})",
                str(len(runs)),
                f"{analysis:.2g}",
                f"{results.median(model, 'factor', 'memory'):,.0f}",
            ]
        )
    return rows


def _by_cdcp(results: Results, model: str) -> list[str]:
    T, one, five, lscm, harmonic = (
        results.median(model, method)
        for method in ("cdcp", "cdcp refine=1", "cdcp refine=5", "lscm", "harmonic")
    )
    ratios = [lscm / T, harmonic / T, (one - T) / T, (five - one) / 4 / T]
    return [
        *_model(results, model),
        f"{T:.3g}" if T > 0 else NOTHING,
        *(f"{value:.2f}" if np.isfinite(value) else NOTHING for value in ratios),
    ]


def _growth(results: Results) -> str:
    models = results.models()
    n = np.array([results.first(model).vertices for model in models])
    lines = []
    for name, method in (("CDCP", "cdcp"), ("F", "factor")):
        seconds, memory = (
            np.array([results.median(model, method, of) for model in models])
            for of in ("seconds", "memory")
        )
        used = np.isfinite(seconds) & (n >= FROM) & (n <= TO)
        if used.sum() < 3:
            lines.append(f"- {name}: fewer than three surfaces of {FROM:,} vertices or more.")
            continue
        (time, _), (space, _) = (growth(n[used], values[used]) for values in (seconds, memory))
        lines.append(
            f"- {name}: seconds grow like n^{time:.2f}, peak memory like n^{space:.2f} (least "
            f"squares over {used.sum()} surfaces of {n[used].min():,} to {n[used].max():,} "
            "vertices)."
        )
    return "\n".join(lines)


def growth(n: Floats, values: Floats) -> tuple[float, float]:
    """Fit values = c n^p by least squares, over models with `FROM` vertices or more.

    Returns
    -------
    p, c : float
        NaN if there are fewer than three such models.
    """
    used = np.isfinite(values) & (n >= FROM)
    if used.sum() < 3:
        return np.nan, np.nan
    p, log_c = np.polyfit(np.log(n[used]), np.log(values[used]), 1)
    return float(p), float(np.exp(log_c))


def _small(results: Results) -> str:
    lines = []
    for model in results.models():
        for method, text in (
            ("cdcp warm", "`cdcp` once imported, median of many calls in one process"),
            ("import", "`import cdcp_igl` in a fresh process"),
        ):
            seconds = [r.seconds for r in results.of(model, method) if r.ok]
            if not seconds:
                continue
            ms = 1000 * np.array(seconds)
            where = f" on {model}" if method == "cdcp warm" else ""
            lines.append(
                f"- {text}{where}: {np.median(ms):.4g} ms ({ms.min():.4g}–{ms.max():.4g})."
            )
    return "\n".join(lines) or "Not measured."


def _ablation(results: Results) -> str:
    models = results.models()
    notes = _Notes()
    heading = ["variant", *(_model(results, model)[0] for model in models)]

    def table(text: Callable[[str, str], str]) -> str:
        rows = []
        for variant in results.methods(ABLATIONS):
            row = [variant]
            for model in models:
                failure = results.failure(model, variant)
                row.append(notes(failure) if failure else text(model, variant))
            rows.append(row)
        return _rows(heading, rows)

    def distortion(model: str, variant: str) -> str:
        mean, sd = (results.median(model, variant, name) for name in ("mean", "sd"))
        return f"{mean:.4f}/{sd:.4f}"

    def seconds(model: str, variant: str) -> str:
        return f"{results.median(model, variant) / results.median(model, 'default'):.2f}"

    parts = [
        "## Ablation",
        "CDCP with one step changed and without fallbacks: mean/SD of the angular distortion in "
        'degrees. "default" is torsion with a well-shaped face, whitened exterior trace, zipper, '
        "Möbius for least angular distortion; the other centres are the most central face "
        "whatever its shape.",
        table(distortion),
        "### Time as a multiple of the default",
        "One run each: a hint only.",
        table(seconds),
        str(notes),
    ]
    return "\n\n".join(part for part in parts if part)
