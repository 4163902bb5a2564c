"""Pictures of a map, as in the paper's Figures 5 and 6."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .areas import face_areas
from .arrays import Floats, Ints
from .check import as_faces, as_vertices
from .distortion import angle_distortion
from .extras import from_extra
from .result import DiskMap

with from_extra("plot"):
    from matplotlib.axes import Axes
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.collections import TriMesh
    from matplotlib.figure import Figure
    from matplotlib.patches import Circle
    from matplotlib.tri import Triangulation

__all__ = ["picture"]

INK, FAINT = "#222222", "#9a9a9a"
LIGHT = np.array([-0.35, 0.5, 0.79])  # from above left, behind the viewer
DIRECTIONS = 400  # among which the viewpoint is sought
SEEN = 20_000  # faces that judge a viewpoint
PIXELS = 64  # across the grid on which they hide one another


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
        The surface coloured by its normals, the same colours on the disk, and the
        histogram of the angular distortion. Independent of pyplot: save it with
        ``savefig``.
    """
    positions = as_vertices(V)
    faces = as_faces(F, len(positions))
    view = _viewpoint(positions, faces)
    seen = positions @ view.T
    colors = _normal_colors(_vertex_normals(seen, faces))

    figure = Figure(figsize=(15, 5.4), dpi=150, facecolor="white")
    FigureCanvasAgg(figure)
    surface, disk, histogram = figure.subplots(
        1, 3, width_ratios=(1, 1, 0.85), gridspec_kw={"wspace": 0.12}
    )
    far_to_near = np.argsort(seen[faces, 2].sum(axis=1))
    _draw_triangles(surface, seen[:, :2], faces[far_to_near], colors)
    _draw_triangles(disk, result.uv, faces, colors)
    disk.add_patch(Circle((0, 0), 1, fill=False, edgecolor=INK, linewidth=0.6))
    disk.set(xlim=(-1.02, 1.02), ylim=(-1.02, 1.02))
    _draw_histogram(histogram, angle_distortion(V, F, result.uv).ravel(), result)
    figure.subplots_adjust(left=0.01, right=0.985, bottom=0.12, top=0.88)

    flips = len(result.certificate.flipped)
    title = ", ".join(
        [
            *([name] if name else []),
            f"{len(positions):,} vertices",
            f"angular distortion {result.distortion.mean:.3f}° ± {result.distortion.sd:.3f}°",
            f"{flips:,} flipped faces",
        ]
    )
    figure.suptitle(title, color=INK, fontsize=13, y=0.965)
    return figure


def _draw_triangles(axes: Axes, xy: Floats, F: Ints, colors: Floats) -> None:
    """Draw triangles in the given order, colours interpolated between the vertices."""
    mesh = TriMesh(Triangulation(*xy.T, F))
    mesh.set_facecolor(colors)
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
    shade = 0.45 + 0.55 * np.clip(normals @ light, 0, 1)
    colors = np.ones((len(normals), 4))
    colors[:, :3] = np.clip(base * shade[:, None] * 1.15, 0, 1)
    return colors


# -- viewpoint -------------------------------------------------------------------------


def _viewpoint(V: Floats, F: Ints) -> Floats:
    """(3, 3) rotation: rows right, up, towards the viewer.

    Of many directions, the one that shows most of the outside and least of the inside.
    """
    chosen = np.linspace(0, len(F) - 1, min(len(F), SEEN)).astype(np.int64)
    centers = V[F[chosen]].mean(axis=1)
    i, j, k = F[chosen].T
    normals = np.cross(V[j] - V[i], V[k] - V[i])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    directions = _sphere(DIRECTIONS)
    scores = [_outside_seen(centers, normals, towards) for towards in directions]
    towards = directions[int(np.argmax(scores))]
    mean_normal = np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]).sum(axis=0)
    mean_normal /= 2 * face_areas(V, F).sum()
    up = _up(mean_normal, towards)
    return np.array([np.cross(up, towards), up, towards])
