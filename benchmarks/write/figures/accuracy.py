"""Figures 6, 7, 10 and 11: angular distortion by method, by centre, without Möbius."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cdcp_igl.arrays import Floats

from ...records.record import EDGES
from ...records.results import Measured, NotMeasured, Section
from .style import INK, STYLES, by_model, legend, model_name, new, require_few, series, style

COMPARED = (
    *("fdcp", "ldcp", "cem", "ricci", "cdcp", "cdcp refine=5", "harmonic", "lscm", "bff"),
    "free refine=5",
)
CENTERS = ("center heat t=1e4 without Möbius", "center centroid without Möbius")
MOBIUS = ("default", "without Möbius")

LINES = {"fdcp": "--", "ldcp": ":", "cdcp": "-", "harmonic": "-."}  # of the histograms
SHOWN = 0.97  # of the corners: where a histogram ends
BARS = 50  # in a histogram, at most
JOINED = (1, 2, 4)  # bins to a bar
COLUMNS = 4


def with_own(
    measured: Measured, section: str = "tables", methods: Sequence[str] = COMPARED
) -> tuple[str, ...]:
    """Methods of a figure, and those that are somebody's own or have other options."""
    results = measured.sections.get(section)
    own = [method for method in results.maps if method not in STYLES] if results else []
    return (*methods, *own)


def histograms(measured: Measured) -> Figure:
    """Figure 6: share of the corners by angular distortion, a panel for each model."""
    results, methods = measured.require("tables", with_own(measured, methods=tuple(LINES)))
    require_few(results)
    counted = {model: _histograms(results, model, methods) for model in results.mapped}
    counted = {model: of for model, of in counted.items() if of}
    if not counted:
        raise NotMeasured("no method has a valid map of any model")
    rows = -(-len(counted) // COLUMNS)
    figure, panels = new(11, 0.6 + 2 * rows, nrows=rows, ncols=COLUMNS)
    for axes in panels.flat[len(counted) :]:
        axes.set_axis_off()
    for axes, (model, of) in zip(panels.flat, counted.items(), strict=False):
        _draw_histogram(axes, of)
        axes.set_title(model_name(model, measured.sizes[model]), fontsize=9, color=INK)
        axes.tick_params(labelsize=8)
    fullest = max(panels.flat, key=lambda axes: len(axes.get_legend_handles_labels()[0]))
    legend(figure, fullest, len(methods))
    figure.supxlabel("angular distortion in degrees", fontsize=10, color=INK)
    figure.supylabel("% of corners per degree", fontsize=10, color=INK)
    return figure


def histogram(measured: Measured, model: str) -> Figure:
    """Draw the panel of one model."""
    results, methods = measured.require("tables", with_own(measured, methods=tuple(LINES)))
    counted = _histograms(results, model, methods)
    if not counted:
        raise NotMeasured("no method has a valid map")
    figure, panels = new(7, 3.2)
    _draw_histogram(panels[0, 0], counted)
    panels[0, 0].set_xlabel("angular distortion in degrees", fontsize=10, color=INK)
    panels[0, 0].set_ylabel("% of corners per degree", fontsize=10, color=INK)
    panels[0, 0].legend(frameon=False, fontsize=10)
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


def _histograms(results: Section, model: str, methods: list[str]) -> dict[str, Floats]:
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


def table_1(measured: Measured) -> Figure:
    """Figure 7: mean and SD of the angular distortion."""
    return _mean_and_sd(measured, "tables", with_own(measured))


def centers(measured: Measured) -> Figure:
    """Figure 10: mean and SD for two centres, without Möbius."""
    return _mean_and_sd(measured, "ablation", CENTERS)


def mobius(measured: Measured) -> Figure:
    """Figure 11: mean and SD with and without Möbius."""
    return _mean_and_sd(measured, "ablation", MOBIUS)


def _mean_and_sd(measured: Measured, section: str, wanted: Sequence[str]) -> Figure:
    results, methods = measured.require(section, wanted)
    labels = {"mean": "mean", "sd": "SD"}
    return by_model(
        results,
        {
            f"{label} of the angular distortion in degrees": series(results, methods, name)
            for name, label in labels.items()
        },
    )
