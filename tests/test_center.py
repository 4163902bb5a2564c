import meshes
import numpy as np
import pytest
from igl import internal_angles

from cdcp_igl.datasets import spherical_cap
from cdcp_igl.solve.factored import FactoredSurface
from cdcp_igl.steps.center import central_face
from cdcp_igl.surface.mesh import DiskMesh


def center_of(V, F, method, well_shaped=True):
    return central_face(FactoredSurface.of(DiskMesh(V, F)), method, well_shaped=well_shaped)


@pytest.mark.parametrize("method", ["heat", "torsion", "centroid"])
def test_center_of_a_symmetric_cap_touches_the_pole(method):
    V, F, _ = spherical_cap(8)
    center = center_of(V, F, method)
    assert center.method == method
    assert 0 in F[center.face]


def test_slivers_at_the_center_are_avoided():
    # Pull the pole of a flat disk onto a neighbour: the most central faces get thin.
    V, F, _ = spherical_cap(8, angle=1.0)
    V[0] = 0.95 * V[1]
    chosen, literal = (center_of(V, F, "torsion", well_shaped) for well_shaped in (True, False))
    smallest = np.degrees(internal_angles(V, F).min(axis=1))
    assert smallest[literal.face] < 20 < smallest[chosen.face]


def test_given_face():
    center = center_of(*meshes.grid(), np.int32(3))
    assert (center.method, center.face) == ("given", 3)


def test_center_hardly_matters_after_the_moebius_step(map_of):
    others = ({"center": "heat"}, {"center": "centroid"})
    means = [map_of("chinese_lion_17334", **o).distortion.mean for o in ({}, *others)]
    assert np.ptp(means) < 5e-4
