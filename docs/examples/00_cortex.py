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
import nibabel
import numpy as np

import cdcp_igl

# The files alone: importing all of nilearn takes a while.
(nilearn,) = importlib.util.find_spec("nilearn").submodule_search_locations
fsaverage5 = Path(nilearn, "datasets", "data", "fsaverage5")


def arrays(name):
    return [array.data for array in nibabel.load(fsaverage5 / f"{name}_left.gii.gz").darrays]


(V, _), (depth,), (flat, F) = arrays("pial"), arrays("sulc"), arrays("flat")
V, F, row, *_ = cdcp_igl.clean(V, F)  # without the vertices that the flat patch leaves out
depth, flat = depth[row], flat[row, :2]
result = cdcp_igl.disk_map(V, F, refine=5)
result

# %%
# The flat patch keeps lengths as well as it can, and pays with its angles.

fig, panels = plt.subplots(1, 2, layout="constrained", figsize=(9, 4.6))
for axes, name, uv in zip(panels, ("disk", "flat patch"), (result.uv, flat), strict=True):
    degrees = cdcp_igl.angle_distortion(V, F, uv)
    axes.tripcolor(*np.transpose(uv), F, depth, shading="gouraud", cmap="viridis")
    axes.set_title(f"{name}: angles off by {degrees.mean():.1f}° ± {degrees.std():.1f}°")
    axes.set_aspect("equal")
    axes.set_axis_off()
assert result.distortion.mean < 3 < 10 < cdcp_igl.angle_distortion(V, F, flat).mean()
plt.show()
