"""
Onto a rectangle
================

A disk with four corners on its boundary has a conformal map onto a rectangle, corner onto corner.
How wide it is cannot be chosen: width by height is a conformal invariant, the modulus. It lies
between the bounds that come with the map.
"""

import matplotlib.pyplot as plt
import numpy as np

import cdcp_igl

V, F, _ = cdcp_igl.datasets.ellipse(40)
angle = np.arctan2(V[:, 1] / np.ptp(V[:, 1]), V[:, 0] / np.ptp(V[:, 0]))
rim = cdcp_igl.disk_map(V, F).mesh.loop
wanted = np.radians([-150, -30, 30, 150])
corners = [rim[abs(np.exp(1j * angle[rim]) - np.exp(1j * t)).argmin()] for t in wanted]

result = cdcp_igl.rectangle_map(V, F, corners)
print(result)

# %%
# Squares of the rectangle, on the surface: they meet at right angles, and the outermost ones end
# at the boundary.

figure, panels = plt.subplots(1, 2, layout="constrained", figsize=(10, 3.6))
columns = round(8 * result.modulus)
for axes, P in zip(panels, (V[:, :2], result.uv), strict=True):
    for levels, x in ((columns, result.uv[:, 0] / result.width), (8, result.uv[:, 1])):
        axes.tricontour(*P.T, F, x, np.arange(1, levels) / levels, colors="#00366c", linewidths=0.8)
    axes.plot(*P[np.append(rim, rim[0])].T, color="black", linewidth=1, clip_on=False)
    axes.plot(*P[corners].T, "o", color="#b3261e", clip_on=False)
    axes.set_aspect("equal")
    axes.set_axis_off()
plt.show()
