"""
Texture a scan
==============

An image of the unit square, wrapped around a scan. A conformal map keeps shapes: circles of the
image stay circles on the face, of any size.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import PolyCollection

import cdcp_igl
from cdcp_igl.plot.viewpoint import choose_viewpoint

try:
    V, F = cdcp_igl.datasets.load("human_face")
except OSError:  # it is downloaded once, and there is no network
    V, F = cdcp_igl.datasets.load("jacksboro_fault")

view = choose_viewpoint(V, F)  # rows point right, up and towards us
result = cdcp_igl.disk_map(V, F, align=view[0])

# %%
# The image: spirals between circles, as a mask is painted. Its top row is at v = 1, and
# ``result.packed()`` says where each vertex lies in it. ``result.view(texture=image)``
# turns the painted face in the browser, ``result.save("face.glb", image=image)`` is for other
# programs.

size = 1024
u, v = np.meshgrid(*2 * [(np.arange(size) + 0.5) / size * 2 - 1])
radius, angle = np.hypot(u, v), np.arctan2(v, u)
arms = np.cos(6 * angle - 9 * np.log(radius + 0.02))
rings = np.cos(24 * np.pi * radius) > 0.92
image = plt.get_cmap("RdYlBu")(0.5 + 0.42 * np.tanh(3 * arms))[::-1, :, :3]
image[rings[::-1]] = 0.12

# %%
# Each face in the colour of its middle in the image, with light from the viewer's left.


def split(P, F):
    """Halve every edge of a mesh whose vertices have any number of coordinates."""
    ends = np.sort(F[:, [[1, 2], [2, 0], [0, 1]]].reshape(-1, 2), axis=1)
    edges, edge = np.unique(ends @ [len(P), 1], return_inverse=True)
    middles = P[np.column_stack(np.divmod(edges, len(P)))].mean(axis=1)
    (i, j, k), (a, b, c) = F.T, len(P) + edge.reshape(-1, 3).T
    corners = np.column_stack([i, c, b, c, j, a, b, a, k, a, b, c])
    return np.vstack([P, middles]), corners.reshape(-1, 3)


packed = result.packed()
P, faces = np.column_stack([V @ view.T, packed]), F
while len(faces) < 120_000:  # so that the image is sharp
    P, faces = split(P, faces)
middle = P[faces].mean(axis=1)
column, row = np.minimum(size - 1, size * middle[:, 3:].T).astype(int)
edges = P[faces[:, 1:], :3] - P[faces[:, :1], :3]
normals = np.cross(edges[:, 0], edges[:, 1])
normals /= np.linalg.norm(normals, axis=1, keepdims=True)
light = 0.35 + 0.65 * np.clip(normals @ [-0.42, 0.42, 0.8], 0, 1)
colors = image[size - 1 - row, column] * light[:, None]

figure, (left, right) = plt.subplots(1, 2, layout="constrained", figsize=(10, 5.2))
order = np.argsort(middle[:, 2])  # the nearest last
left.add_collection(
    PolyCollection(P[faces[order], :2], facecolors=colors[order], edgecolors="face", linewidths=0.2)
)
left.autoscale_view()
right.imshow(image, extent=(0, 1, 0, 1))
right.plot(*packed[np.append(result.mesh.loop, result.mesh.loop[0])].T, color="black")
for axes in (left, right):
    axes.set_aspect("equal")
    axes.set_axis_off()
left.set_title("the painted scan")
right.set_title("the image, and where the boundary lies")
plt.show()
