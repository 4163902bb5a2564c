"""How the figures look: told apart by colour, and without it by marker and hatch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
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

from ...measure.candidate import split
from ...records.results import Measured, NotMeasured, Section

INK, FAINT, BAND, GRID = "#222222", "#8a8a8a", "#f3f3f3", "#dddddd"
# M. Okabe, K. Ito. Color Universal Design, 2008.
BLACK, ORANGE, SKY, GREEN, YELLOW, BLUE, RED, PURPLE = (
    *("#000000", "#e69f00", "#56b4e9", "#009e73"),
    *("#f0e442", "#0072b2", "#d55e00", "#cc79a7"),
)
DECADES = 1e3  # ratio of the ends of an axis from which on it has ticks at 1, 10, ... only
MOST = 30  # surfaces that a figure with a row or a panel for each can show
OWN = ("1", "2", "3", "4", "+", "|", "_")  # markers of methods that have no style
HATCHES = ("", "///", "...", "\\\\\\", "xxx", "---", "ooo", "+++")


LOOK: Any = {
    **{"figure.dpi": 120, "figure.constrained_layout.use": True},
    **{"axes.spines.top": False, "axes.spines.right": False, "axes.edgecolor": FAINT},
    **{"axes.labelsize": 10, "axes.labelcolor": INK, "axes.titlecolor": INK},
    **{"legend.frameon": False, "legend.fontsize": 10},
}


@dataclass(frozen=True)
class Plot:
    """A figure that can be drawn; the docstring of what draws it is its title and caption.

    Attributes
    ----------
    file : str
        Name of its file.
    draw : callable
        From `Measured` to a figure; raises NotMeasured.
    """

    file: str
    draw: Callable[[Measured], Figure]

    def __call__(self, measured: Measured) -> Figure:
        """Draw it."""
        with rc_context(LOOK):
            return self.draw(measured)


def drawn_to(file: str) -> Callable[[Callable[[Measured], Figure]], Plot]:
    """Make a function that draws a `Plot`."""
    return partial(Plot, file)


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
    "cdcp keep=areas": Style("CDCP, areas", SKY, "s"),
    "free keep=0.2": Style("CDCP, keep=0.2", SKY, "d"),
    "free keep=areas": Style("CDCP, free outline, areas", SKY, "H"),
    "free keep=lengths": Style("CDCP, lengths", SKY, "D"),
    "sem": Style("stretch energy", ORANGE, "D"),
    "slim": Style("SLIM, free boundary", GREEN, "<"),
    "arap": Style("ARAP, free boundary", GREEN, ">"),
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
    figure = Figure(figsize=(width, height))
    FigureCanvasAgg(figure)
    panels = figure.subplots(squeeze=False, **grid)  # type: ignore[call-overload]
    for axes in panels.flat:
        axes.tick_params(color=FAINT, labelcolor=INK, labelsize=9)
    return figure, panels


def encode(figure: Figure, suffix: str) -> bytes:
    """Return the figure as a small file: .png of 256 colours, or .jpg for shaded surfaces."""
    whole, small = BytesIO(), BytesIO()
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


def require_few(results: Section) -> None:
    """Raise NotMeasured if there are too many surfaces for a figure that shows each."""
    if len(results.mapped) > MOST:
        raise NotMeasured(
            f"{len(results.mapped):,} surfaces are too many to show each, more than {MOST}; "
            "see the figures over all of them"
        )


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
    shown = figure.legend(handles, labels, loc="outside upper center", ncols=columns)
    for handle in filter(None, shown.legend_handles):
        handle.set_alpha(1)
