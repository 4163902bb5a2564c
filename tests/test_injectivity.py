from dataclasses import replace
from fractions import Fraction

import meshes
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import cdcp_igl
from cdcp_igl.arrays import as_complex
from cdcp_igl.surface.mesh import DiskMesh
from cdcp_igl.verdict.certificate import certify

MESH = DiskMesh(*meshes.grid())
UV = cdcp_igl.cdcp(*meshes.grid())


def test_maps_that_are_none():
    mirrored = certify(MESH, UV * [1, -1])
    assert len(mirrored.flipped) == len(MESH.F)
    assert mirrored.winding_number != 1
    off, missing = UV.copy(), UV.copy()
    off[MESH.loop[3]] *= 1 + 1e-9
    assert certify(MESH, off).boundary_error == pytest.approx(1e-9, rel=1e-5)
    missing[0, 0] = np.nan
    assert str(certify(MESH, missing)) == "not finite"
    assert not any(certify(MESH, uv).valid for uv in (UV * [1, -1], off, missing))


FAN = DiskMesh(*meshes.fan(9))


def around(turns):
    """The boundary of a fan so many times around the circle."""
    t = 2 * np.pi * turns * np.arange(9) / 9
    return np.vstack([np.column_stack([np.cos(t), np.sin(t)]), [[0, 0]]])


def flipped_exactly(uv, F):
    x, y = np.vectorize(Fraction, otypes=[object])(uv)[F].T
    area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])
    return np.flatnonzero(area <= 0).tolist()


def test_interior_vertex_pulled_over_an_edge():
    bad = UV.copy()
    bad[MESH.interior[0]] = UV[MESH.interior[-1]]
    certificate = certify(MESH, bad)
    assert not certificate.valid
    assert certificate.on_circle
    assert certificate.flipped.tolist() == flipped_exactly(bad, MESH.F)


def test_boundary_neighbours_exchanged():
    bad = UV.copy()
    bad[MESH.loop[[4, 5]]] = UV[MESH.loop[[5, 4]]]
    certificate = certify(MESH, bad)
    assert not certificate.boundary_monotone
    assert not certificate.valid
    bad[MESH.loop[4]] = bad[MESH.loop[5]] = UV[MESH.loop[5]]  # in one place
    assert not certify(MESH, bad).boundary_monotone


def test_boundary_steps_below_rounding_are_judged_exactly():
    uv = around(1)
    for step, forward in ((1e-300, True), (0.0, False), (-1e-300, False)):
        uv[1] = [1, step]  # vertex 0 is at (1, 0)
        assert certify(FAN, uv).boundary_monotone == forward


def test_winding_twice():
    certificate = certify(FAN, around(2))
    assert certificate.winding_number == 2
    assert len(certificate.flipped) == 0  # only the winding number gives it away
    assert not certificate.valid
    twice = replace(
        cdcp_igl.disk_map(*meshes.fan(9)), _f=as_complex(around(2)), certificate=certificate
    )
    with pytest.raises(ValueError, match="no bijection"):
        twice.invert([0, 0])


@given(st.lists(st.integers(-2, 2), min_size=2, max_size=2))
def test_orientation_is_exact_where_rounding_is_not(ulps):
    # A needle about a vertex on the line y = x: a few ulps decide on its sign.
    fan = DiskMesh(*meshes.fan(3))
    uv = np.array([[12.0, 12.0], [24.0, 24.0], [0.0, 25.0], [0.5, 0.5]])
    for axis, steps in enumerate(ulps):
        uv[3, axis] += steps * np.spacing(0.5)
    certificate = certify(fan, uv)
    assert certificate.flipped.tolist() == flipped_exactly(uv, fan.F)
    assert certificate.n_exact >= 1
