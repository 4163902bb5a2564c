"""Sheets that touch along edges: paired by angle, so that what is closed stays closed."""

import meshes
import numpy as np
import pytest
import surfaces
from scipy.ndimage import binary_erosion

import cdcp_igl
from cdcp_igl.surface.sheets import fans_of_sheets
from cdcp_igl.surface.topology import Topology


def skin(mask):
    """The boundary of the voxels of a mask, outward, corners shared."""
    mask, quads = np.pad(mask, 1), []
    for axis in range(3):
        u, v = np.eye(3, dtype=int)[[(axis + 1) % 3, (axis + 2) % 3]]
        for side in (1, -1):
            at = np.argwhere(mask & ~np.roll(mask, -side, axis))
            at[:, axis] += side > 0
            quads.append(np.stack([at, at + u, at + u + v, at + v], 1)[:, ::side])
    V, i = np.unique(np.concatenate(quads).reshape(-1, 3), axis=0, return_inverse=True)
    corners = i.reshape(-1, 4)
    return V.astype(float), np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])


def noisy_ball(share):
    x = np.stack(np.meshgrid(*(np.linspace(-1, 1, n) for n in (20, 23, 18)), indexing="ij"))
    mask = np.square(x).sum(axis=0) < 0.8
    off = np.random.default_rng(3).random(mask.shape) < share
    return mask & ~(mask & ~binary_erosion(mask) & off)


@pytest.mark.parametrize("share", [0.02, 0.1, 0.25])
def test_a_segmentation_stays_closed_with_all_its_faces(share):
    V, F = skin(noisy_ball(share))
    cleaned = cdcp_igl.clean(V, F)
    np.testing.assert_array_equal(cleaned.face_index, np.arange(len(F)))
    np.testing.assert_array_equal(cleaned.vertex_index[cleaned.F], F)
    report = cdcp_igl.check(cleaned.V, cleaned.F)
    assert (report.n_loops, report.n_components) == (0, 1)
    edges = 3 * len(F) // 2
    assert 2 - 2 * report.genus == len(cleaned.V) - edges + len(F)
    if share == 0.1:
        assert report.genus or cdcp_igl.sphere_map(*cleaned[:2]).valid


def test_one_end_is_split_where_two_towers_touch():
    mask = np.zeros((2, 2, 2), bool)
    mask[:, :, 1] = mask[0, 0, 0] = mask[1, 1, 0] = True
    cleaned = cdcp_igl.clean(*skin(mask))
    assert cleaned.changes == ("split off 1 vertex where fans of faces met",)


@pytest.mark.parametrize("seed", range(20))
def test_random_voxels_are_closed_surfaces_that_do_not_cross(seed):
    """However they touch, turned and stretched: no pair is across the inside of another."""
    rng = np.random.default_rng(seed)
    V, F = skin(rng.random((4, 4, 4)) < rng.uniform(0.3, 0.7))
    n, fan = fans_of_sheets(V @ rng.normal(size=(3, 3)), F)
    surface = Topology(fan.reshape(3, -1).T.astype(np.int64), n)
    assert surface.is_manifold
    assert len(surface.border) == len(surface.misoriented) == 0


def test_of_three_pages_the_two_that_continue_each_other_stay_together():
    _, V, F, _ = meshes.NASTY["three pages"]
    V = np.array(V, float)
    n, fan = fans_of_sheets(V, np.array(F))
    parts = Topology(fan.reshape(3, -1).T.astype(np.int64), n).components[1]
    assert (parts[0] == parts[1]) != (parts[0] == parts[2])
    assert parts[0] == parts[1]


def test_a_tunnel_is_told_apart_from_a_wall():
    """A mask and its complement touch in the same edges; each keeps its faces."""
    V, F = surfaces.voxels(4, size=3)
    for faces in (F, F[:, ::-1]):
        result = cdcp_igl.surface_map(V, faces)
        assert result.valid
        assert (result.face_chart >= 0).all()
