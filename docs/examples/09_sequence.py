"""
Reuse the factor for a sequence
===============================

A surface that moves, or one that is mapped in several ways, need not be checked and analysed
anew each time. A :class:`~cdcp_igl.DiskMapper` keeps what does not change. Here a mountain rises.
"""

from time import perf_counter

import igl
import matplotlib.pyplot as plt
import numpy as np

import cdcp_igl

V, _ = cdcp_igl.datasets.load("jacksboro_fault")
V = np.ascontiguousarray(V.reshape(344, 403, 3)[100:260:2, 80:320:2])
rows, columns, _ = V.shape
V = V.reshape(-1, 3)
F = igl.triangulated_grid(columns, rows)[1][:, ::-1]  # the rows go south
frames = {height: V * [1, 1, height] for height in (0, 3, 6, 9)}

# %%
# The same faces with moved vertices: no check of the topology, and no new ordering of the
# unknowns. Each frame is the map that :func:`~cdcp_igl.disk_map` would return.

mapper = cdcp_igl.DiskMapper(V, F)
maps = {height: mapper.moved(W).map(mobius="area") for height, W in frames.items()}
for height, W in frames.items():
    assert abs(maps[height].uv - cdcp_igl.cdcp(W, F, mobius="area")).max() < 1e-9

# %%
# The other use: one surface, several normalisations. What is known already is not computed
# again; the phases say what was.

normalisations = ({}, {"mobius": "area"}, {"align": [1, 0, 0]}, {"mobius": None})

start = perf_counter()
for options in normalisations:
    cdcp_igl.disk_map(V, F, **options)
anew = perf_counter() - start

start = perf_counter()
mapper = cdcp_igl.DiskMapper(V, F)
for options in normalisations:
    result = mapper.map(**options)
    print(f"{options!s:22} {', '.join(result.timings)}")
print(f"time: {(perf_counter() - start) / anew:.2f} of that without a mapper, in this run")

# %%
# The same faces throughout, so one colouring serves all frames: levels of height.

figure, panels = plt.subplots(1, 4, layout="constrained", figsize=(11, 3.1))
for axes, (height, result) in zip(panels, maps.items(), strict=True):
    uv = result.uv
    axes.tricontourf(*uv.T, F, V[:, 2], levels=9)
    axes.tricontour(*uv.T, F, V[:, 2], levels=9, colors="black", linewidths=0.3)
    axes.set_title(f"heights × {height}: {result.distortion.mean:.2f}°")
    axes.set_aspect("equal")
    axes.set_axis_off()
plt.show()
