"""
Remesh through the disk
=======================

A good mesh of the disk, carried back to the surface, is a good mesh of the surface, because
a conformal map keeps the shape of the triangles. Here a survey whose samples lie four times
closer in one direction than in the other gets triangles that are nearly equilateral.
"""

import igl
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.tri import LinearTriInterpolator, Triangulation

import cdcp_igl
from cdcp_igl.surface.mesh import DiskMesh

V, F = cdcp_igl.datasets.load("jacksboro_fault")
V = V.reshape(344, 403, 3)[60:260:12, 80:320:3]
rows, columns, _ = V.shape
V = V.reshape(-1, 3) / 1000  # kilometres
F = igl.triangulated_grid(columns, rows)[1][:, ::-1]  # the rows go south

uv = cdcp_igl.cdcp(V, F, mobius="area")  # the Möbius transformation that evens out the areas

# %%
# The new vertices: a lattice of equilateral triangles in the disk, and the boundary as it is.
# Their Delaunay triangulation is the new mesh.

side = 0.055
v, u = np.mgrid[-20:21, -20:21]
lattice = side * np.column_stack([(u + v / 2).ravel(), (np.sqrt(3) / 2 * v).ravel()])
lattice = lattice[np.linalg.norm(lattice, axis=1) < 1 - side]
loop = DiskMesh(V, F).loop
faces = Triangulation(*np.vstack([lattice, uv[loop]]).T).triangles

# %%
# Back on the surface: the map is linear on every face, and so is its inverse.

disk = Triangulation(*uv.T, F)
inside = np.column_stack([LinearTriInterpolator(disk, x)(*lattice.T).data for x in V.T])
points = np.vstack([inside, V[loop]])


def smallest_angles(V, F):
    corners = V[F]
    a, b = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    cosine = (a * b).sum(axis=2) / np.linalg.norm(a, axis=2) / np.linalg.norm(b, axis=2)
    return np.degrees(np.arccos(cosine)).min(axis=1)


figure, panels = plt.subplots(
    1, 2, layout="constrained", figsize=(10, 5.2), subplot_kw={"projection": "3d"}
)
for axes, P, T, title in zip(
    panels, (V, points), (F, faces), ("as surveyed", "remeshed"), strict=True
):
    axes.plot_trisurf(*P.T, triangles=T, color="#b9c7d6", edgecolor="#00366c", linewidth=0.25)
    angle = np.median(smallest_angles(P, T))
    axes.set_title(f"{title}: {len(T):,} faces,\nmedian smallest angle {angle:.0f}°")
    axes.set_box_aspect(np.ptp(P, axis=0) * [1, 1, 2], zoom=1.2)  # heights doubled
    axes.view_init(55, -70)
    axes.set_axis_off()
plt.show()
