"""
Compare methods on one mesh
===========================

Every method of :mod:`cdcp_igl.reference` has the same signature. Most map onto the disk; those with
a free boundary are to be compared on angles only. Two are for closed surfaces, onto the sphere.
"""

import cdcp_igl
from cdcp_igl.plot import side_by_side
from cdcp_igl.reference import METHODS

try:
    V, F = cdcp_igl.datasets.load("human_face")
except OSError:  # it is downloaded once, and there is no network
    V, F = cdcp_igl.datasets.load("jacksboro_fault")

# %%
# The distortion of area is the mean of the absolute logarithm of the ratio of areas, as
# shares of their totals: 0.7 is a factor of two.

maps = []
print(f"{'method':14}{'mean °':>8}{'SD °':>8}{'area':>8}   boundary")
for name, method in METHODS.items():
    if method.boundary == "sphere":
        continue
    try:
        uv = method.function(V, F)
    except cdcp_igl.MapError as error:
        print(f"{name:14} no map: {str(error)[:60]}...")
        maps.append((name, float("nan"), None))
        continue
    degrees = cdcp_igl.angle_distortion(V, F, uv)
    area = abs(cdcp_igl.area_distortion(V, F, uv)).mean()
    print(f"{name:14}{degrees.mean():8.3f}{degrees.std():8.3f}{area:8.2f}   {method.boundary}")
    if name != "double_cover":  # the same map as cdcp's
        maps.append((name, degrees.mean(), uv))

means = {name: mean for name, mean, _ in maps}
assert means["cdcp"] < 1.01 * means["fdcp"]
assert means["cdcp"] < means["harmonic"] / 2

figure = side_by_side([(V, F, maps)])

# %%
# For timings use ``cdcp-igl compare``, which gives every method a process of its own.
