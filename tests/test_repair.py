import meshes
import numpy as np
import pytest
from surfaces import arms

import cdcp_igl
from cdcp_igl.arrays import coordinates
from cdcp_igl.certificate import certify, is_around
from cdcp_igl.rescue.relaxation import Relaxation
from cdcp_igl.rescue.repair import (
    Neighbourhood,
    mean_value_weights,
    repair_locally,
    repaired,
    replace_interior,
)
from cdcp_igl.surface.mesh import DiskMesh
from cdcp_igl.surface.triangles import flipped_faces

V, F = meshes.grid(10, 12)
MESH = DiskMesh(V, F)
Z = cdcp_igl.cdcp(V, F) @ [1, 1j]


def is_valid(f, mesh=MESH):
    return certify(mesh, coordinates(f)).valid


def test_a_valid_map_is_returned_as_it_is():
    f, repair = repaired(MESH, Z)
    assert f is Z
    assert repair.n_flipped == 0
    assert str(repair) == "not needed"


def test_weights_that_differ_less_embed_what_mean_values_crowd():
    mesh = DiskMesh(*arms(32, 2))
    f = np.zeros(len(mesh.V), dtype=complex)
    f[mesh.loop] = np.exp(2j * np.pi * np.arange(len(mesh.loop)) / len(mesh.loop))
    embedded, account = replace_interior(mesh, f)
    assert account.rounds > 1  # mean values alone did not do
    assert len(flipped_faces(embedded, mesh.F)[0]) == 0
    assert is_around(embedded[mesh.loop])


@pytest.mark.parametrize(("seed", "size"), [(0, 1), (1, 1), (2, 0)])
def test_any_interior_can_be_repaired(seed, size):
    rng = np.random.default_rng(seed)
    folded = Z.copy()
    folded[MESH.interior] = size * rng.uniform(-1, 1, (len(MESH.interior), 2)) @ [1, 1j]
    f, repair = repaired(MESH, folded)
    assert is_valid(f)
    np.testing.assert_array_equal(f[MESH.loop], Z[MESH.loop])
    assert repair.n_moved == len(MESH.interior)


def test_mean_value_weights_are_positive_and_reproduce_the_plane():
    flat = DiskMesh(V[:, :2], F)
    W = mean_value_weights(flat.V, flat.F, flat.angles)
    assert (W.data > 0).all()
    z = flat.V[:, 0] + 1j * flat.V[:, 1]
    mean = (W @ z) / np.asarray(W.sum(axis=1)).ravel()
    np.testing.assert_allclose(mean[flat.interior], z[flat.interior], atol=1e-13)


@pytest.mark.parametrize("seed", range(3))
def test_disk_map_repairs_and_says_so(seed):
    V, F = meshes.rugged(seed)
    result = cdcp_igl.disk_map(V, F)
    assert result.valid
    flipped, moved = result.repair.n_flipped, result.repair.n_moved
    assert flipped > 0
    assert f"{flipped} flipped faces, {moved} vertices moved in " in str(result)
    plain = cdcp_igl.disk_map(V, F, refine=0)
    assert plain.valid
    assert plain.refinement is None
    assert result.distortion.mean < 0.9 * plain.distortion.mean


def test_a_repaired_map_is_held_against_that_without_its_moebius_transformation(real_mesh):
    """Here that is the better one; without it, the whole interior is replaced: 10.5 degrees."""
    V, F = real_mesh("any/closed_arm_8311")
    result = cdcp_igl.disk_map(V, np.delete(F, 8505, axis=0), refine=0)
    assert (result.mobius.method, result.mobius.rejected) == ("angle", "repair")
    assert result.repair.rounds > 1
    assert result.distortion.mean < 6


def test_slivers_of_a_ct_scan(map_of):
    """1,924 flipped faces of the cotangent Laplacian, 2 of the intrinsic Delaunay one."""
    result = map_of("cthead_115491")
    assert result.valid
    assert result.conformal
    assert result.boundary.laplacian == "intrinsic Delaunay"
    assert result.repair.n_flipped < 10
    assert result.distortion.mean < 1.25


def test_repair_of_one_face_stays_near_it():
    V, F = meshes.grid(40, 40)
    mesh = DiskMesh(V, F)
    f = cdcp_igl.cdcp(V, F) @ [1, 1j]
    vertex = 20 * 40 + 20
    folded = f.copy()
    folded[vertex] += 4 * abs(f[vertex + 1] - f[vertex])
    mended, repair = repair_locally(mesh, folded)
    assert is_valid(mended, mesh)
    assert str(repair).endswith(f", {repair.n_moved} vertices moved in 1 round")
    assert np.count_nonzero(mended != folded) <= repair.n_moved < 400
    assert abs(mended - f).max() < 0.5 * abs(f[vertex + 1] - f[vertex])


@pytest.mark.parametrize(("size", "relaxed"), [(1e-10, True), (1e-15, False)])
def test_a_relaxation_that_flips_faces_is_undone(size, relaxed):
    """In a spot as small as the distance between doubles, every displacement is rounded."""
    near, f = Neighbourhood(MESH, np.ones(len(V), dtype=bool)), 0.7 + 0.1j + size * Z
    near.moved = near.free.copy()
    assert (near.relaxed(f) is not f) == relaxed


def test_too_many_flipped_faces_are_left_alone():
    folded = Z.copy()
    folded[MESH.interior] = 0
    f, repair = repair_locally(MESH, folded, most=5)
    assert f is folded
    assert "too many" in str(repair)


def test_a_soft_relaxation_repairs_a_flipped_face():
    folded = Z.copy()
    vertex = MESH.interior[44]
    folded[vertex] = Z[vertex] + 0.4
    moving = np.arange(len(Z)) == vertex
    relaxation = Relaxation(MESH.V, F, moving)
    for softness in (0.3, 0.1, 0.03, 0.01):
        folded = relaxation.sweep(folded, 10, softness)
    assert is_valid(folded)


def test_a_face_that_stays_flipped_is_not_called_unfolded():
    """A polygon without vertices inside: nothing may move."""
    V, F = meshes.strip()
    mesh = DiskMesh(V, F)
    f = np.exp(2j * np.pi * mesh.loop_index / len(V))
    f[mesh.loop[1]] = f[mesh.loop[0]]
    left, repair = repair_locally(mesh, f)
    flipped, _ = flipped_faces(left, F)
    assert len(flipped) == 1
    assert str(repair).startswith("1 flipped face, 0 vertices moved in ")
