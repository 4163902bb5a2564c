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

import cdcp_igl

V, F = cdcp_igl.datasets.load("jacksboro_fault")
V = V.reshape(344, 403, 3)[60:260:12, 80:320:3]
rows, columns, _ = V.shape
V = V.reshape(-1, 3) / 1000  # kilometres
F = igl.triangulated_grid(columns, rows)[1][:, ::-1]  # the rows go south

result = cdcp_igl.disk_map(V, F, mobius="area")  # the Möbius transformation that evens out areas

# %%
# A lattice of equilateral triangles in the disk, with a ring on the circle, is carried back
# to the surface. The map is linear on every face, and so is its inverse.

points, faces, _ = result.remesh(0.055)


def smallest_angles(V, F):
    corners = V[F]
    a, b = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    cosine = (a * b).sum(axis=2) / np.linalg.norm(a, axis=2) / np.linalg.norm(b, axis=2)
    return np.degrees(np.arccos(cosine)).min(axis=1)


figure, panels = plt.subplots(
    1, 2, layout="constrained", figsize=(10, 5.2), subplot_kw={"projection": "3d"}
)
angles = []
for axes, P, T, title in zip(
    panels, (V, points), (F, faces), ("as surveyed", "remeshed"), strict=True
):
    axes.plot_trisurf(*P.T, triangles=T, color="#b9c7d6", edgecolor="#00366c", linewidth=0.25)
    angles.append(np.median(smallest_angles(P, T)))
    axes.set_title(f"{title}: {len(T):,} faces,\nmedian smallest angle {angles[-1]:.0f}°")
    axes.set_box_aspect(np.ptp(P, axis=0) * [1, 1, 2], zoom=1.2)  # heights doubled
    axes.view_init(55, -70)
    axes.set_axis_off()
plt.show()
assert angles[1] > 40 > angles[0]
