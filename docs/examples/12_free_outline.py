"""
A free outline
==============

Onto the disk, a boundary with corners has to become round. Where it may keep its lengths, angles
change less, and what is flat stays as it is.
"""

import matplotlib.pyplot as plt

import cdcp_igl

try:
    V, F = cdcp_igl.datasets.load("human_face")
except OSError:  # it is downloaded once, and there is no network
    V, F = cdcp_igl.datasets.load("jacksboro_fault")

mapper = cdcp_igl.DiskMapper(V, F)
maps = {
    "onto the disk": mapper.map(align=[1, 0, 0]),
    "free outline": mapper.free(align=[1, 0, 0]),
    "refined": mapper.free(align=[1, 0, 0], refine=5),
}
print(maps["refined"])

# %%
# Where the angles change, in degrees.

figure, panels = plt.subplots(1, 3, layout="constrained", figsize=(10, 3.8))
for axes, (title, result) in zip(panels, maps.items(), strict=True):
    degrees = cdcp_igl.angle_distortion(V, F, result.uv).max(axis=1)
    drawn = axes.tripcolor(*result.uv.T, F, degrees, cmap="magma_r", vmin=0, vmax=6)
    axes.set_title(f"{title}: {result.distortion.mean:.2f}°")
    axes.set_aspect("equal")
    axes.set_axis_off()
figure.colorbar(drawn, ax=panels, shrink=0.7, label="largest change of an angle, degrees")
plt.show()
