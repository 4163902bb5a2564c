"""What comes out of libigl: the main path, and the helpers around it."""

import igl
import meshes
import numpy as np
import pytest

import cdcp_igl
from cdcp_igl import libigl
from cdcp_igl.surface.mesh import DiskMesh


def test_the_main_path_computes_with_libigl(monkeypatch):
    """Cotangents, areas, boundary loop and reported angles."""
    V, F, _ = cdcp_igl.datasets.spherical_cap(10)
    called = []

    def spied(name, function):
        return lambda *arguments: called.append(name) or function(*arguments)

    names = ("squared_edge_lengths", "doublearea", "edges_to_path", "internal_angles")
    for name in names:
        monkeypatch.setattr(igl, name, spied(name, getattr(igl, name)))
    cdcp_igl.disk_map(V, F)
    assert set(called) == set(names)


def test_the_reported_angles_are_libigls(monkeypatch):
    V, F, _ = cdcp_igl.datasets.spherical_cap(10)
    angles = igl.internal_angles
    monkeypatch.setattr(igl, "internal_angles", lambda V, F: np.zeros_like(angles(V, F)))
    assert cdcp_igl.disk_map(V, F).distortion.mean == pytest.approx(60)


@pytest.mark.parametrize("seed", range(4))
def test_a_path_follows_its_edges_wherever_they_are_listed(seed):
    rng = np.random.default_rng(seed)
    loop = rng.permutation(100)[:12]
    edges = np.column_stack([loop, np.roll(loop, -1)])[rng.permutation(12)]
    path = libigl.path(edges)
    np.testing.assert_array_equal(np.roll(path, -path.argmin()), np.roll(loop, -loop.argmin()))


def test_the_loop_has_the_surface_on_its_left():
    V, F = meshes.grid()
    for faces in (F, F[:, ::-1]):
        loop = DiskMesh(V, faces).loop
        sides = {(a, b) for f in faces.tolist() for a, b in zip(f, f[1:] + f[:1], strict=True)}
        assert sides.issuperset(zip(loop.tolist(), np.roll(loop, -1).tolist(), strict=True))


def test_a_grid_is_counterclockwise_seen_with_the_first_row_below():
    F = libigl.grid_faces(4, 3)
    x, y = np.meshgrid(np.arange(4.0), np.arange(3.0))
    assert (libigl.double_areas(np.column_stack([x.ravel(), y.ravel()]), F) == 1).all()


def test_a_vertex_without_area_has_no_normal():
    V = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 5, 5]])
    normals = libigl.vertex_normals(V, np.array([[0, 1, 2]]))
    np.testing.assert_array_equal(normals[:3], [[0, 0, 1]] * 3)
    assert np.isnan(normals[3]).all()
