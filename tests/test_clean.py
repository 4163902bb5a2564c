"""Mending surfaces that are nearly disks."""

from itertools import pairwise

import meshes
import numpy as np
import pytest
from commands import invoke

import cdcp_igl
from cdcp_igl.surface.filling import least_triangulation
from cdcp_igl.surface.mesh import DiskMesh
from cdcp_igl.surface.triangles import face_areas


def assert_mended(cleaned, V, F):
    """No defect is left but those that clean cannot mend."""
    left, given = (cdcp_igl.check(*mesh[:2]).defects for mesh in (cleaned, (V, F)))
    unmended = {"not orientable", "closed surface", "handle"}
    assert [d.name for d in left] == [d.name for d in given if d.name in unmended]
    assert left or cleaned.changes
    assert_rows_come_from(cleaned, V, F)


def assert_rows_come_from(cleaned, V, F):
    """Whatever the indices say is the same as in the input; the order is kept."""
    W, G, vertex_index, face_index, *_ = cleaned
    V, F = np.asarray(V, dtype=float), np.asarray(F)
    old = vertex_index >= 0
    np.testing.assert_array_equal(W[old], V[vertex_index[old]])
    kept = face_index >= 0
    assert (np.diff(face_index[kept]) > 0).all()
    assert (face_index[np.cumsum(kept) > kept.sum()] == -1).all()
    same = np.setdiff1d(np.flatnonzero(kept), cleaned.flipped)
    corners = np.sort(W[G[same]], axis=1)
    np.testing.assert_array_equal(corners, np.sort(V[F[face_index[same]]], axis=1))


def test_a_disk_comes_back_as_it_is_even_if_vertices_coincide():
    V, F = meshes.grid()
    V[0] = V[5]
    W, G, vertex_index, face_index, *_ = cleaned = cdcp_igl.clean(V, F)
    assert cleaned.changes == ()
    np.testing.assert_array_equal(W, V)
    np.testing.assert_array_equal(G, F)
    np.testing.assert_array_equal(vertex_index, np.arange(len(V)))
    np.testing.assert_array_equal(face_index, np.arange(len(F)))


def triangulations(first, last):
    """All of the polygon's corners from the first to the last."""
    if last == first + 1:
        return [[]]
    return [
        [*before, (first, middle, last), *behind]
        for middle in range(first + 1, last)
        for before in triangulations(first, middle)
        for behind in triangulations(middle, last)
    ]


@pytest.mark.parametrize("seed", range(5))
def test_no_triangulation_of_a_hole_has_less_area(seed):
    points = np.random.default_rng(seed).normal(size=(7, 3))
    areas = [face_areas(points, np.array(faces)).sum() for faces in triangulations(0, 6)]
    assert len(areas) == 42
    area = face_areas(points, least_triangulation(points)).sum()
    assert area == pytest.approx(min(areas), rel=1e-12)


@pytest.mark.parametrize("columns", [2, 3])
def test_holes_are_filled_outside_the_given_rows(columns):
    V, F = meshes.grid()
    V = V[:, :columns]
    W, G, vertex_index, face_index, *_ = cleaned = cdcp_igl.clean(V, np.delete(F, [18, 50], axis=0))
    assert cleaned.changes == ("filled 2 holes",)
    assert (vertex_index == -1).sum() == 2
    assert (face_index == -1).sum() == 6
    np.testing.assert_array_equal(G[face_index >= 0], np.delete(F, [18, 50], axis=0))
    np.testing.assert_array_equal(W[vertex_index >= 0], V)
    np.testing.assert_allclose(W[-2:], [V[F[f]].mean(axis=0) for f in (50, 18)])
    assert cdcp_igl.check(W, G).is_disk


@pytest.mark.parametrize("exponent", [-1040, 1023])
def test_the_unit_does_not_change_which_loop_is_the_outline(exponent):
    V, F, _ = cdcp_igl.datasets.spherical_cap(8)
    cleaned = cdcp_igl.clean(np.ldexp(V, exponent), np.delete(F, [0, 50, 51], axis=0))
    assert cleaned.changes[-1] == "filled 2 holes"
    assert len(DiskMesh(cleaned.V, cleaned.F).loop) == 48


def test_everything_at_once_is_said():
    V, F = meshes.grid(8, 10)
    n = len(V)
    V = np.vstack([V, V[20], [[5, 5, 5]], V[:3] + 100, [[np.nan, 0, 0]]])
    F[F[:, 0] == 20, 0] = n  # a second copy of a vertex
    F[40] = F[40, ::-1]
    F = np.vstack([F, F[60], [[0, 0, 1]], [[n + 2, n + 3, n + 4]], [[0, 1, n + 5]]])
    F = np.delete(F, 100, axis=0)
    cleaned = cdcp_igl.clean(V, F)
    assert cdcp_igl.check(cleaned.V, cleaned.F).is_disk
    assert cleaned.changes == (
        "dropped 1 face with a NaN or infinite coordinate",
        "merged 1 vertex with an equal one",
        "dropped 1 face with a repeated corner",
        "dropped 1 face that repeated another",
        "dropped 1 face of smaller components",
        "reversed 1 face",
        "dropped 6 vertices that no face uses",
        "filled 1 hole",
    )
    assert_rows_come_from(cleaned, V, F)


