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


def manifold_of(V, F):
    n, fan = fans_of_sheets(V, F)
    return Topology(fan.reshape(3, -1).T.astype(np.int64), n)


@pytest.mark.parametrize("labels", [1, 2, 3])
@pytest.mark.parametrize("size", [2, 3, 4])
def test_faces_between_cubes_part_however_they_are_wound(size, labels):
    for seed in range(12):
        V, F = surfaces.interfaces(seed, size, labels)
        surface = manifold_of(V / size, F)
        assert surface.is_manifold
        assert surface.misoriented is not None
        if labels == 1:  # as many faces at each edge as ever, and none is open
            assert len(surface.border) == 0


@pytest.mark.parametrize("pages", range(3, 13))
def test_pages_wound_at_random_continue_across_the_spine(pages):
    V, F = surfaces.book(pages, pages)
    surface = manifold_of(V, F)
    assert surface.is_manifold
    assert surface.components[0] == -(-pages // 2)
    result = cdcp_igl.surface_map(V, F)
    assert result.valid
    assert cdcp_igl.certify(V, F, result.packed()).valid


@pytest.mark.parametrize(("seed", "labels"), [(0, 1), (1, 1), (2, 2), (3, 3)])
def test_what_is_wound_at_random_is_cleaned_and_mapped(seed, labels):
    V, F = surfaces.interfaces(seed, 3, labels)
    cleaned = cdcp_igl.clean(V, F)
    report = cdcp_igl.check(cleaned.V, cleaned.F)
    assert report.n_components == 1
    if labels == 1:
        assert report.n_loops == 0
    result = cdcp_igl.surface_map(V, F)
    assert result.valid
    assert cdcp_igl.certify(V, F, result.packed()).valid


def test_windings_that_agree_are_kept():
    """Reversed faces within a sheet change nothing of how a solid parts."""
    for seed in range(10):
        V, F = surfaces.voxels(seed, 4)
        reversed_one = F.copy()
        alone = np.random.default_rng(seed).integers(len(F))
        reversed_one[alone] = F[alone, ::-1]
        fan, again = (fans_of_sheets(V, faces)[1].reshape(3, -1) for faces in (F, reversed_one))
        again[:, alone] = again[::-1, alone]
        np.testing.assert_array_equal(partition(fan.ravel()), partition(again.ravel()))


def partition(names):
    """The first place of each name, at all of its places."""
    _, first, which = np.unique(names, return_index=True, return_inverse=True)
    return first[which]


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


def moebius(n):
    """A band of n quads, turned once by half before it meets itself."""
    t = 2 * np.pi * np.arange(n) / n
    wide = 0.3 * np.array([-1, 1])[:, None]
    x = np.stack(
        [
            (1 + wide * np.cos(t / 2)) * np.cos(t),
            (1 + wide * np.cos(t / 2)) * np.sin(t),
            wide * np.sin(t / 2),
        ],
        -1,
    )
    V, k = x.swapaxes(0, 1).reshape(-1, 3), np.arange(n)
    a, b, c, d = 2 * k, 2 * k + 1, 2 * k + 2, 2 * k + 3
    c[-1], d[-1] = 1, 0
    return V, np.concatenate([np.column_stack([a, b, d]), np.column_stack([a, d, c])])


def test_a_one_sided_part_is_cut_and_the_others_are_mapped_as_ever():
    V, F = moebius(24)
    W, G = surfaces.sphere(6, 8)
    result = cdcp_igl.surface_map(np.vstack([V, W + 5]), np.vstack([F, G + len(V)]))
    assert result.valid
    assert (result.face_chart >= 0).all()
    assert any(
        change.startswith("cut one-sided parts open along 1 edge") for change in result.changes
    )
    alone = cdcp_igl.surface_map(W + 5, G)
    np.testing.assert_allclose(result.uv[len(F) :], alone.uv, atol=1e-9)
    report = cdcp_igl.check(V, F)
    assert "surface_map cuts" in report.next_step
    assert "map --cut" in report.in_shell


def test_a_face_without_area_lies_at_one_place_of_one_chart():
    balls = [surfaces.sphere(5, 6) for _ in range(3)]
    n = len(balls[0][0])
    V = np.vstack([(k + 1) * W + [9 * k, 0, 0] for k, (W, _) in enumerate(balls)])
    line = [int(np.argmax(V[k * n : (k + 1) * n, 1])) + k * n for k in range(3)]
    V[line, 1:] = V[line[0], 1:]
    F = np.vstack([*(G + k * n for k, (_, G) in enumerate(balls)), [line]])
    result = cdcp_igl.surface_map(V, F)
    assert result.face_chart[-1] == -1
    for uv in (result.uv, result.packed()):
        assert (uv[-1] == uv[-1, 0]).all()
    at = (result.packed()[:-1] == result.packed()[-1, 0]).all(axis=2)
    assert len(np.unique(result.face_chart[:-1][at.any(axis=1)])) == 1
    np.testing.assert_array_equal(result.cut.vertex_index[result.cut.F], F)
