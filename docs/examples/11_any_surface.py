"""
From a closed statue to a textured model
========================================

A statue has no boundary, so no map onto a disk. :func:`~cdcp_igl.surface_map` cuts it open
from tip to tip, maps it, sees what the map would shrink, and cuts on to it; what comes back is a
texture coordinate for each corner of each face, and the surface itself is as it was.
"""

from pathlib import Path
from tempfile import mkdtemp

import matplotlib.pyplot as plt
import numpy as np
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

import cdcp_igl

# %%
# The statue: a sphere drawn out to a figure with a head, two arms and two feet.

steps = 56
x, y = (grid.ravel() for grid in np.meshgrid(*[np.linspace(-1, 1, steps + 1)] * 2))
corner = np.arange(x.size).reshape(steps + 1, -1)
a, b, c, d = (
    part.ravel() for part in (corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1])
)
side = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
cube = []
for axis in range(3):
    for sign in (1, -1):
        face = np.empty((x.size, 3))
        face[:, axis], face[:, axis - 2], face[:, axis - 1] = sign, sign * x, y
        cube.append(face)
V, F = np.vstack(cube), np.vstack([side + k * x.size for k in range(6)])
_, first, same = np.unique(V.round(9), axis=0, return_index=True, return_inverse=True)
V, F = V[first], same.ravel()[F]
V = np.tan(V * np.pi / 4)  # squares of much the same size on the sphere
V /= np.linalg.norm(V, axis=1, keepdims=True)
limbs = [(0, 0.1, 1, 1.1)]  # direction and length
limbs += [(x, 0, 0.35, 2.6) for x in (1, -1)] + [(x, 0, -1, 3) for x in (0.45, -0.45)]
radius = np.ones(len(V))
for *direction, length in limbs:
    radius += length * np.exp(16 * (V @ direction / np.linalg.norm(direction) - 1))
V = V * radius[:, None] * [1, 0.7, 1.2]
print(cdcp_igl.check(V, F))

# %%
# One call. It says what it did.

result = cdcp_igl.surface_map(V, F)
print(result)

# %%
# Without growing, the cut ends at two tips, and the others are shrunk.

once = cdcp_igl.surface_map(V, F, spread=np.inf)
print(f"{once.spread:.2f} to {result.spread:.2f}: the spread of the scale as the cut grows")
assert result.spread < 0.8 * once.spread

# %%
# The cut on the surface, and the disk it is mapped onto: a checkerboard of equal squares in
# the disk is one of squares of many sizes on the statue.

u, v = np.pi * 7 * result.uv.mean(axis=1).T
board = 0.5 + 0.5 * np.tanh(3 * np.sin(u) * np.sin(v))
colors = plt.get_cmap("cividis")(0.1 + 0.8 * board)
edges = V[F[:, 1:]] - V[F[:, :1]]
normals = np.cross(edges[:, 0], edges[:, 1])
normals /= np.linalg.norm(normals, axis=1, keepdims=True)

figure = plt.figure(figsize=(12, 4.4), layout="constrained")
for k, azimuth in enumerate((-75, 105)):
    turn = np.radians(azimuth)
    viewer = np.array([np.cos(turn), np.sin(turn), 0.2])
    lit = colors.copy()
    lit[:, :3] *= (0.6 + 0.4 * np.maximum(normals @ viewer, 0))[:, None]
    axes = figure.add_subplot(1, 3, k + 1, projection="3d", computed_zorder=False)
    axes.add_collection3d(Poly3DCollection(V[F], facecolors=lit, edgecolors=lit, linewidths=0.3))
    # Of the cut, the edges of faces that look towards the viewer.
    seen = np.zeros(len(V), dtype=bool)
    seen[F[normals @ viewer > 0]] = True
    front = result.cut.edges[seen[result.cut.edges].all(axis=1)]
    axes.add_collection3d(Line3DCollection(1.01 * V[front], colors="crimson", linewidths=2))
    axes.set(xlim=(-3, 3), ylim=(-3, 3), zlim=(-3.6, 2.4))
    axes.set_box_aspect((1, 1, 1), zoom=1.2)
    axes.view_init(elev=10, azim=azimuth)
    axes.set_axis_off()
disk = figure.add_subplot(1, 3, 3)
disk.tripcolor(*result.uv_cut.T, result.cut.F, facecolors=board, cmap="cividis")
disk.add_patch(plt.Circle((0, 0), 1, fill=False, edgecolor="crimson", linewidth=2))
disk.set(aspect="equal", title="the cut is the circle")
disk.set_axis_off()
plt.show()

# %%
# To a file that any viewer reads: the given vertices, the texture coordinates of the opened
# surface, and faces that name both.

file = Path(mkdtemp(), "statue.obj")
cdcp_igl.io.write_map(file, V, F, result)
print(f"{file.stat().st_size / 1e6:.1f} MB")
assert result.valid
assert result.distortion.mean < 2
