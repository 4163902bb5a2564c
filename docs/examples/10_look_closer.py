"""
Turn it, and look closer
========================

A map is made to be looked at. ``result.view()`` opens a page in the browser in which the surface
turns beside its disk, and ``result.view("map.html")`` writes it: one file that needs no network.
In a notebook (:download:`an example <../examples/notebook.ipynb>`), and on this page, it shows
itself. Hover over the disk to find a point on the surface, and the other way round; a click keeps
the mark.

* ``fields={"depth": depth}`` colours by values of your own, sequential, diverging or cyclic, in a
  range and above a threshold that can be changed. Labels, such as ``read_values("lh.annot")`` has
  them, show their names, and have borders over all colours.
* ``beside={"LSCM": uv, "inflated": positions}``: a map is drawn beside this one, with its mean
  angular distortion, the SD of its area distortion and whether it is valid; another shape of the
  surface is one to which it can be switched.
* ``keep=[0.1, "lengths", 0.9]`` puts a slider on a map: what it keeps. ``texture=`` shows an image
  with its texels.
* ``cdcp_igl.plot.view({"left": left, "right": right})`` switches between results.
"""

import matplotlib.pyplot as plt
import numpy as np

import cdcp_igl

V, F, _ = cdcp_igl.datasets.spherical_cap(60, angle=140)
x, y, z = V.T
bumps = 0.12 * np.sin(3 * x + 1) * np.cos(4 * y) + 0.08 * np.sin(5 * z + 2 * x) + 0.1 * x * y
V = V * [1.3, 1, 1] * (1 + bumps)[:, None]

result = cdcp_igl.disk_map(V, F, refine=2)
result

# %%
# What lives on the surface is baked to an image of the disk, and an image of the disk is pulled
# back to the surface: here its distance from the middle, and rings on the disk.

distance = np.linalg.norm(V, axis=1)
image = result.bake(distance, size=512)
u = (2 * np.arange(512) + 1) / 512 - 1
radius = np.hypot(u, u[:, None])
rings = np.cos(8 * np.pi * radius)

figure, (left, right) = plt.subplots(1, 2, layout="constrained", figsize=(10, 4.6))
shown = left.imshow(np.ma.masked_where(radius > 1, image), extent=(-1, 1, -1, 1))
figure.colorbar(shown, ax=left, label="distance from the middle")
left.set_axis_off()
front = F[np.cross(*(V[F[:, 1:]] - V[F[:, :1]]).transpose(1, 0, 2))[:, 1] < 0]
right.tripcolor(*V[:, [0, 2]].T, front, result.pull_back(rings), shading="gouraud")
right.set_aspect("equal")
right.set_axis_off()
plt.show()
