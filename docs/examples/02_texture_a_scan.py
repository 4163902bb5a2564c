"""
Texture a scan
==============

A checkerboard in the disk, seen on the surface. Where the map is conformal, the squares of
the board come out as squares of any size, never as rhombi.
"""

import matplotlib.pyplot as plt
import numpy as np

import cdcp_igl
from cdcp_igl.plot.viewpoint import choose_viewpoint

try:
    V, F = cdcp_igl.datasets.load("human_face")
except OSError:  # it is downloaded once, and there is no network
    V, F = cdcp_igl.datasets.load("jacksboro_fault")

view = choose_viewpoint(V, F)  # rows point right, up and towards us
uv = cdcp_igl.cdcp(V, F, mobius="area", align=view[0])
degrees = cdcp_igl.angle_distortion(V, F, uv)
print(f"{len(V):,} vertices, angular distortion {degrees.mean():.2f} degrees in the mean")

# %%
# To see the board sharply, split every face into four, once or more. The map is linear
# on each face, so the new vertices lie half-way between the old ones in the disk, too.


def split(P, F):
    """Halve every edge of a mesh whose vertices have any number of coordinates."""
    ends = np.sort(F[:, [[1, 2], [2, 0], [0, 1]]].reshape(-1, 2), axis=1)
    edges, edge = np.unique(ends @ [len(P), 1], return_inverse=True)
    middles = P[np.column_stack(np.divmod(edges, len(P)))].mean(axis=1)
    (i, j, k), (a, b, c) = F.T, len(P) + edge.reshape(-1, 3).T
    return np.vstack([P, middles]), np.column_stack([i, c, b, c, j, a, b, a, k, a, b, c]).reshape(
        -1, 3
    )


P, faces = np.column_stack([V @ view.T, uv]), F
while len(faces) < 300_000:
    P, faces = split(P, faces)

# %%
# Light and dark squares, and light from the viewer's left.

normals = np.zeros((len(P), 3))
i, j, k = faces.T
for corner in faces.T:
    np.add.at(normals, corner, np.cross(P[j, :3] - P[i, :3], P[k, :3] - P[i, :3]))
normals /= np.linalg.norm(normals, axis=1, keepdims=True)
light = 0.25 + 0.75 * np.clip(normals @ [-0.42, 0.42, 0.8], 0, 1)
dark = np.floor(8 * P[:, 3:]).sum(axis=1) % 2 == 1
assert 0.4 < dark.mean() < 0.6
shade = light * np.where(dark, 0.45, 1)

figure, (left, right) = plt.subplots(1, 2, layout="constrained", figsize=(9, 4.8))
nearest_last = faces[np.argsort(P[faces, 2].sum(axis=1))]
for axes, xy, triangles in ((left, P[:, :2], nearest_last), (right, P[:, 3:], faces)):
    axes.tripcolor(*xy.T, triangles, shade, shading="gouraud", cmap="gray", vmin=0, vmax=1)
    axes.set_aspect("equal")
    axes.set_axis_off()
left.set_title("on the surface")
right.set_title("in the disk, with the light of the surface")
plt.show()
