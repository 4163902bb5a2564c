"""Maps without flipped faces where harmonic maps have some."""

import meshes
import numpy as np
import pytest
from cdcp_igl.rescue.harmonic_map import HarmonicMap
from cdcp_igl.rescue.pieces import flat_pieces
from cdcp_igl.rescue.trimming import Trimmed
from cdcp_igl.rescue.unfolding import keep_faces

import cdcp_igl
from cdcp_igl import selection
from cdcp_igl.certificate import certify, flipped_faces
from cdcp_igl.rescue.boundary import arc_length_map, by_arc_length
from cdcp_igl.rescue.collapsed_faces import hold_open
from cdcp_igl.rescue.refine import lower_angle_distortion
from cdcp_igl.solve.delaunay import (
    LEAST_WEIGHT,
    constrained_delaunay_laplacian,
    intrinsic_delaunay_laplacian,
)
from cdcp_igl.solve.factored import FactoredSurface
from cdcp_igl.solve.laplacian import cotangent_laplacian
from cdcp_igl.steps.center import central_face
from cdcp_igl.surface.mesh import DiskMesh


def rugged(seed):
    """A surface that rises and falls by more than its edges are long."""
    V, F = meshes.grid(16, 16)
    V = np.column_stack([V[:, :2], np.random.default_rng(seed).normal(size=len(V))])
    return DiskMesh(V * [1, 1, 3], F)


def flipped(mesh, f):
    return flipped_faces(f, mesh.F)[0]


def with_blister():
    """A grid with a hexagon, a vertex inside, behind one edge of its boundary."""
    V, F = meshes.grid(10, 10)
    mesh = DiskMesh(V, F)
    tail, head = mesh.loop[:2]
    along = V[head] - V[tail]
    across = np.array([along[1], -along[0], 0])
    turns = np.pi * np.array([4, 3, 2, 1]) / 3  # of the four corners that are new
    center = (V[tail] + V[head]) / 2 + across
    new = [center + along * np.cos(t + 1) + across * np.sin(t + 1) for t in turns]
    n = len(V)
    rim = [tail, n, n + 1, n + 2, n + 3, head]
    fan = [[rim[k], rim[k + 1], n + 4] for k in range(5)] + [[head, tail, n + 4]]
    return DiskMesh(np.vstack([V, new, center[None] + [0, 0, 0.1]]), np.vstack([F, fan]))


@pytest.mark.parametrize("seed", range(6))
def test_faces_that_are_kept_are_not_turned_over(seed):
    mesh = rugged(seed)
    surface = FactoredSurface.of(mesh)
    center = central_face(surface)
    harmonic = HarmonicMap.of(mesh, by_arc_length(surface, center.face), center, straightened=False)
    assert len(flipped(mesh, harmonic.f))
    kept = keep_faces(mesh, harmonic, straightened=False)
    assert len(flipped(mesh, kept.f)) == 0
    assert kept.boundary.method.laplacian == "constrained Delaunay"
    np.testing.assert_array_equal(kept.f[mesh.loop], harmonic.f[mesh.loop])


def test_a_map_without_flipped_faces_is_returned_as_it_is():
    mesh = DiskMesh(*meshes.grid(10, 10))
    surface = FactoredSurface.of(mesh)
    center = central_face(surface)
    harmonic = HarmonicMap.of(mesh, by_arc_length(surface, center.face), center, straightened=False)
    assert keep_faces(mesh, harmonic, straightened=False) is harmonic


def test_nothing_kept_is_intrinsic_delaunay_and_all_kept_the_mesh():
    mesh = rugged(0)
    m, none = len(mesh.F), np.zeros(len(mesh.F), dtype=bool)
    delaunay, free = intrinsic_delaunay_laplacian(mesh), constrained_delaunay_laplacian(mesh, none)
    inner = delaunay.matrix()
    inner.data[-inner.data < LEAST_WEIGHT] = 0  # small weights, and the diagonal
    difference = free.matrix().multiply(inner < 0) - inner
    assert abs(difference).max() < 1e-12 * abs(inner).max()
    fixed, own = constrained_delaunay_laplacian(mesh, np.ones(m, bool)), cotangent_laplacian(mesh)
    np.testing.assert_array_equal(fixed.low, own.low)
    np.testing.assert_array_equal(fixed.high, own.high)
    np.testing.assert_allclose(
        fixed.weights, np.maximum(own.weights, LEAST_WEIGHT), rtol=1e-12, atol=1e-14
    )
    assert (own.weights < 0).any()


