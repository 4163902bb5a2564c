"""Figures 6 to 8 and 10 to 12: distortion and time by method; and what the paper lacks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from statistics import median
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cdcp_igl.arrays import Floats

from ...records.comparison import profiles
from ...records.record import EDGES
from ...records.results import FROM, Measured, NotMeasured, Section, growth
from . import style as look
from .style import INK, LOOK, STYLES, drawn_to, legend, log_scale, model_name, new, style

COMPARED = (
    *("fdcp", "ldcp", "cem", "ricci", "cdcp", "cdcp refine=5", "harmonic", "lscm", "bff"),
    "free refine=5",
)
BALANCED = (
    *("cdcp", "cdcp mobius=area", "cdcp keep=areas", "sem", "harmonic"),
    *("free", "free keep=0.2", "free keep=lengths", "free keep=areas"),
    *("lscm", "abf", "bff", "slim", "arap"),
)
CENTERS = ("center heat t=1e4 without Möbius", "center centroid without Möbius")
MOBIUS = ("default", "without Möbius")
REPEATED = ("cdcp", "cdcp refine=5", "free", "harmonic", "lscm")

DISTORTION = {
    f"{label} of the angular distortion in degrees": name
    for name, label in {"mean": "mean", "sd": "SD"}.items()
}
SECONDS = {"seconds": "seconds"}
UNIT = "one factorization of $L_{II}$"
# Phases of CDCP that are drawn together, from first to last.
STACK = {
    "check": (("check",), look.SKY),
    "Laplacian": (("laplacian",), look.GREEN),
    "factorization": (("factor",), look.BLUE),
    "centre, trace": (("center", "trace"), look.ORANGE),
    "circle": (("circle",), look.RED),
    "extension": (("extension",), look.YELLOW),
    "Möbius": (("mobius",), look.PURPLE),
    "repair, certificate": (("repair", "refine", "certificate", "distortion"), "#bbbbbb"),
}

LINES = {"fdcp": "--", "ldcp": ":", "cdcp": "-", "harmonic": "-."}  # of the histograms
DASHES = ("-", "--", ":", "-.")  # of the profiles, in turn
SHOWN = 0.97  # of the corners: where a histogram ends
BARS = 50  # in a histogram, at most
JOINED = (1, 2, 4)  # bins to a bar
COLUMNS = 4
LEAST = 100  # by which factor below the median a number may be to have its place on an axis
FEWEST = 3  # surfaces, below which a share says nothing
FARTHEST = 20  # times the best, where a profile ends


def _require(
    measured: Measured, methods: Sequence[str] = COMPARED, section: str = "tables"
) -> tuple[Section, list[str]]:
    """Methods of a figure, and those that are somebody's own or have other options."""
    results = measured.sections.get(section)
    own = [method for method in results.maps if method not in STYLES] if results else []
    return measured.require(section, (*methods, *own))


# -- histograms ------------------------------------------------------------------------


