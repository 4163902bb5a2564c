"""Figures 8 and 12, and what the paper lacks: time in factorizations, by phase."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from statistics import median

import numpy as np
from matplotlib.figure import Figure

from ...records.results import Measured, NotMeasured
from .accuracy import MOBIUS, with_own
from .style import (
    BLUE,
    GREEN,
    HATCHES,
    INK,
    ORANGE,
    PURPLE,
    RED,
    SKY,
    YELLOW,
    by_model,
    legend,
    model_name,
    new,
    series,
    trend,
)

REPEATED = ("cdcp", "cdcp refine=5", "free", "harmonic", "lscm")
UNIT = "one factorization of $L_{II}$"
# Phases of CDCP that are drawn together, from first to last.
STACK = {
    "check": (("check",), SKY),
    "Laplacian": (("laplacian",), GREEN),
    "factorization": (("factor",), BLUE),
    "centre, trace": (("center", "trace"), ORANGE),
    "circle": (("circle",), RED),
    "extension": (("extension",), YELLOW),
    "Möbius": (("mobius",), PURPLE),
    "repair, certificate": (("repair", "refine", "certificate", "distortion"), "#bbbbbb"),
}


def seconds(measured: Measured) -> Figure:
    """Figure 8, left: time by method."""
    return _seconds(measured, "tables", with_own(measured))


def mobius(measured: Measured) -> Figure:
    """Figure 12: time with and without Möbius."""
    return _seconds(measured, "ablation", MOBIUS)


def _seconds(measured: Measured, section: str, wanted: Sequence[str]) -> Figure:
    results, methods = measured.require(section, wanted)
    return by_model(results, {"seconds": series(results, methods, "seconds")})


def seconds_growth(measured: Measured) -> Figure:
    """Figure 8, right: time against n."""
    results, methods = measured.require("tables", with_own(measured))
    figure, panels = new(7.2, 6.2)
    trend(panels[0, 0], results.mapped, series(results, methods, "seconds"))
    legend(figure, panels[0, 0], 2)
    panels[0, 0].set_ylabel("seconds", fontsize=10, color=INK)
    return figure


def factorizations(measured: Measured) -> Figure:
    """Time as a multiple of one factorization of L_II, by repeated runs."""
    measured.require("speed", ("factor",))
    results, methods = measured.require("speed", with_own(measured, "speed", REPEATED))
    unit = results.values("factor", "seconds")
    plotted = [
        replace(one, values=one.values / unit, spread=one.spread / unit)
        for one in series(results, methods, "seconds")
    ]
    figure = by_model(results, {f"time / {UNIT}": plotted})
    figure.axes[0].axvline(1, color=INK, linewidth=0.8)
    return figure


def phases(measured: Measured) -> Figure:
    """Where CDCP's time goes, stacked, as multiples of one factorization."""
    measured.require("speed", ("factor",))
    results, _ = measured.require("speed", ("cdcp",))
    models = {model: n for model, n in results.mapped.items() if results.of(model, "cdcp")}
    figure, panels = new(9, 1.3 + 0.3 * len(models))
    axes, row = panels[0, 0], np.arange(len(models))
    left = np.zeros(len(row))
    for hatch, (label, (names, color)) in zip(HATCHES, STACK.items(), strict=True):
        width = np.zeros(len(row))
        for k, model in enumerate(models):
            runs = [run.case.details["seconds"] for run in results.of(model, "cdcp") if run.ok]
            if runs:
                spent = median(sum(phase.get(name, 0) for name in names) for phase in runs)
                width[k] = spent / results.median(model, "factor")
        look = {"facecolor": color, "hatch": hatch, "edgecolor": "white", "linewidth": 0}
        axes.barh(row, np.nan_to_num(width), 0.72, left, label=label, **look)
        left += np.nan_to_num(width)
    if not left.any():
        raise NotMeasured("every case failed")
    for missing in np.flatnonzero(left == 0):
        axes.text(0, missing, " no map", va="center", fontsize=9, color=INK)
    axes.axvline(1, color=INK, linewidth=0.8)
    axes.set_yticks(row, [model_name(model, n) for model, n in models.items()])
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(len(row) - 0.5, -0.5)
    axes.set_xlabel(f"time / {UNIT}", fontsize=10, color=INK)
    legend(figure, axes, 4)
    return figure
