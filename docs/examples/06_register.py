"""
Register two surfaces
=====================

A map onto the disk is unique up to a Möbius transformation. A few landmarks fix that, so that
two meshes of one surface, however they are triangulated and wherever they lie in space, have
the same map, and a point of one is found on the other.
"""

import matplotlib.pyplot as plt
import numpy as np

import cdcp_igl

rng = np.random.default_rng(0)


def asteroid(resolution, shift=0.0):
    """A boulder with a face missing; with `shift`, other points of the same surface."""
    V, F, _ = cdcp_igl.datasets.spherical_cap(resolution, angle=140)
    around = np.hypot(V[:, 0], V[:, 1]) * shift  # twist the mesh, not the surface
    x, y, z = V.T
    x, y = x * np.cos(around) - y * np.sin(around), x * np.sin(around) + y * np.cos(around)
    bumps = 0.12 * np.sin(3 * x + 1) * np.cos(4 * y) + 0.08 * np.sin(5 * z + 2 * x) + 0.1 * x * y
    return np.column_stack([1.3 * x, y, z]) * (1 + bumps)[:, None], F


# %%
# The first survey, and a coarser one in coordinates of its own.

V, F = asteroid(60)
W, G = asteroid(41, shift=0.5)
Q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
Q *= np.linalg.det(Q)
W_moved = 7 * W @ Q.T + [30, -20, 10]

# %%
# Twelve landmarks, each a vertex of the second survey and the nearest one of the first. They
# miss each other by up to half an edge; the Möbius transformation is fitted to them all.

chosen = np.linspace(0, len(W) - 1, 12).astype(int)
landmarks = [[k, np.linalg.norm(V - W[k], axis=1).argmin()] for k in chosen]
first, second = cdcp_igl.disk_map(V, F), cdcp_igl.disk_map(W_moved, G)
uv = second.register(first, landmarks)

# %%
# Where on the first survey is each vertex of the second? The positions of the first,
# interpolated in the disk, against the truth. Without landmarks, the area normalisation and
# one direction that is known in both frames, here the long axis, do as well.

even = cdcp_igl.disk_map(V, F, mobius="area", align=[1, 0, 0])
even_uv = cdcp_igl.cdcp(W_moved, G, mobius="area", align=Q[:, 0])
for name, found in {
    "landmarks": first.interpolate(V, uv),
    "area and one direction": even.interpolate(V, even_uv),
}.items():
    error = np.linalg.norm(found - W, axis=1)
    print(f"{name}: error median {np.median(error):.4f}, at most {error.max():.4f}")
    assert np.median(error) < 0.05

figure, panels = plt.subplots(1, 3, layout="constrained", figsize=(11, 3.9))
surveys = (("first survey", first.uv, F, V[:, 2]), ("second survey", uv, G, W[:, 2]))
for axes, (title, P, T, x) in zip(panels, surveys, strict=False):
    axes.tricontourf(*P.T, T, x, levels=12)
    axes.triplot(*P.T, T, color="white", linewidth=0.15)
    axes.set_title(title)
panels[2].tricontour(
    *first.uv.T, F, V[:, 2], levels=8, colors="#00366c", linewidths=2.5, alpha=0.35
)
panels[2].tricontour(*uv.T, G, W[:, 2], levels=8, colors="black", linewidths=0.7)
panels[2].set_title("levels of the first (wide)\nand of the second (thin)")
for axes in panels:
    axes.set_aspect("equal")
    axes.set_axis_off()
plt.show()
