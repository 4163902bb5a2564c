"""
A statue with a texture
=======================

A statue has no boundary, so no map onto a disk. :func:`~cdcp_igl.surface_map` cuts it open
and leads short slits to where the scale would vary; what comes back is a
texture coordinate for each corner of each face, and the surface itself is as it was. The texels
have nearly the same size everywhere.
"""

from pathlib import Path
from tempfile import mkdtemp

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import LineCollection
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
# One call. It says what it did. Onto a disk, the scale would vary more.

result = cdcp_igl.surface_map(V, F)
print(result)
disk = cdcp_igl.surface_map(V, F, outline="disk", max_charts=1)
print("scale variation onto a disk and with a free outline:")
print(f"{disk.scale_variation:.2f}, {result.scale_variation:.2f}")
assert result.scale_variation < 0.6 * disk.scale_variation

# %%
# A painted marble: the veins are waves in space that bend one another, the colours go with the
# height. It is baked to an image of the unit square, where the chart lies as ``packed`` says.

bent = V + 0.6 * np.sin(2 * np.roll(V, 1, axis=1)) + 0.3 * np.sin(3 * np.roll(V, 2, axis=1))
veins = abs(np.sin(1.5 * bent.sum(axis=1))) ** 0.4
height = (V[:, 2] - V[:, 2].min()) / np.ptp(V[:, 2])
paint = plt.get_cmap("YlGnBu_r")(0.1 + 0.8 * height)[:, :3] * (0.35 + 0.65 * veins[:, None])
image = result.bake(paint, size=1024)
packed = result.packed()
_, lost = result.lost_in_single_precision()
print(f"share of the area that single precision loses: {lost:g}")

# %%
# The statue from two sides, coloured from the image alone, with the cut; and the image.

column, row = np.minimum(1023, 1024 * packed.mean(axis=1).T).astype(int)
colors = image[1023 - row, column]
edges = V[F[:, 1:]] - V[F[:, :1]]
normals = np.cross(edges[:, 0], edges[:, 1])
normals /= np.linalg.norm(normals, axis=1, keepdims=True)

figure = plt.figure(figsize=(12, 4.4), layout="constrained")
for k, azimuth in enumerate((-75, 105)):
    turn = np.radians(azimuth)
    viewer = np.array([np.cos(turn), np.sin(turn), 0.2])
    lit = colors * (0.6 + 0.4 * np.maximum(normals @ viewer, 0))[:, None]
    axes = figure.add_subplot(1, 3, k + 1, projection="3d", computed_zorder=False)
    axes.add_collection3d(Poly3DCollection(V[F], facecolors=lit, edgecolors=lit, linewidths=0.3))
    # Of the cut, the edges of faces that look towards the viewer.
    seen = np.zeros(len(V), dtype=bool)
    seen[F[normals @ viewer > 0]] = True
    front = result.cut.edges[seen[result.cut.edges].all(axis=1)]
    axes.add_collection3d(Line3DCollection(1.01 * V[front], colors="crimson", linewidths=1))
    axes.set(xlim=(-3, 3), ylim=(-3, 3), zlim=(-3.6, 2.4))
    axes.set_box_aspect((1, 1, 1), zoom=1.2)
    axes.view_init(elev=10, azim=azimuth)
    axes.set_axis_off()
texture = figure.add_subplot(1, 3, 3)
texture.imshow(image, extent=(0, 1, 0, 1))
z = packed[:, [0, 1, 2, 0]]
ends = np.sort(np.stack([result.cut.F, np.roll(result.cut.F, -1, axis=1)], axis=-1)).reshape(-1, 2)
_, first, count = np.unique(ends, axis=0, return_index=True, return_counts=True)
face, side = np.divmod(first[count == 1], 3)
outline = np.stack([z[face, side], z[face, side + 1]], axis=1)
texture.add_collection(LineCollection(outline, colors="crimson", linewidths=1))
texture.set_title("the image, and the outline of the chart")
texture.set_axis_off()
plt.show()

# %%
# To a file that any viewer reads: the given vertices, the texture coordinates of the opened
# surface, and faces that name both; and the image beside it.

folder = Path(mkdtemp())
cdcp_igl.io.write_map(folder / "statue.obj", V, F, result)
plt.imsave(folder / "statue.png", image)
print(*(f"{file.name}: {file.stat().st_size / 1e6:.1f} MB" for file in folder.iterdir()))
assert result.valid
assert result.distortion.mean < 2
