"""
Two flat cortices with labels
=============================

Both hemispheres of ``fsaverage5``, which comes with nilearn, from their files to flat maps that one
can compare: the right one mirrored, both with the front of the head to the left. ``keep="lengths"``
asks for what FreeSurfer's flat patch is made for; it lies beside, with the same cuts, and all three
numbers are told of both: angles, areas, and the distances along the cortex over seven rings. All is
made and measured on the white surface, as FreeSurfer makes its patch on that one, smoothed.
"""

import importlib.util
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components, dijkstra

import cdcp_igl
from cdcp_igl.io import read_mesh, read_patch, read_values

# The files alone: importing all of nilearn takes a while.
(nilearn,) = importlib.util.find_spec("nilearn").submodule_search_locations
fsaverage5 = Path(nilearn, "datasets", "data", "fsaverage5")


def hemisphere(side, mirror):
    """The part of a cortex that its flat patch has, as left ones lie: with depth and patch."""
    V, _ = read_mesh(fsaverage5 / f"white_{side}.gii.gz")
    flat, F = read_mesh(fsaverage5 / f"flat_{side}.gii.gz")
    depth, _ = read_values(fsaverage5 / f"sulc_{side}.gii.gz", len(V))
    part = cdcp_igl.clean(V * [mirror, 1, 1], F[:, ::mirror])  # a mirror turns the faces over
    rows = part.vertex_index
    return part, depth[rows], flat[rows, :2] * [mirror, 1]


(left, depth_left, patch_left), (right, depth_right, patch_right) = (
    hemisphere("left", 1),
    hemisphere("right", -1),
)
maps = [cdcp_igl.free_map(part, keep="lengths") for part in (left, right)]
maps[0]

# %%
# The labels are the largest sulci, where the surface lies deep; those on the right have the numbers
# of those on the left, so that they are as near to one another as can be.


def graph_of(part, weights=None):
    """Edges between the vertices of a surface."""
    i, j = part.F[:, [0, 1, 2]].ravel(), part.F[:, [1, 2, 0]].ravel()
    weights = np.ones(len(i)) if weights is None else weights(i, j)
    n = len(part.V)
    return coo_matrix((weights, (i, j)), (n, n)).tocsr()


def sulci(part, depth, count, deep=0.7):
    """(n,) labels from 1, 0 elsewhere, and where the middles of these sulci are."""
    graph = graph_of(part, lambda i, j: (depth[i] > deep) & (depth[j] > deep))
    graph.eliminate_zeros()
    _, name = connected_components(graph, directed=False)
    largest = np.argsort(-np.bincount(name, depth > deep), kind="stable")[:count]
    labels = (name[:, None] == largest) @ np.arange(1, count + 1)
    return labels, np.array([part.V[labels == k].mean(axis=0) for k in range(1, count + 1)])


labels_left, middles = sulci(left, depth_left, 8)
labels_right, places = sulci(right, depth_right, 8)
_, same = linear_sum_assignment(np.linalg.norm(places[:, None] - middles, axis=2))
labels_right = np.append(0, same + 1)[labels_right]

# %%
# How well a map keeps distances, as the field reports it: from some vertices to those within seven
# rings, along edges on the cortex and straight in the plane, up to one factor for the whole map.


def distance_error(part, uv, rings=7):
    """Mean of the relative error of distances."""
    sources = np.arange(0, len(part.V), 25)
    near = dijkstra(graph_of(part), indices=sources, unweighted=True, limit=rings)
    lengths = graph_of(part, lambda i, j: np.linalg.norm(part.V[i] - part.V[j], axis=1))
    lengths = lengths.maximum(lengths.T)  # an inner edge is there twice
    row, vertex = np.nonzero(np.isfinite(near) & (near > 1))
    along = dijkstra(lengths, indices=sources)[row, vertex]
    straight = np.linalg.norm(uv[sources[row]] - uv[vertex], axis=1)
    return np.mean(abs(straight / along * np.sum(along) / np.sum(straight) - 1))


def turned(uv, part):
    """The same map with the front of the head, where y is large, to the left."""
    slope = np.linalg.lstsq(uv - uv.mean(axis=0), part.V[:, 1] - part.V[:, 1].mean(), rcond=None)[0]
    z = (uv - uv.mean(axis=0)) @ [1, 1j] * -abs(slope @ [1, 1j]) / (slope @ [1, 1j])
    return np.column_stack([z.real, z.imag])


fig, panels = plt.subplots(2, 2, layout="constrained", figsize=(9, 7.4))
both = (left, depth_left, labels_left, patch_left), (right, depth_right, labels_right, patch_right)
for row, side, (part, depth, labels, patch), result in zip(
    panels, ("left", "right, mirrored"), both, maps, strict=True
):
    for axes, name, uv in zip(
        row, ("keep='lengths'", "FreeSurfer"), (result.uv, patch), strict=True
    ):
        degrees = cdcp_igl.angle_distortion(*part[:2], uv).mean()
        areas = abs(cdcp_igl.area_distortion(*part[:2], uv))
        areas = areas[np.isfinite(areas)]  # where faces of the patch are flipped, or flat
        x, y = turned(uv, part).T
        axes.tripcolor(x, y, part.F, depth, shading="gouraud", cmap="gray_r", vmin=-2, vmax=4)
        for k in range(1, labels.max() + 1):
            sulcus = labels == k
            line = {"colors": ["crimson"], "linewidths": 1.6}
            axes.tricontour(x, y, part.F, sulcus.astype(float), levels=[0.5], **line)
            axes.text(x[sulcus].mean(), y[sulcus].mean(), str(k), weight="bold", color="darkblue")
        off = f"areas {np.mean(areas):.2f}, distances {distance_error(part, uv):.1%}"
        axes.set_title(f"{side}: {name}\nangles {degrees:.1f}°, {off}", fontsize=10)
        axes.set_aspect("equal")
        axes.set_axis_off()
plt.show()

# %%
# Into the files of the field, in the rows of the whole cortex: a patch of FreeSurfer, and labels
# that are -1 where the map has nothing.

with TemporaryDirectory() as folder:
    maps[0].save(Path(folder, "lh.lengths.patch.flat"))
    vertices, positions, border = read_patch(Path(folder, "lh.lengths.patch.flat"))
whole = maps[0].to_given(labels_left)
print(f"{len(vertices):,} vertices, {border.sum():,} at the border; {maps[0].left_out:,} left out")
print(f"{np.sum(whole > 0):,} of {len(whole):,} rows have a label")
