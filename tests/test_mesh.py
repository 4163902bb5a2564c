"""DiskMesh: what it accepts, and what it promises."""

import copy
import pickle
from dataclasses import FrozenInstanceError

import meshes
import numpy as np
import pytest

import cdcp_igl
from cdcp_igl.surface.mesh import DiskMesh

V, F = meshes.grid()
READ_ONLY = V.copy(), F.copy()
for array in READ_ONLY:
    array.flags.writeable = False


VARIANTS = {
    "lists": (V.tolist(), F.tolist()),
    "int32": (V, F.astype(np.int32)),
    "uint16": (V, F.astype(np.uint16)),
    "uint64": (V, F.astype(np.uint64)),
    "whole floats": (V, F.astype(float)),
    "Fortran order": (np.asfortranarray(V), np.asfortranarray(F)),
    "strides": (V[:, ::-1][:, ::-1], F[::-1][::-1]),
    "read-only": READ_ONLY,
    "float32": (V.astype(np.float32), F),
}


@pytest.mark.parametrize(("positions", "faces"), VARIANTS.values(), ids=VARIANTS)
def test_array_variants_give_the_same_map(positions, faces):
    uv = cdcp_igl.cdcp(positions, faces)
    assert uv.dtype == np.float64
    # To the last bit, but where V was rounded.
    same = cdcp_igl.cdcp(np.asarray(positions, dtype=np.float64), F)
    np.testing.assert_array_equal(uv, same)
    np.testing.assert_allclose(uv, cdcp_igl.cdcp(V, F), atol=1e-6)


def test_what_a_mask_hides_is_missing():
    hidden = np.ma.array(V, mask=np.arange(len(V))[:, None] == [3, 5, 3])
    with pytest.raises(cdcp_igl.MeshError, match="NaN") as raised:
        cdcp_igl.cdcp(hidden, F)
    np.testing.assert_array_equal(raised.value.indices, [3, 5])
    with pytest.raises(cdcp_igl.MeshError, match="index outside"):
        cdcp_igl.cdcp(V, np.ma.array(F, mask=F == 0))


@pytest.mark.parametrize(
    "mesh",
    [meshes.TRIANGLE, meshes.TWO_TRIANGLES, meshes.strip(), meshes.fan(3)],
    ids=["one triangle", "two triangles", "no interior", "fan of 3"],
)
@pytest.mark.parametrize("options", [{}, {"preset": "paper"}, {"mobius": "area"}], ids=str)
def test_smallest_disks(mesh, options):
    result = cdcp_igl.disk_map(*mesh, **options)
    assert result.certificate.valid
    assert len(result.uv) == len(mesh[0])


def test_loop_and_interior():
    mesh = DiskMesh(*meshes.grid(3, 4))
    assert mesh.loop.tolist() == [0, 1, 2, 3, 7, 11, 10, 9, 8, 4]
    assert mesh.interior.tolist() == [5, 6]


def test_immutable_and_inputs_untouched():
    positions, faces = V.copy(), F.astype(np.int64)
    mesh = DiskMesh(positions, faces)
    for known in (mesh, copy.deepcopy(mesh), pickle.loads(pickle.dumps(mesh))):
        for array in (known.V, known.F, known.loop, known.interior, known.edges.low):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 0
    with pytest.raises(FrozenInstanceError):
        mesh.scaled = positions
    assert positions.flags.writeable
    assert faces.flags.writeable
    cdcp_igl.cdcp(positions, faces)
    np.testing.assert_array_equal(positions, V)
    np.testing.assert_array_equal(faces, F)


@pytest.mark.parametrize("columns", [2, 3])
@pytest.mark.parametrize("kept", [DiskMesh, cdcp_igl.disk_map, cdcp_igl.DiskMapper])
def test_arrays_that_are_changed_later_do_not_change_the_mesh(kept, columns):
    positions, faces = V[:, :columns].astype(np.float64), F.astype(np.int64)
    made = kept(positions, faces)
    mesh = getattr(made, "mesh", made)
    before = mesh.scaled.copy(), mesh.F.copy()
    positions += 1
    faces[:] = faces[::-1]
    np.testing.assert_array_equal(mesh.scaled, before[0])
    np.testing.assert_array_equal(mesh.F, before[1])


def test_scaling_is_exact():
    mesh = DiskMesh(V, F)
    ratio = V[V != 0] / mesh.scaled[V != 0]
    assert (ratio == ratio[0]).all()
    assert np.frexp(ratio[0])[0] == 0.5
    assert 0.5 <= abs(mesh.scaled).max() < 1
