"""
Clean a bad mesh and map it
===========================

A surface as scanners deliver it: vertices doubled, faces flipped, holes, crumbs, an
invalid coordinate. :func:`~cdcp_igl.check` names what is wrong; :func:`~cdcp_igl.clean` mends
what can be mended without guessing, and says what it did.
"""

import matplotlib.pyplot as plt
import numpy as np

import cdcp_igl

rng = np.random.default_rng(1)
V, F, _ = cdcp_igl.datasets.paraboloid(24, steepness=0.8)

# %%
# Damage it.

x, y, _ = V[F].mean(axis=1).T
F = F[(np.hypot(x - 0.3, y - 0.35) > 0.16) & (np.hypot(x + 0.4, y - 0.1) > 0.1)]  # two holes
reversed_faces = rng.choice(len(F), 40, replace=False)
F[reversed_faces] = F[reversed_faces, ::-1]
V[700, 1] = np.nan
F = np.vstack([F, len(V) + np.arange(3)])
V = np.vstack([V, [[1.2, 0, 0], [1.3, 0, 0], [1.2, 0.1, 0]]])  # a crumb
V, F = V[F].reshape(-1, 3), np.arange(F.size).reshape(-1, 3)  # every face has its own corners

# %%
# What is wrong with it? Invalid coordinates hide every other defect.

print(cdcp_igl.check(V, F))

# %%
# Mend it.

cleaned = cdcp_igl.clean(V, F)
for change in cleaned.changes:
    print("-", change)

# %%
# Map it, and look up which rows are new: those that fill the holes have index -1.

W, G = cleaned[:2]
result = cdcp_igl.disk_map(W, G)
print(result.distortion)
assert result.valid
assert result.conformal

filling = cleaned.face_index < 0
figure, (before, after) = plt.subplots(1, 2, layout="constrained", figsize=(9, 4.5))
lines = {"edgecolor": "white", "linewidth": 0.2}
whole = F[np.isfinite(V[F]).all(axis=(1, 2))]
before.tripcolor(*np.nan_to_num(V[:, :2]).T, whole, V[whole, 2].mean(axis=1), **lines)
before.set_title(f"given: {len(V):,} vertices, from above")
after.tripcolor(*result.uv.T, G, W[G, 2].mean(axis=1), **lines)
after.triplot(*result.uv.T, G[filling], color="black", linewidth=0.8)
after.set_title(f"mapped: {len(W):,} vertices; the filling has black edges")
for axes in (before, after):
    axes.set_aspect("equal")
    axes.set_axis_off()
plt.show()
