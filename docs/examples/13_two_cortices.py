"""
Two cortices on one sphere
==========================

Both hemispheres of ``fsaverage5``, which comes with nilearn, the right one mirrored. Each is mapped
onto the sphere conformally; eight landmarks then lay one sphere over the other, so that each place
of the left cortex has one on the right.
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
    return [array.data for array in nibabel.load(fsaverage5 / f"{name}.gii.gz").darrays]


(V_left, F_left), (depth_left,) = arrays("pial_left"), arrays("sulc_left")
(V_right, F_right), (depth_right,) = arrays("pial_right"), arrays("sulc_right")
V_right, F_right = V_right * [-1, 1, 1], F_right[:, ::-1]  # a mirror turns the faces over
left = cdcp_igl.sphere_map(V_left, F_left, refine=5)
right = cdcp_igl.sphere_map(V_right, F_right, refine=5)
left

# %%
# The landmarks are the vertices that lie farthest out in eight directions, towards the corners of
# a cube. A Möbius transformation and a rotation bring those of the left cortex near those of the
# right: the map stays conformal, and so it cannot take all of them there.

corners = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, 8)
landmarks = np.column_stack([(V @ corners).argmax(axis=0) for V in (V_left, V_right)])
points = left.register(right, landmarks)

there = right.interpolate(V_right, points)  # where each vertex of the left cortex comes to lie
error = np.linalg.norm(there - V_left, axis=1)
alike = np.corrcoef(depth_left, right.interpolate(depth_right, points))[0, 1]
before = np.corrcoef(depth_left, right.interpolate(depth_right, left.points))[0, 1]
assert before < 0.4 < 0.8 < alike
print(f"Correlation of the depth of folds: {before:.2f} before, {alike:.2f} after")

# %%
# The spheres by the depth of the folds, dark on top of them and bright below, from the outer side
# and the inner one; and how far from each other corresponding places are in the head.


def draw(axes, P, F, values, title, **scale):
    """Draw the half of a sphere that one sees from its first coordinate."""
    front = F[P[F, 0].mean(axis=1) < 0]
    made = axes.tripcolor(-P[:, 1], P[:, 2], front, values, shading="gouraud", **scale)
    axes.set_title(title)
    axes.set_aspect("equal")
    axes.set_axis_off()
    return made


fig, panels = plt.subplots(2, 3, layout="constrained", figsize=(9, 6.2))
for row, side, name in zip(panels, ([1, 1, 1], [-1, -1, 1]), ("outer", "inner"), strict=True):
    draw(row[0], points * side, F_left, depth_left, f"left, {name} side", cmap="viridis")
    draw(row[1], right.points * side, F_right, depth_right, f"right, {name} side", cmap="viridis")
    title = f"apart by {np.median(error):.1f} mm in the median"
    made = draw(row[2], points * side, F_left, error, title, cmap="magma", vmin=0, vmax=15)
    fig.colorbar(made, ax=row[2], label="mm", shrink=0.8)
plt.show()
