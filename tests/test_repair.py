import sys

import meshes
import numpy as np
import pytest

import cdcp_igl
from cdcp_igl.certificate import certify
from cdcp_igl.steps.repair import mean_value_weights, unfold
from cdcp_igl.surface.mesh import DiskMesh

V, F = meshes.grid(10, 12)
MESH = DiskMesh(V, F)
Z = cdcp_igl.cdcp(V, F) @ [1, 1j]


def is_valid(f):
    return certify(MESH, np.column_stack([f.real, f.imag])).valid


def test_a_valid_map_is_returned_as_it_is():
    f, repair = unfold(MESH, Z)
    assert f is Z
    assert repair.n_flipped == 0
    assert str(repair) == "not needed"


def test_one_misplaced_vertex_is_put_back_and_the_rest_stays():
    folded = Z.copy()
    vertex = MESH.interior[44]
    folded[vertex] = Z[vertex] + 0.4
    assert not is_valid(folded)
    f, repair = unfold(MESH, folded)
    assert is_valid(f)
    assert repair.n_flipped > 0
    assert "unfolded" in str(repair)
    assert np.count_nonzero(f != folded) <= repair.n_moved < len(MESH.interior)
    assert abs(f[vertex] - Z[vertex]) < 0.05


@pytest.mark.parametrize("seed", range(5))
def test_any_interior_can_be_unfolded(seed):
    rng = np.random.default_rng(seed)
    folded = Z.copy()
    folded[MESH.interior] = rng.uniform(-1, 1, (len(MESH.interior), 2)) @ [1, 1j]
    f, repair = unfold(MESH, folded)
    assert is_valid(f)
    np.testing.assert_array_equal(f[MESH.loop], Z[MESH.loop])
    assert repair.n_moved == len(MESH.interior)


def test_all_in_one_point():
    folded = Z.copy()
    folded[MESH.interior] = 0
    assert is_valid(unfold(MESH, folded)[0])


def test_mean_value_weights_are_positive_and_reproduce_the_plane():
    flat = DiskMesh(V[:, :2], F)
    W = mean_value_weights(flat)
    assert (W.data > 0).all()
    z = flat.V[:, 0] + 1j * flat.V[:, 1]
    mean = (W @ z) / np.asarray(W.sum(axis=1)).ravel()
    np.testing.assert_allclose(mean[flat.interior], z[flat.interior], atol=1e-13)


def test_disk_map_repairs_and_says_so(monkeypatch):
    monkeypatch.setattr(
        sys.modules["cdcp_igl.steps.circle.fallback"],
        "harmonic_extension",
        lambda mesh, L, factor, f_B: np.where(np.isin(np.arange(120), mesh.loop), Z, 0.3),
    )
    result = cdcp_igl.disk_map(V, F)
    assert result.certificate.valid
    assert result.repair.n_flipped > 0
    assert "unfolded" in str(result)


def test_slivers_of_a_ct_scan(real_mesh):
    """1,924 flipped faces of the cotangent Laplacian, 2 of the intrinsic Delaunay one."""
    result = cdcp_igl.disk_map(*real_mesh("cthead_115491"))
    assert result.valid
    assert result.conformal
    assert result.trace.laplacian == "intrinsic Delaunay"
    assert result.repair.n_flipped < 10
    assert result.distortion.mean < 1.25
    paper = cdcp_igl.disk_map(*real_mesh("cthead_115491"), preset="paper")
    assert result.distortion.mean < paper.distortion.mean
