"""Pictures of a map, as in the paper's Figures 5 and 6."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from .arrays import Floats, Ints
from .distortion import angle_distortion
from .extras import from_extra
from .mesh import DiskMesh
from .result import DiskMap

with from_extra("plot"):
    from matplotlib.axes import Axes
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.collections import TriMesh
    from matplotlib.figure import Figure
    from matplotlib.patches import Circle
    from matplotlib.tri import Triangulation

__all__ = ["MapRow", "picture", "side_by_side"]

# A mesh and its maps: name, mean angular distortion, and uv where there is one.
MapRow = tuple[ArrayLike, ArrayLike, Sequence[tuple[str, float, Floats | None]]]

INK, FAINT = "#222222", "#9a9a9a"
LIGHT = np.array([-0.35, 0.5, 0.79])  # from above left, behind the viewer
DIRECTIONS = 101  # among which the viewpoint is sought


def picture(V: ArrayLike, F: ArrayLike, result: DiskMap, *, name: str = "") -> Figure:
    """Draw the surface, its image and the angular distortion side by side.

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
        The surface coloured by its normals; the same colours on the disk, which is turned
        to match the view; and the histogram of the angular distortion. Independent of
        pyplot: save it with ``savefig``.
    """
    mesh = DiskMesh(V, F)
    seen = mesh.V @ _viewpoint(mesh).T
    colors = _normal_colors(_vertex_normals(seen, mesh.F))

    figure = Figure(figsize=(15, 5.4), dpi=150, facecolor="white")
    FigureCanvasAgg(figure)
    surface, disk, histogram = figure.subplots(
        1, 3, width_ratios=(1, 1, 0.85), gridspec_kw={"wspace": 0.12}
    )
    far_to_near = np.argsort(seen[mesh.F, 2].sum(axis=1))
    _draw_triangles(surface, seen[:, :2], mesh.F[far_to_near], colors)
    _draw_triangles(disk, _turned_like(seen, result.uv), mesh.F, colors)
    disk.add_patch(Circle((0, 0), 1, fill=False, edgecolor=INK, linewidth=0.6))
    disk.set(xlim=(-1.02, 1.02), ylim=(-1.02, 1.02))
    _draw_histogram(histogram, angle_distortion(V, F, result.uv).ravel(), result)
    figure.subplots_adjust(left=0.01, right=0.985, bottom=0.12, top=0.88)

    flips = len(result.certificate.flipped)
    title = ", ".join(
        [
            *([name] if name else []),
            f"{len(mesh.V):,} vertices",
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
        uv (n, 2), or None where the method failed).

    Returns
    -------
    matplotlib.figure.Figure
        A row a mesh: the surface coloured by its normals, then each map in the same
        colours, scaled to the same size and turned to match the view.
    """
    columns = 1 + max(len(maps) for _, _, maps in rows)
    figure = Figure(figsize=(2.6 * columns, 3 * len(rows)), dpi=150, facecolor="white")
    FigureCanvasAgg(figure)
    panels = figure.subplots(len(rows), columns, squeeze=False)
    for line, (V, F, maps) in zip(panels, rows, strict=True):
        mesh = DiskMesh(V, F)
        seen = mesh.V @ _viewpoint(mesh).T
        colors = _normal_colors(_vertex_normals(seen, mesh.F))
        far_to_near = np.argsort(seen[mesh.F, 2].sum(axis=1))
        _draw_triangles(line[0], seen[:, :2], mesh.F[far_to_near], colors)
        line[0].set_title(f"{len(mesh.V):,} vertices", color=INK, fontsize=10)
        for axes, (name, mean, uv) in zip(line[1:], maps, strict=False):
            if uv is None:
                axes.text(0.5, 0.5, "no map", ha="center", color=FAINT, transform=axes.transAxes)
            else:
                _draw_triangles(axes, _turned_like(seen, uv), mesh.F, colors)
            label = name if uv is None else f"{name}  {mean:.3f}°"
            axes.set_title(label, color=INK, fontsize=10)
        for axes in line:
            axes.set_axis_off()
    figure.tight_layout()
    return figure


def _turned_like(seen: Floats, uv: Floats) -> Floats:
    """Rotate the disk to agree with the surface as it is seen."""
    view, f = seen[:, 0] + 1j * seen[:, 1], uv[:, 0] + 1j * uv[:, 1]
    turn = np.vdot(f, view - view.mean())
    f = f * turn / abs(turn) if turn else f
    return np.column_stack([f.real, f.imag])


