"""
From libigl's tutorial to the disk
==================================

A program that parameterises a mesh with libigl, and the one line that takes it onto the
disk. The surface is a mountain in Tennessee, as radar from space saw it.
"""

from pathlib import Path
from tempfile import mkdtemp

import igl
import numpy as np

import cdcp_igl

V, _ = cdcp_igl.datasets.load("jacksboro_fault")
V = np.ascontiguousarray(V.reshape(344, 403, 3)[::2, ::2])  # every other sample
rows, columns, _ = V.shape
folder = Path(mkdtemp())
F = igl.triangulated_grid(columns, rows)[1][:, ::-1]  # the rows go south
igl.write_triangle_mesh(str(folder / "mountain.obj"), V.reshape(-1, 3), F)

# %%
# What the tutorial does: read, find the boundary, map it to the circle by arc length, and
# extend that harmonically. Or pin two vertices and minimise the conformal energy.

V, F = igl.read_triangle_mesh(str(folder / "mountain.obj"))
boundary = igl.boundary_loop(F)
circle = igl.map_vertices_to_circle(V, boundary)
harmonic = igl.harmonic(V, F, boundary, circle, 1)

pins = boundary[[0, len(boundary) // 2]]
lscm, _ = igl.lscm(V, F, pins, np.array([[0.0, 0], [1, 0]]))

# %%
# And the line that does both at once, a conformal map onto exactly the disk:

uv = cdcp_igl.cdcp(V, F)

means = {}
for name, plane in {"harmonic": harmonic, "LSCM": lscm, "CDCP": uv}.items():
    means[name] = cdcp_igl.angle_distortion(V, F, plane).mean()
    print(f"{name:8}  angular distortion {means[name]:5.2f} degrees")
assert means["CDCP"] < means["harmonic"] / 4
assert abs(np.hypot(*uv.T)).max() < 1 + 1e-12

# %%
# ``uv`` goes wherever libigl's maps go, for example into the texture coordinates of a file.
# Viewers expect those between 0 and 1.

texture = (uv + 1) / 2
corner_normals, no_faces = np.empty((0, 3)), np.empty((0, 3), dtype=F.dtype)
igl.writeOBJ(str(folder / "disk.obj"), V, F, corner_normals, no_faces, texture, F)

# %%
# :func:`~cdcp_igl.disk_map` returns the same map with all that is known about it, and
# draws it: the surface coloured by its normals, the same colours on the disk.

result = cdcp_igl.disk_map(V, F)
print(result)
figure = result.plot(name="Jacksboro fault")[0].figure
