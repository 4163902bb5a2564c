"""
Compare methods on one mesh
===========================

Methods of :mod:`cdcp_igl.reference` go by their names; a function of one's own, which takes V and
F and returns a map, stands beside them. A free outline has less to keep than the disk.
"""

import igl

import cdcp_igl

try:
    V, F = cdcp_igl.datasets.load("human_face")
except OSError:  # it is downloaded once, and there is no network
    V, F = cdcp_igl.datasets.load("jacksboro_fault")


def tutte(V, F):
    """Extend the boundary by arc length."""
    loop = igl.boundary_loop(F)
    return igl.harmonic(V, F, loop, igl.map_vertices_to_circle(V, loop), 1)


compared = cdcp_igl.compare(
    V, F, ["cdcp", "fdcp", "ldcp", "cem", tutte, "lscm", "abf", "bff", cdcp_igl.free_map]
)
compared

# %%
# A method that fails has a row that says so. Area is the standard deviation of the logarithm of the
# ratio of areas; texels, how many times denser a texture is where 95 percent of the surface have
# less than where 5 percent do.

figure = compared.plot()[0].figure

# %%
# ``compared.view()`` opens a page with all the maps, ``compared.to_dict()`` has the numbers, and
# from the shell it is ``cdcp-igl compare face.obj``.

cases = compared.cases
assert cases["cdcp"].mean < cases["tutte"].mean / 2
assert cases["free_map"].verdict == "yes"
