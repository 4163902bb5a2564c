"""Pictures of a map, as in the paper's Figures 5 and 6."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill

import numpy as np

from ..arguments import typed
from ..arrays import Floats, Ints
from ..errors import counted
from ..extras import from_extra
from ..verdict.distortion import AngleDistortion, angle_distortion
from .layout import Layout
from .raster import Bytes
from .scene import Extent, Scene

with from_extra("plot"):
    from matplotlib.axes import Axes
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.patches import Circle

# A mesh and its maps: name, mean angular distortion, and uv where there is one.
MapRow = tuple[Floats, Ints, Sequence[tuple[str, float, Floats | None]]]

INK, FAINT = "#222222", "#9a9a9a"
PIXELS, SMALL = 620, 360  # across a surface, alone and among many
ACROSS = 5  # panels in a row
LINE = 26  # characters of a name: as many capitals are as wide as a surface


def draw(layout: Layout, name: str = "") -> Figure:
    """Draw what `Result.plot` returns."""
    (V, F, uv), plane = layout.drawn, layout.plane.lower()
    scene = Scene(V, F, PIXELS, turns=layout.turns)
    figure = Figure(figsize=(20, 5.4), dpi=150, facecolor="white")
    FigureCanvasAgg(figure)
    surface, image, board, histogram = figure.subplots(
        1, 4, width_ratios=(1, 1, 1, 0.85), gridspec_kw={"wspace": 0.12}
    )
    _show(surface, scene.by_normal(), title="surface, coloured by its normals")
    _show(image, scene.disk(uv), scene.extent(uv), title=f"{plane} in the same colours")
    _show(board, scene.checkerboard(uv), title=f"checkerboard of the {plane} on the surface")
    if layout.plane == "Disk":
        image.add_patch(Circle((0, 0), 1, fill=False, edgecolor=INK, linewidth=0.6))
    degrees = angle_distortion(V, F, uv).ravel()
    _draw_histogram(histogram, degrees, layout.distortion)
    figure.subplots_adjust(left=0.01, right=0.985, bottom=0.12, top=0.88)

    mean, sd = layout.distortion.mean, layout.distortion.sd
    title = ", ".join(
        [
            *([name] if name else []),
            f"{len(np.unique(layout.vertices)):,} vertices",
            f"angular distortion: mean {mean:.3f}°, SD {sd:.3f}°",
            counted(layout.flipped, "flipped face", "flipped faces"),
        ]
    )
    figure.suptitle(title, color=INK, fontsize=13, y=0.965, parse_math=False)
    return figure


@typed
def side_by_side(
    rows: Sequence[MapRow], *, names: Sequence[str] = (), turns: bool = True
) -> Figure:
    """Draw several maps of each of several meshes.

    Parameters
    ----------
    rows : sequence of (V, F, maps)
        A mesh and its maps, a sequence of (name, mean angular distortion in degrees,
        uv (n, 2), or None where there is no map).
    names : sequence of str, optional
        Of the meshes.
    turns : bool
        Turn each map to match the view of the surface.

    Returns
    -------
    matplotlib.figure.Figure
        A row a mesh, or more of five panels each: the surface coloured by its normals, then each
        map in the same colours, scaled to the same size.

    Examples
    --------
    >>> import cdcp_igl
    >>> from cdcp_igl.plot import side_by_side
    >>> V, F, exact = cdcp_igl.datasets.spherical_cap(10)
    >>> maps = [
    ...     (name, cdcp_igl.angle_distortion(V, F, uv).mean(), uv)
    ...     for name, uv in {"exact": exact, "cdcp": cdcp_igl.cdcp(V, F)}.items()
    ... ]
    >>> figure = side_by_side([(V, F, maps)])
    >>> len(figure.axes)
    3
    """
    columns = min(1 + max(len(maps) for _, _, maps in rows), ACROSS)
    lines = [-(-(1 + len(maps)) // columns) for _, _, maps in rows]  # of panels, of each mesh
    size = (2.6 * columns, 2.9 * sum(lines))
    # The layout that makes room for titles of several lines.
    figure = Figure(figsize=size, dpi=150, facecolor="white", layout="constrained")
    FigureCanvasAgg(figure)
    panels = iter(figure.subplots(sum(lines), columns, squeeze=False))
    for count, mesh, (V, F, maps) in zip(lines, names or [""] * len(rows), rows, strict=True):
        own = np.concatenate([next(panels) for _ in range(count)])
        for axes in own[1 + len(maps) :]:
            axes.remove()
        scene = Scene(V, F, SMALL, turns=turns)
        told = [*([fill(mesh, LINE)] if mesh else []), f"{len(V):,} vertices"]
        _show(own[0], scene.by_normal(), title="\n".join(told))
        for axes, (name, mean, uv) in zip(own[1:], maps, strict=False):
            axes.set_axis_off()
            if uv is None:
                axes.set_title(name, color=INK, fontsize=10)
                axes.text(0.5, 0.5, "no map", ha="center", color=FAINT)
            else:
                _show(axes, scene.disk(uv), title=f"{name}  {mean:.3f}°")
    note = "Degrees: mean of the angular distortion"
    figure.supxlabel(note, x=0.01, ha="left", color=FAINT, fontsize=8)
    return figure


def _show(axes: Axes, image: Bytes, extent: Extent | None = None, *, title: str) -> None:
    axes.imshow(image, extent=extent)
    axes.set_axis_off()
    axes.set_title(title, color=INK, fontsize=10, parse_math=False)  # a name may have dollars


def _draw_histogram(axes: Axes, degrees: Floats, distortion: AngleDistortion) -> None:
    """Draw the shares of the corners by distortion, the long tail cut off."""
    mean, sd = distortion.mean, distortion.sd
    end = max(float(np.quantile(degrees, 0.99)), mean + 2 * sd, 1e-9)
    beyond = float((degrees > end).mean())
    shares = np.full(len(degrees), 100 / len(degrees))
    axes.hist(degrees, bins=60, range=(0, end), weights=shares, color="#5b7db1", linewidth=0)
    axes.axvline(mean, color=INK, linewidth=1, label=f"mean {mean:.3f}°")
    band = axes.axvspan(max(mean - sd, 0), mean + sd, color=INK, alpha=0.07, linewidth=0, zorder=0)
    band.set_label(f"± SD, standard deviation {sd:.3f}°")
    tail = f"maximum {distortion.max:.1f}°\n{100 * beyond:.2g} % beyond {end:.3g}°"
    axes.plot([], [], linestyle="none", label=tail)
    axes.legend(loc="upper right", frameon=False, labelcolor=INK, fontsize=11)
    axes.set(xlim=(0, end), xlabel="angular distortion in degrees", ylabel="% of corners")
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(FAINT)
    axes.tick_params(color=FAINT, labelcolor=INK)
