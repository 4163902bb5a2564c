"""How the figures look: told apart by colour, and without it by marker and hatch."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from io import BytesIO
from typing import Any
from zlib import crc32

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from PIL import Image

from cdcp_igl.arrays import Floats

from ...measure.candidate import split
from ...records.results import FROM, NotMeasured, Section, growth

INK, FAINT, BAND = "#222222", "#8a8a8a", "#f3f3f3"
# M. Okabe, K. Ito. Color Universal Design, 2008.
BLACK, ORANGE, SKY, GREEN, YELLOW, BLUE, RED, PURPLE = (
    *("#000000", "#e69f00", "#56b4e9", "#009e73"),
    *("#f0e442", "#0072b2", "#d55e00", "#cc79a7"),
)
LEAST = 100  # by which factor below the median a number may be to have its place on an axis
DECADES = 1e3  # ratio of the ends of an axis from which on it has ticks at 1, 10, ... only
MOST = 30  # surfaces that a figure with a row or a panel for each can show
OWN = ("1", "2", "3", "4", "+", "|", "_")  # markers of methods that have no style
HATCHES = ("", "///", "...", "\\\\\\", "xxx", "---", "ooo", "+++")


@dataclass(frozen=True)
class Style:
    """Of a method: its name in legends, colour and marker."""

    label: str
    color: str
    marker: str


STYLES = {
    "fdcp": Style("FDCP", ORANGE, "s"),
    "ldcp": Style("LDCP", RED, "^"),
    "cdcp": Style("CDCP", BLUE, "o"),
    "cdcp refine=0": Style("CDCP, refine=0", BLUE, "1"),
    "cdcp refine=5": Style("CDCP, refine=5", SKY, "*"),
    "cdcp refine=10 refine_norm=1.2": Style("CDCP, refine=10, p=1.2", SKY, "p"),
    "cdcp preset=paper": Style("CDCP, preset=paper", BLACK, "x"),
    "cdcp mobius=area": Style("CDCP, mobius=area", SKY, "2"),
    "double_cover": Style("double cover", GREEN, "D"),
    "cem": Style("CEM", GREEN, "h"),
    "heat_flow": Style("heat flow", RED, "d"),
    "ricci": Style("discrete Ricci flow", PURPLE, "H"),
    "pgcp": Style("PGCP", ORANGE, "P"),
    "harmonic": Style("harmonic, arc length", PURPLE, "v"),
    "free": Style("CDCP, free outline", BLUE, ">"),
    "free refine=5": Style("CDCP, free outline, refine=5", SKY, ">"),
    "rectangle": Style("CDCP, rectangle", ORANGE, "8"),
    "sphere": Style("CDCP, sphere", BLUE, "3"),
    "flash": Style("FLASH", RED, "4"),
    "bff": Style("BFF, free boundary", BLACK, "<"),
    "bff_disk": Style("BFF, near a disk", BLACK, "."),
    "abf": Style("ABF++, free boundary", FAINT, "<"),
    "lscm": Style("LSCM, free boundary", FAINT, "P"),
    "spectral": Style("spectral, free boundary", FAINT, "X"),
    "default": Style("with Möbius", BLUE, "o"),
    "without Möbius": Style("without Möbius", ORANGE, "s"),
    "center heat t=1e4 without Möbius": Style("heat centre, t = 1e4", BLUE, "o"),
    "center centroid without Möbius": Style("centroid centre", RED, "^"),
}


def style(method: str) -> Style:
    """Return the style of a method; in black, with a marker of its name, if it has none."""
    base, options = split(method)
    changed = [f"{key}={value}" for key, value in options.items()]
    label = ", ".join([STYLES[base].label if base in STYLES else base, *changed])
    return STYLES.get(method) or Style(label, BLACK, OWN[crc32(method.encode()) % len(OWN)])


def new(width: float, height: float, **grid: object) -> tuple[Figure, np.ndarray]:
    """Make a figure of so many inches, and its axes as a 2-D array."""
    figure = Figure(figsize=(width, height), dpi=120, facecolor="white", layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(squeeze=False, **grid)  # type: ignore[call-overload]
    for axes in panels.flat:
        axes.spines[["top", "right"]].set_visible(False)
        axes.spines[["left", "bottom"]].set_color(FAINT)
        axes.tick_params(color=FAINT, labelcolor=INK, labelsize=9)
    return figure, panels


def encode(figure: Figure, suffix: str) -> bytes:
    """Return the figure as a small file: .png of 256 colours, or .jpg for shaded surfaces."""
    whole, small = BytesIO(), BytesIO()
    with rc_context({"hatch.linewidth": 0.5}):
        figure.savefig(whole, format="png")
    picture = Image.open(whole).convert("RGB")
    if suffix == ".jpg":
        picture.save(small, format="jpeg", quality=85, optimize=True)
    else:
        flat = picture.quantize(256, dither=Image.Dither.NONE)
        flat.save(small, format="png", optimize=True)
    return small.getvalue()


def model_name(model: str, n: int) -> str:
    """Return the name of a model and its size, as axes show it."""
    return f"{in_words(model, n)}  {n:,}"


def in_words(model: str, n: int) -> str:
    """Return the name of a model with spaces, without its size; a path has to stay as it is."""
    return model if "/" in model else model.removesuffix(f"_{n}").replace("_", " ")


@dataclass(frozen=True)
class Series:
    """Numbers of one method.

    Attributes
    ----------
    style : Style
    values : (models,) float64
        NaN where there is none.
    spread : (2, models) float64
        Least and greatest of the repeats.
    failed : frozenset of str
        Models on which the method was run and gave nothing.
    """

    style: Style
    values: Floats
    spread: Floats
    failed: frozenset[str]


def series(results: Section, methods: Iterable[str], name: str) -> list[Series]:
    """Return the numbers called `name` of each method, for the models of the section."""
    made = [
        Series(
            style(method),
            results.values(method, name),
            results.spread(method, name),
            frozenset(results.failed(method)),
        )
        for method in methods
    ]
    if not any(np.isfinite(one.values).any() for one in made):
        raise NotMeasured("every case failed")
    return made


def require_few(results: Section) -> None:
    """Raise NotMeasured if there are too many surfaces for a figure that shows each."""
    if len(results.mapped) > MOST:
        raise NotMeasured(
            f"{len(results.mapped):,} surfaces are too many to show each, more than {MOST}; "
            "see the figures over all of them"
        )


def by_model(results: Section, panels: Mapping[str, list[Series]]) -> Figure:
    """Draw a row for each model and a marker for each method, in panels side by side.

    Parameters
    ----------
    results : Section
    panels : mapping of str to list of Series
        By the label of the horizontal axis, which is logarithmic.
    """
    require_few(results)
    methods = max(len(plotted) for plotted in panels.values())
    height = 1.1 + len(results.mapped) * (0.14 + 0.08 * methods)
    figure, axes = new(3.5 + 3.75 * len(panels), height, ncols=len(panels))
    for one, (label, plotted) in zip(axes[0], panels.items(), strict=True):
        dots(one, results.mapped, plotted, names=one is axes[0, 0])
        one.set_xlabel(label, fontsize=10, color=INK)
    legend(figure, axes[0, 0], 2 + len(panels))
    return figure


def dots(axes: Axes, sizes: Mapping[str, int], plotted: list[Series], *, names: bool) -> None:
    """Draw a row for each model and a marker for each method, a cross at the edge for failures."""
    models = list(sizes)
    row = np.arange(len(models))
    numbers = np.concatenate([one.values for one in plotted])
    least = np.nanmedian(numbers) / LEAST
    for shaded in row[::2]:
        axes.axhspan(shaded - 0.5, shaded + 0.5, color=BAND, linewidth=0, zorder=0)
    for k, one in enumerate(plotted):
        offset = 0.76 * ((k + 0.5) / len(plotted) - 0.5)
        look: dict[str, Any] = {"color": one.style.color, "marker": one.style.marker, "ls": ""}
        axes.hlines(row + offset, *one.spread.clip(least), color=one.style.color, linewidth=0.8)
        axes.plot(one.values.clip(least), row + offset, label=one.style.label, markersize=5, **look)
        for value, y in zip(one.values, row + offset, strict=True):
            if value < least:
                axes.text(least, y, f"   {value:.0e}", fontsize=6, va="center")
        for model in one.failed:
            axes.text(
                *(1.008, models.index(model) + offset, "no map"),
                transform=axes.get_yaxis_transform(),
                fontsize=6,
                va="center",
                color=one.style.color,
            )
    log_scale(axes, "x")
    axes.set_ylim(len(models) - 0.5, -0.5)
    axes.grid(axis="x", color="#dddddd", linewidth=0.6)
    axes.set_axisbelow(True)
    labels = [model_name(model, n) for model, n in sizes.items()] if names else []
    axes.set_yticks(row if names else [], labels)
    axes.tick_params(axis="y", length=0)


def trend(axes: Axes, sizes: Mapping[str, int], plotted: list[Series]) -> None:
    """Draw numbers against n, with the fit from which the exponent in the legend is."""
    n = np.array(list(sizes.values()), dtype=float)
    for one in plotted:
        p, factor = growth(n, one.values)
        label = one.style.label
        if np.isfinite(p):
            label += f"  $n^{{{p:.2f}}}$"
            ends = np.array([FROM, n.max()])
            axes.plot(ends, factor * ends**p, color=one.style.color, linewidth=0.9)
        look: dict[str, Any] = {"color": one.style.color, "marker": one.style.marker, "ms": 5}
        axes.plot(n, one.values, label=label, linestyle="", **look)
    log_scale(axes, "x", "y")
    axes.set_xlabel("vertices n", fontsize=10, color=INK)
    axes.grid(color="#dddddd", linewidth=0.6)
    axes.set_axisbelow(True)


def log_scale(axes: Axes, *names: str) -> None:
    """Make the axes "x" or "y" logarithmic, with plain numbers at 1, 2, 5, 10, ..."""
    axes.set(**{f"{name}scale": "log" for name in names})
    for name in names:
        axis = axes.xaxis if name == "x" else axes.yaxis
        low, high = axis.get_view_interval()
        axis.set_major_locator(LogLocator(subs=(1, 2, 5) if high < DECADES * low else (1,)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.6g}"))
        axis.set_minor_formatter(NullFormatter())


def legend(figure: Figure, axes: Axes, columns: int) -> None:
    """Put the legend of one panel above all."""
    handles, labels = axes.get_legend_handles_labels()
    shown = figure.legend(
        handles, labels, loc="outside upper center", ncols=columns, frameon=False, fontsize=10
    )
    for handle in filter(None, shown.legend_handles):
        handle.set_alpha(1)
