"""Performance profiles: figures over many surfaces."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ...records.comparison import profiles
from ...records.results import Measured, NotMeasured, Section
from .accuracy import with_own
from .style import INK, legend, log_scale, new, style

FEWEST = 3  # surfaces, below which a share says nothing
FARTHEST = 20  # times the best, where a profile ends
LINES = ("-", "--", ":", "-.")


def performance_profiles(measured: Measured) -> Figure:
    """Share of the surfaces on which a method is within a factor of the best."""
    results, methods = _disk_methods(measured)
    figure, panels = new(10, 4.2, ncols=2)
    for axes, name, label in (
        (panels[0, 0], "mean", "mean angular distortion"),
        (panels[0, 1], "seconds", "seconds"),
    ):
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
                linestyle=LINES[k % len(LINES)],
                linewidth=1.5,
            )
        axes.set_xlim(1, min(1.1 * ends, FARTHEST))
        axes.set_ylim(0, 102)
        log_scale(axes, "x")
        axes.set_xlabel(f"{label} / least of all", fontsize=10, color=INK)
    panels[0, 0].set_ylabel("% of surfaces", fontsize=10, color=INK)
    legend(figure, panels[0, 0], len(methods))
    return figure


def _disk_methods(measured: Measured) -> tuple[Section, list[str]]:
    """Leave out free boundaries, which solve another problem, and what was not run everywhere."""
    results, methods = measured.require("tables", with_own(measured))
    _enough(results)
    everywhere = results.everywhere("disk")
    return results, [method for method in methods if method in everywhere]


def _enough(results: Section) -> None:
    if len(results.mapped) < FEWEST or results.medians["mean"].isna().all():
        raise NotMeasured(
            f"fewer than {FEWEST} surfaces, or every case failed; "
            "run: python -m benchmarks tables --models ..."
        )
