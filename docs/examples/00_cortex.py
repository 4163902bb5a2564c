"""
A cortex on the disk
====================

The left cortex of ``fsaverage5``, which comes with nilearn, opened along the cuts that FreeSurfer
made for its own flat patch. Turn it, and point at the disk to find a place on the cortex.
``result.view(fields={"depth": depth}, beside={"flat patch": flat})`` opens the same page coloured
by the depth of the folds, with the flat patch beside the disk.
"""

import importlib.util
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import cdcp_igl
from cdcp_igl.io import read_mesh, read_values

# The files alone: importing all of nilearn takes a while.
(nilearn,) = importlib.util.find_spec("nilearn").submodule_search_locations
fsaverage5 = Path(nilearn, "datasets", "data", "fsaverage5")

V, _ = read_mesh(fsaverage5 / "pial_left.gii.gz")
flat, F = read_mesh(fsaverage5 / "flat_left.gii.gz")  # the faces of the patch, rows of all vertices
depth, _ = read_values(fsaverage5 / "sulc_left.gii.gz", len(V))
part = cdcp_igl.clean(V, F)  # without the vertices that the flat patch leaves out
depth, flat = depth[part.vertex_index], flat[part.vertex_index, :2]
result = cdcp_igl.disk_map(part, refine=5)
result

# %%
# The flat patch keeps lengths as well as it can, and pays with its angles; the disk keeps its
# angles, and pays with its areas: these differ by so many per cent in the mean (of the logarithm
# of the ratio).

fig, panels = plt.subplots(1, 2, layout="constrained", figsize=(9, 4.8))
for axes, name, uv in zip(panels, ("disk", "flat patch"), (result.uv, flat), strict=True):
    degrees = cdcp_igl.angle_distortion(*part[:2], uv)
    areas = abs(cdcp_igl.area_distortion(*part[:2], uv))
    axes.tripcolor(*np.transpose(uv), part.F, depth, shading="gouraud", cmap="viridis")
    off = np.exp(areas[np.isfinite(areas)].mean()) - 1
    axes.set_title(f"{name}: angles off by {degrees.mean():.1f}°,\nareas by {off:.0%}")
    axes.set_aspect("equal")
    axes.set_axis_off()
assert result.distortion.mean < 3 < 10 < cdcp_igl.angle_distortion(*part[:2], flat).mean()
plt.show()

# %%
# Saved as FreeSurfer saves its own: in the rows of the whole cortex, read by what reads these.
#
# .. code-block:: python
#
#     result.save("lh.disk.patch.flat")  # or .surf.gii
#     result.to_given(depth)  # a row for each vertex of the file, NaN where there is no disk
