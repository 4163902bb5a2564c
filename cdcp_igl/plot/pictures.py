"""Pictures of a map, as in the paper's Figures 5 and 6."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, Ints
from ..distortion import angle_distortion
from ..extras import from_extra
from .layout import Mapped
from .raster import Bytes
from .scene import Extent, Scene

with from_extra("plot"):
    from matplotlib.axes import Axes
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.patches import Circle

__all__ = ["MapRow", "picture", "side_by_side"]

# A mesh and its maps: name, mean angular distortion, and uv where there is one.
MapRow = tuple[Floats, Ints, Sequence[tuple[str, float, Floats | None]]]

INK, FAINT = "#222222", "#9a9a9a"
PIXELS, SMALL = 620, 360  # across a surface, alone and among many


def picture(V: ArrayLike, F: ArrayLike, result: Mapped, *, name: str = "") -> Figure:
    """Draw the surface, its image, a checkerboard and the angular distortion side by side.

    Parameters
    ----------
    V : (n, 3) or (n, 2) array_like
        Vertex positions.
    F : (m, 3) array_like of integers
        Corners of the faces.
    result : DiskMap
        The map of this mesh.
    name : str
        Of the mesh, for the title.

    Returns
    -------
    matplotlib.figure.Figure
        The surface coloured by its normals, the same colours on the disk, the surface under
        a checkerboard of the disk, whose squares keep their right angles where the map is
        conformal, and the histogram of the angular distortion. The disk is turned to match the
        view of the surface. Independent of pyplot: save it with ``savefig``.

    Examples
    --------
    >>> import cdcp_igl
    >>> from cdcp_igl.plot import picture
    >>> V, F, _ = cdcp_igl.datasets.spherical_cap(10)
    >>> figure = picture(V, F, cdcp_igl.disk_map(V, F), name="cap")
    >>> len(figure.axes)
    4
    """
    scene = Scene(V, F, PIXELS)
    figure = Figure(figsize=(20, 5.4), dpi=150, facecolor="white")
    FigureCanvasAgg(figure)
    surface, disk, board, histogram = figure.subplots(
        1, 4, width_ratios=(1, 1, 1, 0.85), gridspec_kw={"wspace": 0.12}
    )
    _show(surface, scene.by_normal())
    _show(disk, scene.disk(result.uv), scene.extent(result.uv))
    _show(board, scene.checkerboard(result.uv))
    disk.add_patch(Circle((0, 0), 1, fill=False, edgecolor=INK, linewidth=0.6))
    _draw_histogram(histogram, angle_distortion(V, F, result.uv).ravel(), result)
    figure.subplots_adjust(left=0.01, right=0.985, bottom=0.12, top=0.88)

    flips = len(result.certificate.flipped)
    title = ", ".join(
        [
            *([name] if name else []),
            f"{len(result.uv):,} vertices",
            f"angular distortion {result.distortion.mean:.3f}° ± {result.distortion.sd:.3f}°",
            f"{flips:,} flipped faces",
        ]
    )
    figure.suptitle(title, color=INK, fontsize=13, y=0.965)
    return figure


def side_by_side(rows: Sequence[MapRow]) -> Figure:
    """Draw several maps of each of several meshes.

    Parameters
    ----------
    rows : sequence of (V, F, maps)
        A mesh and its maps, a sequence of (name, mean angular distortion in degrees,
        uv (n, 2), or None where there is no map).

    Returns
    -------
    matplotlib.figure.Figure
        A row a mesh: the surface coloured by its normals, then each map in the same
        colours, scaled to the same size and turned to match the view.

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
    columns = 1 + max(len(maps) for _, _, maps in rows)
    figure = Figure(figsize=(2.6 * columns, 2.9 * len(rows)), dpi=150, facecolor="white")
    FigureCanvasAgg(figure)
    panels = figure.subplots(len(rows), columns, squeeze=False)
    for line, (V, F, maps) in zip(panels, rows, strict=True):
        scene = Scene(V, F, SMALL)
        _show(line[0], scene.by_normal())
        line[0].set_title(f"{len(V):,} vertices", color=INK, fontsize=10)
        for axes, (name, mean, uv) in zip(line[1:], maps, strict=False):
            axes.set_axis_off()
            axes.set_title(name if uv is None else f"{name}  {mean:.3f}°", color=INK, fontsize=10)
            if uv is None:
                axes.text(0.5, 0.5, "no map", ha="center", color=FAINT)
            else:
                _show(axes, scene.disk(uv))
    figure.tight_layout()
    return figure


def _show(axes: Axes, image: Bytes, extent: Extent | None = None) -> None:
    axes.imshow(image, extent=extent)
    axes.set_axis_off()


def _draw_histogram(axes: Axes, degrees: Floats, result: Mapped) -> None:
    """Draw the shares of the corners by distortion, the long tail cut off."""
    mean, sd = result.distortion.mean, result.distortion.sd
    end = max(float(np.quantile(degrees, 0.99)), mean + 2 * sd, 1e-9)
    beyond = float((degrees > end).mean())
    shares = np.full(len(degrees), 100 / len(degrees))
    axes.hist(degrees, bins=60, range=(0, end), weights=shares, color="#5b7db1", linewidth=0)
    axes.axvline(mean, color=INK, linewidth=1)
    axes.axvspan(max(mean - sd, 0), mean + sd, color=INK, alpha=0.07, linewidth=0, zorder=0)
    axes.text(
        0.97,
        0.95,
        f"mean {mean:.3f}°\nSD {sd:.3f}°\nmax {result.distortion.max:.1f}°\n"
        f"{100 * beyond:.2g} % beyond {end:.3g}°",
        transform=axes.transAxes,
        ha="right",
        va="top",
        color=INK,
        fontsize=11,
        linespacing=1.5,
    )
    axes.set(xlim=(0, end), xlabel="angular distortion in degrees", ylabel="% of corners")
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(FAINT)
    axes.tick_params(color=FAINT, labelcolor=INK)