@drawn_to("figure-06-histograms.png")
def histograms(measured: Measured) -> Figure:
    """Figure 6: distribution of the angular distortion.

    Share of all corners by the change of their angle. The axis ends where 97 % of the corners of
    the conformal maps are passed; curves that coincide hide one another.
    """
    results, methods = _require(measured, tuple(LINES))
    look.require_few(results)
    counted = {model: _histograms(results, methods, model) for model in results.mapped}
    counted = {model: of for model, of in counted.items() if of}
    if not counted:
        raise NotMeasured("no method has a valid map of any model")
    rows = -(-len(counted) // COLUMNS)
    figure, panels = new(11, 0.6 + 2 * rows, nrows=rows, ncols=COLUMNS)
    for axes in panels.flat[len(counted) :]:
        axes.set_axis_off()
    for axes, (model, of) in zip(panels.flat, counted.items(), strict=False):
        _draw_histogram(axes, of)
        axes.set_title(model_name(model, measured.sizes[model]), fontsize=9)
        axes.tick_params(labelsize=8)
    fullest = max(panels.flat, key=lambda axes: len(axes.get_legend_handles_labels()[0]))
    legend(figure, fullest, len(methods))
    figure.supxlabel("angular distortion in degrees", fontsize=10, color=INK)
    figure.supylabel("% of corners per degree", fontsize=10, color=INK)
    return figure


@rc_context(LOOK)
def histogram(measured: Measured, model: str) -> Figure:
    """Draw the panel of one model."""
    results, methods = _require(measured, tuple(LINES))
    counted = _histograms(results, methods, model)
    if not counted:
        raise NotMeasured("no method has a valid map")
    figure, panels = new(7, 3.2)
    _draw_histogram(panels[0, 0], counted)
    panels[0, 0].set(xlabel="angular distortion in degrees", ylabel="% of corners per degree")
    panels[0, 0].legend()
    return figure


def _draw_histogram(axes: Axes, counted: dict[str, Floats]) -> None:
    conformal = [shares for method, shares in counted.items() if method != "harmonic"]
    last = max(_most(shares) for shares in conformal or counted.values())
    joined = next(k for k in JOINED if last <= BARS * k)
    for method, shares in counted.items():
        axes.stairs(
            100 * shares[:-1].reshape(-1, joined).sum(axis=1) / (joined * EDGES[1]),
            EDGES[::joined],
            baseline=None,
            label=style(method).label,
            color=style(method).color,
            linestyle=LINES.get(method, "-"),
            linewidth=1.3,
        )
    axes.set_xlim(0, EDGES[last])
    axes.set_ylim(0)


def _histograms(results: Section, methods: Sequence[str], model: str) -> dict[str, Floats]:
    """Shares of the corners in the bins, for each method that has a valid map."""
    return {
        method: np.array(record.histogram) / sum(record.histogram)
        for method in methods
        for record in results.of(model, method)[:1]
        if record.ok
    }


def _most(shares: Floats) -> int:
    """Find the edge up to which most corners are."""
    return min(int(np.searchsorted(shares.cumsum(), SHOWN)) + 1, len(EDGES) - 1)


# -- a row for each surface ------------------------------------------------------------


@drawn_to("figure-07-distortion.png")
def table_1(measured: Measured) -> Figure:
    """Figure 7: mean and SD of the angular distortion.

    Over all corners of the valid maps. LSCM has a free boundary: compare it on angles only.
    Markers instead of the paper's bars, because the axes are logarithmic; a number beside a
    marker belongs further left.
    """
    return _by_model(*_require(measured), DISTORTION)


@drawn_to("figure-10-centres.png")
def centers(measured: Measured) -> Figure:
    """Figure 10: two centres, without Möbius.

    Mean and SD of the angular distortion. CDCP from its building blocks, the most central face
    whatever its shape, without fallbacks.
    """
    return _by_model(*measured.require("ablation", CENTERS), DISTORTION)


@drawn_to("figure-11-mobius.png")
def mobius(measured: Measured) -> Figure:
    """Figure 11: with and without Möbius.

    Mean and SD of the angular distortion; the centre is by torsion, on a well-shaped face.
    """
    return _by_model(*measured.require("ablation", MOBIUS), DISTORTION)


@drawn_to("figure-08-time.png")
def seconds(measured: Measured) -> Figure:
    """Figure 8, left: time by method.

    Wall time from arrays to map. Each method ran in a fresh process on the same machine, threads
    pinned.
    """
    return _by_model(*_require(measured), SECONDS)


@drawn_to("figure-12-mobius-time.png")
def mobius_seconds(measured: Measured) -> Figure:
    """Figure 12: time with and without Möbius.

    Wall time from arrays to map. Each method ran in a fresh process on the same machine, threads
    pinned. One run each: a hint only.
    """
    return _by_model(*measured.require("ablation", MOBIUS), SECONDS)


@drawn_to("factorizations-repeated.png")
def factorizations(measured: Measured) -> Figure:
    """Time in factorizations.

    Wall time as a multiple of one CHOLMOD analysis and factorization of the interior Laplacian:
    medians of repeated runs in fresh processes, the methods taking turns; the lines go from the
    fastest to the slowest run.
    """
    measured.require("speed", ("factor",))
    results, methods = _require(measured, REPEATED, "speed")
    unit = results.values("factor", "seconds")
    figure = _by_model(results, methods, {f"time / {UNIT}": "seconds"}, unit)
    figure.axes[0].axvline(1, color=INK, linewidth=0.8)
    return figure


def _by_model(
    results: Section, methods: Sequence[str], panels: Mapping[str, str], unit: Floats | int = 1
) -> Figure:
    """Draw a row for each model and a marker for each method, in panels side by side.

    Parameters
    ----------
    results : Section
    methods : sequence of str
    panels : mapping of str to str
        What is shown by the label of the horizontal axis, which is logarithmic.
    unit : (models,) float64, optional
        Of the numbers.
    """
    look.require_few(results)
    height = 1.1 + len(results.mapped) * (0.14 + 0.08 * len(methods))
    figure, axes = new(3.5 + 3.75 * len(panels), height, ncols=len(panels))
    for one, (label, name) in zip(axes[0], panels.items(), strict=True):
        values = {method: of / unit for method, of in _values(results, methods, name).items()}
        spread = [results.spread(method, name) / unit for method in methods]
        _draw_rows(one, results, values, spread)
        one.set_xlabel(label)
        one.set_yticks([])
    names = [model_name(model, n) for model, n in results.mapped.items()]
    axes[0, 0].set_yticks(np.arange(len(names)), names)
    legend(figure, axes[0, 0], 2 + len(panels))
    return figure


def _values(results: Section, methods: Sequence[str], name: str) -> dict[str, Floats]:
    """Return the numbers called `name` of each method, for the models of the section."""
    values = {method: results.values(method, name) for method in methods}
    if not np.isfinite(list(values.values())).any():
        raise NotMeasured("every case failed")
    return values


def _draw_rows(
    axes: Axes, results: Section, values: Mapping[str, Floats], spread: Sequence[Floats]
) -> None:
    """Draw a row for each model; beyond the edge it says where a method failed."""
    models = list(results.mapped)
    row = np.arange(len(models))
    least = np.nanmedian(list(values.values())) / LEAST
    for shaded in row[::2]:
        axes.axhspan(shaded - 0.5, shaded + 0.5, color=look.BAND, linewidth=0, zorder=0)
    for k, (method, plotted) in enumerate(values.items()):
        at = row + 0.76 * ((k + 0.5) / len(values) - 0.5)
        axes.hlines(at, *spread[k].clip(least), color=style(method).color, linewidth=0.8)
        _draw_markers(axes, method, plotted.clip(least), at)
        for value, y in zip(plotted, at, strict=True):
            if value < least:
                axes.text(least, y, f"   {value:.0e}", fontsize=6, va="center")
        for model in results.failed(method):
            axes.text(
                *(1.008, at[models.index(model)], "no map"),
                transform=axes.get_yaxis_transform(),
                fontsize=6,
                va="center",
                color=style(method).color,
            )
    log_scale(axes, "x")
    axes.set_ylim(len(models) - 0.5, -0.5)
    axes.grid(axis="x", color=look.GRID, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(axis="y", length=0)


def _draw_markers(axes: Axes, method: str, x: Any, y: Any, more: str = "") -> None:
    drawn: dict[str, Any] = {"color": style(method).color, "marker": style(method).marker}
    axes.plot(x, y, label=style(method).label + more, linestyle="", markersize=5, **drawn)


# -- angles against areas ---------------------------------------------------------------


@drawn_to("angles-areas.png")
def angles_against_areas(measured: Measured) -> Figure:
    """Angles against areas.

    Mean angular distortion, and standard deviation of the log of the ratio of areas: the nearer to
    the lower left corner, the better. Lines join maps of this library with the same outline, by
    what they keep.
    """
    results, methods = _require(measured, BALANCED)
    look.require_few(results)
    x, y = (_values(results, methods, name) for name in ("area_sd", "mean"))
    models = list(results.mapped)
    rows = -(-len(models) // COLUMNS)
    figure, panels = new(11, 0.8 + 2.6 * rows, nrows=rows, ncols=COLUMNS)
    for axes in panels.flat[len(models) :]:
        axes.set_axis_off()
    for k, (axes, model) in enumerate(zip(panels.flat, models, strict=False)):
        for own in ("cdcp", "free"):
            kept = [m for m in methods if m == own or m.startswith(f"{own} keep=")]
            curve = sorted((x[m][k], y[m][k]) for m in kept if np.isfinite(x[m][k]))
            axes.plot(*zip(*curve, strict=True), color=style(own).color, linewidth=0.9, zorder=1)
        for method in methods:
            _draw_markers(axes, method, x[method][k : k + 1], y[method][k : k + 1])
        axes.set_title(model_name(model, measured.sizes[model]), fontsize=9)
        axes.set_xlim(0)
        axes.set_ylim(0)
    legend(figure, panels[0, 0], COLUMNS)
    figure.supxlabel("SD of log of the ratio of areas", fontsize=10, color=INK)
    figure.supylabel("mean angular distortion in degrees", fontsize=10, color=INK)
    return figure


# -- time against size, by phase, and profiles -----------------------------------------


@drawn_to("figure-08-growth.png")
def seconds_growth(measured: Measured) -> Figure:
    """Figure 8, right: time against the number of vertices.

    Wall time from arrays to map. Each method ran in a fresh process on the same machine, threads
    pinned. The lines are least-squares fits to the surfaces they span; their exponents are in the
    legend.
    """
    results, methods = _require(measured)
    figure, panels = new(7.2, 6.2)
    axes, n = panels[0, 0], np.array(list(results.mapped.values()), dtype=float)
    for method, values in _values(results, methods, "seconds").items():
        p, factor = growth(n, values)
        exponent = ""
        if np.isfinite(p):
            exponent = f"  $n^{{{p:.2f}}}$"
            ends = np.array([FROM, n.max()])
            axes.plot(ends, factor * ends**p, color=style(method).color, linewidth=0.9)
        _draw_markers(axes, method, n, values, exponent)
    log_scale(axes, "x", "y")
    axes.set(xlabel="vertices n", ylabel="seconds")
    axes.grid(color=look.GRID, linewidth=0.6)
    axes.set_axisbelow(True)
    legend(figure, axes, 2)
    return figure


@drawn_to("phases.png")
def phases(measured: Measured) -> Figure:
    """Where the time of CDCP goes.

    Seconds of each phase as a multiple of one factorization (black line), medians of repeated
    runs. Bars as in the legend, from left to right.
    """
    measured.require("speed", ("factor",))
    results, _ = measured.require("speed", ("cdcp",))
    models = {model: n for model, n in results.mapped.items() if results.of(model, "cdcp")}
    figure, panels = new(9, 1.3 + 0.3 * len(models))
    axes, row = panels[0, 0], np.arange(len(models))
    left = np.zeros(len(row))
    for hatch, (label, (names, color)) in zip(look.HATCHES, STACK.items(), strict=True):
        width = np.nan_to_num([_share(results, model, names) for model in models])
        drawn = {"facecolor": color, "hatch": hatch, "edgecolor": "white", "linewidth": 0}
        axes.barh(row, width, 0.72, left, label=label, **drawn)
        left += width
    if not left.any():
        raise NotMeasured("every case failed")
    for missing in np.flatnonzero(left == 0):
        axes.text(0, missing, " no map", va="center", fontsize=9, color=INK)
    axes.axvline(1, color=INK, linewidth=0.8)
    axes.set_yticks(row, [model_name(model, n) for model, n in models.items()])
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(len(row) - 0.5, -0.5)
    axes.set_xlabel(f"time / {UNIT}")
    legend(figure, axes, 4)
    return figure


def _share(results: Section, model: str, names: Sequence[str]) -> float:
    """Seconds in some phases by those of a factorization, 0 where there is no map."""
    runs = [run.case.details["seconds"] for run in results.of(model, "cdcp") if run.ok]
    spent = [sum(phase.get(name, 0) for name in names) for phase in runs]
    return median(spent) / results.median(model, "factor") if spent else 0


@drawn_to("profiles.png")
def performance_profiles(measured: Measured) -> Figure:
    """Performance profiles.

    Share of the surfaces on which a method onto the disk is within a factor of the best of them
    (Dolan and Moré 2002). Where a curve starts: how often it is the best; where it ends: how
    often it gives a valid map.
    """  # noqa: D401 - a title
    results, methods = _require(measured)
    if len(results.mapped) < FEWEST or results.medians["mean"].isna().all():
        raise NotMeasured(
            f"fewer than {FEWEST} surfaces, or every case failed; "
            "run: python -m benchmarks tables --models ..."
        )
    # Free boundaries solve another problem, and what was not run everywhere seems to fail.
    everywhere = results.everywhere("disk")
    methods = [method for method in methods if method in everywhere]
    figure, panels = new(10, 4.2, ncols=2)
    labels = {"mean": "mean angular distortion", "seconds": "seconds"}
    for axes, (name, label) in zip(panels[0], labels.items(), strict=True):
        ends = 1.0
        for k, (method, ratios) in enumerate(profiles(results, methods, name).items()):
            shares = np.arange(len(ratios) + 1) / len(ratios)
            reached = ratios[ratios < FARTHEST]
            ends = max(ends, reached.max(initial=1))
            axes.stairs(
                100 * shares[1 : len(reached) + 1],
                [*reached, FARTHEST],
                baseline=None,
                label=style(method).label,
                color=style(method).color,
                linestyle=DASHES[k % len(DASHES)],
                linewidth=1.5,
            )
        axes.set_xlim(1, min(1.1 * ends, FARTHEST))
        axes.set_ylim(0, 102)
        log_scale(axes, "x")
        axes.set_xlabel(f"{label} / least of all")
    panels[0, 0].set_ylabel("% of surfaces")
    legend(figure, panels[0, 0], len(methods))
    return figure