def test_flipped_ears_let_their_corners_move(real_mesh):
    V, F = real_mesh("face_1180_ears")
    cleaned = cdcp_igl.clean(V, F, flip_ears=True)
    before, after = cdcp_igl.check(V, F), cdcp_igl.check(cleaned.V, cleaned.F)
    count = len(before.ears) - len(after.ears)
    assert count > 40
    assert cleaned.changes == (f"flipped the inner edge of {count} ears",)
    changed = np.flatnonzero((np.sort(cleaned.F) != np.sort(F)).any(axis=1))
    np.testing.assert_array_equal(cleaned.flipped, changed)
    assert cleaned.flipped.dtype == np.int64
    assert after.is_disk
    plain, flipped = cdcp_igl.disk_map(V, F), cdcp_igl.disk_map(cleaned.V, cleaned.F)
    assert flipped.distortion.mean < plain.distortion.mean


def test_an_ear_without_an_interior_vertex_behind_it_stays():
    cleaned = cdcp_igl.clean(*meshes.strip(), flip_ears=True)
    assert cleaned.changes == ()
    assert len(cleaned.flipped) == 0


def test_map_clean_writes_the_surface_without_its_filling(tmp_path):
    V, F = meshes.grid()
    F = np.delete(F, 18, axis=0)
    F[11] = F[11, ::-1]
    mesh, out = tmp_path / "mesh.npz", tmp_path / "map.npz"
    np.savez(mesh, V=np.insert(V, 4, [9, 9, 9], axis=0), F=F + (F >= 4))  # 4 is in no face
    result = invoke("map", mesh, out, "--clean")
    assert result.exit_code == 0
    for change in (
        *("reversed 1 face", "dropped 1 vertex that no face uses", "filled 1 hole"),
        "The filling is not in the file.",
    ):
        assert change in result.output
    with np.load(out) as written:
        np.testing.assert_array_equal(written["V"], V)
        assert len(written["F"]) == len(F)
        degrees = cdcp_igl.angle_distortion(written["V"], written["F"], written["uv"])
    assert degrees.mean() < 20


def crossed_edge(count=1):
    """A square whose diagonal has vertices on one side that the other side does not know."""
    V = [[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0], [1, 1, 0], [3, 1, 0], [3, 3, 0], [1, 3, 0]]
    V += [[1 + 2 * s, 1 + 2 * s, 0] for s in np.arange(1, count + 1) / (count + 1)]
    F = [[4, 5, 6]]
    for i, j in ((0, 1), (1, 2), (2, 3), (3, 0)):
        F += [[i, j, i + 4], [j, j + 4, i + 4]]
    diagonal = [4, *range(8, 8 + count), 6]
    F += [[7, a, b] for a, b in pairwise(diagonal)]
    return np.array(V, dtype=float), np.array(F)


@pytest.mark.parametrize("count", [1, 5])
def test_a_slit_is_filled_with_faces_that_have_an_area(count):
    V, F = crossed_edge(count)
    cleaned = cdcp_igl.clean(V, F)
    assert cdcp_igl.check(cleaned.V, cleaned.F).is_disk
    assert "took out 1 face beside flat holes" in cleaned.changes
    assert_rows_come_from(cleaned, V, F)
    assert cdcp_igl.disk_map(cleaned.V, cleaned.F).valid


def test_a_face_without_area_is_replaced():
    V, F = crossed_edge()
    cleaned = cdcp_igl.clean(V, np.vstack([F, [4, 6, 8]]))
    assert cdcp_igl.check(cleaned.V, cleaned.F).is_disk
    assert face_areas(cleaned.V, cleaned.F).sum() == pytest.approx(16)


def test_a_hole_whose_middle_lies_on_its_edge_is_filled_without_a_new_vertex():
    corner = [[2, 2], [2, -2], [0, 0], [-2, -2], [-2, 2]]  # an arrow; the middle is at (0, 0)
    V = np.vstack([corner, [[8, 8], [8, -4], [0, -9], [-8, -4], [-8, 8]]])
    i, j = np.arange(5), np.roll(np.arange(5), -1)
    F = np.concatenate([np.column_stack([i, j, i + 5]), np.column_stack([j, j + 5, i + 5])])
    cleaned = cdcp_igl.clean(V, F)
    assert cleaned.changes == ("filled 1 hole",)
    assert len(cleaned.V) == len(V)
    assert cdcp_igl.check(cleaned.V, cleaned.F).is_disk
    assert face_areas(cleaned.V, cleaned.F).sum() == pytest.approx(232)  # of the outline
