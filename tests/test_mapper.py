"""The prefactored object against `disk_map`."""

import copy
import pickle

import meshes
import numpy as np
import pytest

import cdcp_igl
from cdcp_igl.maps.mapper import DiskMapper

V, F = meshes.grid(9, 11)
ONCE = {"check", "laplacian", "factor"}
HARMONIC = {"center", "trace", "circle", "extension"}


def test_every_map_is_that_of_disk_map():
    mapper = DiskMapper(V, F)
    for options in (
        {},
        {"mobius": "area"},
        {"center": 7},
        {"center": 7, "align": int(mapper.mesh.loop[3])},
        {"center": "centroid", "mobius": None},
        {"preset": "paper"},
        {"refine": 2, "refine_norm": 1.2},  # with a factor of its own
        {"center": 7},
        {},
    ):
        again, once = mapper.map(**options), cdcp_igl.disk_map(V, F, **options)
        np.testing.assert_array_equal(again.uv, once.uv)
        assert again.center == once.center
        assert again.boundary == once.boundary
        assert again.solver == once.solver


def test_timings_are_of_what_was_done():
    everything = set(cdcp_igl.disk_map(V, F).timings)
    mapper = DiskMapper(V, F)
    assert set(mapper.map().timings) == everything - ONCE
    assert set(mapper.map(mobius="area").timings) == everything - ONCE - HARMONIC
    assert set(mapper.map(center="heat").timings) == everything - ONCE
    refined = set(mapper.map(center="heat", refine=1).timings)
    assert refined == everything - ONCE - HARMONIC | {"refine", "repair"}


def test_progress_of_a_free_outline():
    seen = []
    DiskMapper(V, F).free(progress=lambda phase, done: seen.append((phase, round(done, 2))))
    assert seen == [("extension", 0), ("repair", 0.46), ("certificate", 0.62), ("done", 1)]


def test_moved_vertices():
    V, F, _ = cdcp_igl.datasets.spherical_cap(6)
    there = V + 0.2 * np.sin(3 * V[:, [1, 2, 0]])
    expected = cdcp_igl.cdcp(there, F)
    mapper = DiskMapper(V, F)
    before = mapper.map()
    moved = mapper.moved(there)
    np.testing.assert_allclose(moved.map().uv, expected, atol=1e-12)
    np.testing.assert_allclose(moved.moved(V).map().uv, before.uv, atol=1e-12)
    mapper.map(center="centroid", mobius=None)  # forget the first harmonic map
    np.testing.assert_array_equal(mapper.map().uv, before.uv)


def test_moved_between_space_and_plane():
    """Also from right angles, whose cotangents cancel."""
    flat = np.column_stack(np.divmod(np.arange(99), 11))[:, ::-1]  # a square grid
    for here, there in ((flat, V + 0.2 * np.sin(3 * V[:, [1, 2, 0]])), (V, V[:, :2] * [2, 1])):
        moved = DiskMapper(here, F).moved(there).map().uv
        np.testing.assert_allclose(moved, cdcp_igl.cdcp(there, F), atol=1e-12)


def test_bad_vertices_are_mesh_errors():
    mapper = DiskMapper(V, F)
    with pytest.raises(cdcp_igl.MeshError, match="NaN") as raised:
        mapper.moved(np.where(np.arange(len(V))[:, None] == 5, np.nan, V))
    assert list(raised.value.indices) == [5]
    collapsed = V.copy()
    collapsed[F[3, 0]] = collapsed[F[3, 1]]
    with pytest.raises(cdcp_igl.MeshError, match="no area") as raised:
        mapper.moved(collapsed)
    assert 3 in raised.value.indices
    with pytest.raises(cdcp_igl.MeshError):
        DiskMapper(V, F[:, [0, 0, 1]])


def test_a_surface_that_needs_several_attempts():
    thin = V * [30, 1, 1]
    once = cdcp_igl.disk_map(thin, F)
    assert once.boundary.rejected
    mapper = DiskMapper(thin, F)
    for _ in range(2):
        again = mapper.map()
        np.testing.assert_array_equal(again.uv, once.uv)
        assert again.boundary == once.boundary
    assert "factor" not in again.timings
    assert "99 vertices" in repr(mapper)


def test_it_can_be_sent_to_another_process():
    mapper = DiskMapper(100 * V, F)
    before = mapper.map().uv
    for other in (pickle.loads(pickle.dumps(mapper)), copy.copy(mapper), copy.deepcopy(mapper)):
        np.testing.assert_array_equal(other.map().uv, before)
        np.testing.assert_array_equal(other.mesh.V, mapper.mesh.V)
    moved = mapper.moved(V * [1, 2, 1])
    again = pickle.loads(pickle.dumps(moved)).map().uv  # with an order of elimination of its own
    np.testing.assert_allclose(again, moved.map().uv, atol=1e-10)
