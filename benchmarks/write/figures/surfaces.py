"""Figures 4, 5 and 9: surfaces, their images, and their centres."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from cdcp_igl.arrays import Ints
from cdcp_igl.plot.raster import SAMPLES, in_picture
from cdcp_igl.plot.scene import Scene
from cdcp_igl.solve.factored import FactoredSurface
from cdcp_igl.surface.mesh import DiskMesh

from ...measure.ablation import CENTERS
from ...records.results import Measured, NotMeasured
from .style import BLUE, GREEN, ORANGE, RED, drawn_to, legend, model_name, new, require_few

SHOWN = ("chinese_lion", "stanford_bunny_31593", "human_brain", "left_hand")  # with centres
LARGEST = 100_000  # vertices of a model with centres, where those are not at hand
PIXELS = 280
IMAGES = 180  # pixels of a surface or disk among many
PAIRS = 4  # of surface and disk, across
NEAR = 0.03  # of the width: how far behind what is seen a point counts as seen

# Open markers of growing size: they are all seen where they coincide.
MARKS = {
    "heat t=1e3": ("heat, $t = 10^3$", ORANGE, "o", 5),
    "heat t=1e4": ("heat, $t = 10^4$", BLUE, "s", 8.5),
    "heat t=1e5": ("heat, $t = 10^5$", RED, "D", 11),
    "torsion": ("torsion", GREEN, "^", 15),
    "centroid": ("nearest to the centroid", RED, "^", 9),
}


@drawn_to("figure-04-heat.png")
def heat_times(measured: Measured) -> Figure:
    """Figure 4: the centre by heat diffusion.

    The coldest face after heat has come in from the boundary for time t, and the face where the
    torsion function is largest, which needs no t. Faint: behind the surface.
    """
    return _centers(measured, ("heat t=1e3", "heat t=1e4", "heat t=1e5", "torsion"))


@drawn_to("figure-09-centres.png")
def heat_and_centroid(measured: Measured) -> Figure:
    """Figure 9: the centre by heat and the centroid.

    The coldest face for t = 10⁴ and the face nearest to the centroid of the surface's area.
    Faint: behind the surface.
    """
    return _centers(measured, ("heat t=1e4", "centroid"))


def _centers(measured: Measured, names: Sequence[str]) -> Figure:
    models = [model for model in SHOWN if model in measured.sizes]
    models = models or [model for model, n in measured.sizes.items() if n <= LARGEST][:4]
    if not models:
        raise NotMeasured("no small model is measured; run: python -m benchmarks tables")
    figure, panels = new(2.6 * max(len(models), 3), 3.3, ncols=len(models))
    for axes, model in zip(panels[0], models, strict=True):
        V, F = measured.surface(model)
        surface = FactoredSurface.of(DiskMesh(V, F))
        scene = Scene(surface.mesh.scaled, surface.mesh.F, PIXELS)
        axes.imshow(scene.plain())
        axes.set_axis_off()
        axes.set_title(model_name(model, len(V)), fontsize=10)
        for name in names:
            label, color, marker, size = MARKS[name]
            x, y, visible = _located(scene, surface.mesh.F, CENTERS[name](surface).face)
            axes.plot(
                *(x, y, marker),
                label=label,
                color=color,
                markersize=size,
                fillstyle="none",
                markeredgewidth=1.8,
                alpha=1 if visible else 0.35,
                linestyle="",
            )
    legend(figure, panels[0, 0], len(names))
    return figure


def _located(scene: Scene, F: Ints, face: int) -> tuple[float, float, bool]:
    """Return where a face is in the picture, right and down, and whether one sees it."""
    x, y = in_picture(scene.points, PIXELS)[F[face]].mean(axis=0)
    sample = int(SAMPLES * y), int(SAMPLES * x)
    hiding = F[scene.surface.face[sample]]
    nearest = scene.surface.weights[sample] @ scene.points[hiding, 2]
    depth = scene.points[F[face], 2].mean()
    return x, y, bool(depth > nearest - NEAR * np.ptp(scene.points[:, :2], axis=0).max())


@drawn_to("figure-05-maps.jpg")
def images(measured: Measured) -> Figure:
    """Figure 5: surfaces and their disks.

    Each surface with its number of vertices, coloured by normal, and its map by CDCP in the same
    colours, turned to match the view.
    """
    results, _ = measured.require("tables", ("cdcp",))
    require_few(results)
    pictures = []
    for model in results.mapped:
        uv = measured.map(model, "cdcp")
        if uv is not None:
            V, F = measured.surface(model)
            scene = Scene(V, F, IMAGES)
            pictures.append((model_name(model, len(V)), scene.by_normal(), scene.disk(uv)))
    if not pictures:
        raise NotMeasured("no model has a map by CDCP")
    rows, pairs = -(-len(pictures) // PAIRS), min(PAIRS, len(pictures))
    figure, panels = new(2.75 * pairs, 1.75 * rows, nrows=rows, ncols=2 * pairs)
    for axes in panels.flat:
        axes.set_axis_off()
    for k, (name, surface, disk) in enumerate(pictures):
        row, column = divmod(k, pairs)
        left, right = panels[row, 2 * column : 2 * column + 2]
        left.imshow(surface)
        right.imshow(disk)
        left.set_title(name, fontsize=8)
    figure.set_layout_engine("constrained", w_pad=0.01, h_pad=0.01, wspace=0.01, hspace=0.01)
    return figure