@pytest.mark.parametrize("seed", range(3))
def test_disk_map_keeps_faces_before_it_replaces_the_interior(monkeypatch, seed):
    mesh = rugged(seed)
    result = cdcp_igl.disk_map(mesh.V, mesh.F)
    assert result.valid
    monkeypatch.setattr(selection, "keep_faces", lambda mesh, harmonic, straightened: harmonic)
    other = cdcp_igl.disk_map(mesh.V, mesh.F)
    assert result.distortion.mean < 1.1 * other.distortion.mean


def test_chords_of_a_strip_cut_off_all_that_is_behind_them():
    mesh = DiskMesh(*meshes.strip(12))
    chords = mesh.chords
    assert len(chords.start) == len(mesh.F) - 1
    assert not chords.hollow.any()
    sizes = []
    for k in range(len(chords.start)):
        faces, run = chords.faces(k), chords.run(k)
        np.testing.assert_array_equal(np.unique(mesh.F[faces]), np.sort(run))
        places = np.flatnonzero(np.isin(mesh.loop, run))
        assert len(places) == len(run) == len(faces) + 2
        sizes.append(len(faces))
    assert min(sizes) == 1
    outermost = chords.outermost(np.arange(len(sizes)))
    assert sum(sizes[k] for k in outermost) == len(mesh.F) - 1


def test_no_chords():
    mesh = DiskMesh(*meshes.fan())
    assert len(mesh.chords.start) == 0
    assert hold_open(mesh, np.exp(2j * np.arange(8)))[1] == 0


@pytest.mark.parametrize("arc", [1e-6, 1e-9, 1e-12])
def test_a_piece_without_room_is_held_open(arc):
    mesh = with_blister()
    chords = mesh.chords
    [k] = np.flatnonzero(chords.hollow)
    run, faces = chords.run(k), chords.faces(k)
    assert len(faces) == 6
    steps = np.ones(len(mesh.loop))
    steps[(chords.start[k] + np.arange(len(run) - 1)) % len(steps)] = arc
    angle = (np.cumsum(steps) - steps) / steps.sum() * 2 * np.pi
    f = np.zeros(len(mesh.V), complex)
    f[mesh.loop] = np.exp(1j * angle)
    center = np.setdiff1d(mesh.F[faces], mesh.loop)
    f[center] = f[run[2]]
    assert len(np.intersect1d(flipped(mesh, f), faces))
    g, n_opened = hold_open(mesh, f)
    assert n_opened > 0
    assert len(np.intersect1d(flipped(mesh, g), faces)) == 0
    assert abs(abs(g[mesh.loop]) - 1).max() < 2e-13
    assert set(np.flatnonzero(g != f)) <= {*run[1:-1], *center}


def test_what_is_trimmed_comes_back():
    mesh = with_blister()
    f = arc_length_map(mesh)
    whole = np.zeros(len(mesh.V), complex)
    whole[mesh.loop] = f
    assert Trimmed(mesh, whole).mesh is mesh
    [k] = np.flatnonzero(mesh.chords.hollow)
    run = mesh.chords.run(k)
    whole[run] = whole[run[0]] * np.exp(1e-8j * np.array([0, 1, 3, 4, 6, 7]))
    assert k in flat_pieces(mesh, whole[mesh.loop])
    trimmed = Trimmed(mesh, whole)
    assert len(trimmed.mesh.F) == len(mesh.F) - 6
    back = trimmed.completed(trimmed.f * 1j)
    np.testing.assert_allclose(back[mesh.loop], whole[mesh.loop] * 1j, atol=1e-15)


def test_steps_that_nobody_asked_for_end_where_there_is_little_to_gain():
    mesh = DiskMesh(*meshes.grid(10, 12))
    f = cdcp_igl.cdcp(mesh.V, mesh.F) @ [1, 1j]
    order = FactoredSurface.of(mesh).order
    g, account = lower_angle_distortion(
        mesh, f, order, 9, 1.5, enough=lambda taken, gain: taken == 2 and gain < 1
    )
    assert (account.steps, account.stopped) == (2, "little to gain")
    assert certify(mesh, np.column_stack([g.real, g.imag])).valid
