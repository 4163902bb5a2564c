"""
Lengths, areas, or anything between
===================================

A conformal map keeps angles and lets sizes go. Cloth, leather and sheet metal are cut by lengths,
and textures want to be even: ``keep=`` says what the map is to keep, by a word or by a number.
"""

import matplotlib.pyplot as plt
import numpy as np

import cdcp_igl

try:
    V, F = cdcp_igl.datasets.load("human_face")
except OSError:  # it is downloaded once, and there is no network
    V, F = cdcp_igl.datasets.load("jacksboro_fault")

angles = cdcp_igl.free_map(V, F, align=[1, 0, 0])
lengths = cdcp_igl.free_map(V, F, keep="lengths", align=[1, 0, 0])
areas = lengths.continued(keep="areas")  # from the last map, in a few steps
print(lengths)

# %%
# Where sizes change: the logarithm of area in the plane by that on the surface.

maps = {"angles": angles, "lengths": lengths, "areas": areas}
figure, panels = plt.subplots(1, 3, layout="constrained", figsize=(10, 3.8))
for axes, (title, result) in zip(panels, maps.items(), strict=True):
    colors = result.area_distortion() + np.log(result.area_ratio)
    drawn = axes.tripcolor(*result.uv.T, F, colors, cmap="RdBu", vmin=-2, vmax=2)
    axes.set_title(f"{title}: angles {result.distortion.mean:.1f}°")
    axes.set_aspect("equal")
    axes.set_axis_off()
figure.colorbar(drawn, ax=panels, shrink=0.7, label="logarithm of the area ratio")
plt.show()

# %%
# From angles to areas: each map is continued from the last one.

result, rows = angles, []
for t in (0.02, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99):
    result = result.continued(keep=t)
    rows.append((t, result.kept.dirichlet, result.kept.texels, result.distortion.mean))
for row in rows:
    print("{:5.2f}: Dirichlet energy {:.3f}, texels within {:.2f}, angles {:.2f}°".format(*row))

# %%
# A pattern for cloth lies in the unit of the surface: this one is as large as it is. And instead of
# a number, a bound: the least of it that has texels within 1.5 of one another.

print(cdcp_igl.free_map(V, F, keep="texels<1.5").kept)