def _draw_triangles(axes: Axes, xy: Floats, F: Ints, colors: Floats) -> None:
    """Draw triangles in the given order, colours interpolated between the vertices."""
    mesh = TriMesh(Triangulation(xy[:, 0], xy[:, 1], F))
    mesh.set_facecolor(colors)  # type: ignore[arg-type]  # arrays are accepted
    axes.add_collection(mesh)
    axes.autoscale_view()
    axes.set_aspect("equal")
    axes.set_axis_off()


def _draw_histogram(axes: Axes, degrees: Floats, result: DiskMap) -> None:
    """Draw the shares of the corners by distortion, the long tail cut off."""
    mean, sd = result.distortion.mean, result.distortion.sd
    end = max(float(np.quantile(degrees, 0.99)), mean + 2 * sd, 1e-9)
    beyond = float((degrees > end).mean())
    shares = np.full(len(degrees), 100 / len(degrees))
    axes.hist(degrees, bins=60, range=(0, end), weights=shares, color="#5b7db1", linewidth=0)
    axes.axvline(mean, color=INK, linewidth=1)
    axes.axvspan(max(mean - sd, 0), mean + sd, color=INK, alpha=0.07, linewidth=0)
    axes.text(
        0.97,
        0.95,
        f"mean {mean:.3f}°\nSD {sd:.3f}°\nmax {result.distortion.max:.1f}°\n"
        f"{100 * beyond:.1f} % beyond",
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


# -- colours ---------------------------------------------------------------------------


def _vertex_normals(V: Floats, F: Ints) -> Floats:
    """(n, 3) unit normals, faces weighted by area."""
    i, j, k = F.T
    across = np.cross(V[j] - V[i], V[k] - V[i])
    corners = F.ravel()
    normals = np.column_stack(
        [np.bincount(corners, np.repeat(across[:, axis], 3), len(V)) for axis in range(3)]
    )
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return normals / np.where(lengths > 0, lengths, 1)


def _normal_colors(normals: Floats) -> Floats:
    """(n, 4) RGBA: each axis of the normal, as the viewer has it, on a primary; lit."""
    base = 0.5 + 0.5 * normals
    light = LIGHT / np.linalg.norm(LIGHT)
    shade = 0.75 + 0.35 * (normals @ light)
    colors = np.ones((len(normals), 4))
    colors[:, :3] = np.clip(base * shade[:, None], 0, 1)
    return colors


# -- viewpoint -------------------------------------------------------------------------


def _viewpoint(mesh: DiskMesh) -> Floats:
    """(3, 3) rotation with the rows right, up, towards the viewer.

    Of many directions, the one from which most of the outside and little of the inside is
    seen. A boundary like the base of a bust points down, and is looked at from the side;
    where it surrounds the view, the y axis is up, or the z axis in a view along y.
    """
    corners = mesh.V[mesh.F]
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    middle = np.average(corners.mean(axis=1), axis=0, weights=np.linalg.norm(areas, axis=1))
    rise = (middle - mesh.V[mesh.loop].mean(axis=0)) / np.ptp(mesh.V, axis=0).max()

    directions = _sphere(DIRECTIONS)
    scores = []
    for towards in directions:
        seen = areas @ towards
        scores.append(np.where(seen > 0, seen, seen / 2).sum() * (1 - 2 * (rise @ towards) ** 2))
    towards = directions[int(np.argmax(scores))]

    up = rise - (rise @ towards) * towards
    if np.linalg.norm(up) < 0.2:
        up = np.array([0.0, 1, 0]) if abs(towards[1]) < 0.8 else np.array([0.0, 0, 1])
        up -= (up @ towards) * towards
    up /= np.linalg.norm(up)
    return np.array([np.cross(up, towards), up, towards])


def _sphere(n: int) -> Floats:
    """(n, 3) unit vectors spread evenly, by a golden spiral from pole to pole."""
    z = 1 - (2 * np.arange(n) + 1) / n
    turn = np.pi * (3 - np.sqrt(5)) * np.arange(n)
    r = np.sqrt(1 - z**2)
    return np.column_stack([r * np.cos(turn), r * np.sin(turn), z])
