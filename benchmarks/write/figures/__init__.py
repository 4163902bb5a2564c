"""The paper's Figures 4 to 12 from measured records, and what the paper lacks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from matplotlib.figure import Figure

from ...records.results import Measured
from . import accuracy, cost, many, surfaces


@dataclass(frozen=True)
class Plot:
    """A figure that can be drawn.

    Attributes
    ----------
    file : str
        Name of its file.
    title, caption : str
        What it shows; how that was measured.
    draw : callable
        From `Measured` to a figure; raises NotMeasured.
    """

    file: str
    title: str
    caption: str
    draw: Callable[[Measured], Figure]


TABLES = "Each method ran in a fresh process on the same machine"
TIME = f"Wall time from arrays to map. {TABLES}, threads pinned."
ABLATION = (
    "CDCP from its building blocks, the most central face whatever its shape, without fallbacks."
)

PLOTS = (
    Plot(
        "figure-04-heat.png",
        "Figure 4: the centre by heat diffusion",
        "The coldest face after heat has come in from the boundary for time t, and the face "
        "where the torsion function is largest, which needs no t. Faint: behind the surface.",
        surfaces.heat_times,
    ),
    Plot(
        "figure-05-maps.jpg",
        "Figure 5: surfaces and their disks",
        "Each surface with its number of vertices, coloured by normal, and its map by CDCP in the "
        "same colours, turned to match the view.",
        surfaces.images,
    ),
    Plot(
        "figure-06-histograms.png",
        "Figure 6: distribution of the angular distortion",
        "Share of all corners by the change of their angle. The axis ends where 97 % of the "
        "corners of the conformal maps are passed; curves that coincide hide one another.",
        accuracy.histograms,
    ),
    Plot(
        "figure-07-distortion.png",
        "Figure 7: mean and SD of the angular distortion",
        "Over all corners of the valid maps. LSCM has a free boundary: compare it on angles only. "
        "Markers instead of the paper's bars, because the axes are logarithmic; a number beside "
        "a marker belongs further left.",
        accuracy.table_1,
    ),
    Plot(
        "figure-08-time.png",
        "Figure 8, left: time by method",
        TIME,
        cost.seconds,
    ),
    Plot(
        "figure-08-growth.png",
        "Figure 8, right: time against the number of vertices",
        f"{TIME} The lines are least-squares fits to the surfaces they span; their exponents are "
        "in the legend.",
        cost.seconds_growth,
    ),
    Plot(
        "figure-09-centres.png",
        "Figure 9: the centre by heat and the centroid",
        "The coldest face for t = 10⁴ and the face nearest to the centroid of the surface's area. "
        "Faint: behind the surface.",
        surfaces.heat_and_centroid,
    ),
    Plot(
        "figure-10-centres.png",
        "Figure 10: two centres, without Möbius",
        f"Mean and SD of the angular distortion. {ABLATION}",
        accuracy.centers,
    ),
    Plot(
        "figure-11-mobius.png",
        "Figure 11: with and without Möbius",
        "Mean and SD of the angular distortion; the centre is by torsion, on a well-shaped face.",
        accuracy.mobius,
    ),
    Plot(
        "figure-12-mobius-time.png",
        "Figure 12: time with and without Möbius",
        f"{TIME} One run each: a hint only.",
        cost.mobius,
    ),
    Plot(
        "factorizations-repeated.png",
        "Time in factorizations",
        "Wall time as a multiple of one CHOLMOD analysis and factorization of the interior "
        "Laplacian: medians of repeated runs in fresh processes, the methods taking turns; the "
        "lines go from the fastest to the slowest run.",
        cost.factorizations,
    ),
    Plot(
        "phases.png",
        "Where the time of CDCP goes",
        "Seconds of each phase as a multiple of one factorization (black line), medians of "
        "repeated runs. Bars as in the legend, from left to right.",
        cost.phases,
    ),
    Plot(
        "profiles.png",
        "Performance profiles",
        "Share of the surfaces on which a method onto the disk is within a factor of the best of "
        "them (Dolan and Moré 2002). Where a curve starts: how often it is the best; where it "
        "ends: how often it gives a valid map.",
        many.performance_profiles,
    ),
)
