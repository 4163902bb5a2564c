"""Every way in which the input can fail to be a disk."""

import subprocess
import sys

import meshes
import numpy as np
import pytest

import cdcp_igl
from cdcp_igl.surface.mesh import DiskMesh

NASTY = pytest.mark.parametrize("case", meshes.NASTY.values(), ids=meshes.NASTY.keys())


@NASTY
def test_nasty_mesh_is_refused_by_name_and_index(case):
    defect, V, F, indices = case
    with pytest.raises(cdcp_igl.MeshError) as raised:
        cdcp_igl.cdcp(V, F)
    error = raised.value
    assert error.defect == defect
    np.testing.assert_array_equal(np.sort(error.indices, axis=0), np.sort(indices, axis=0))
    assert error.remedy
    assert error.remedy in str(error)
    if len(indices):
        assert str(np.ravel(error.indices)[0]) in str(error)


@NASTY
def test_check_reports_what_cdcp_raises(case):
    defect, V, F, _ = case
    report = cdcp_igl.check(V, F)
    assert not report.is_disk
    assert report.defects[0].name == defect
    assert defect in str(report)


def test_no_nasty_mesh_crashes_the_interpreter():
    code = (
        "import sys; sys.path.insert(0, 'tests')\n"
        "import meshes, cdcp_igl\n"
        "for _, V, F, _ in meshes.NASTY.values():\n"
        "    for function in (cdcp_igl.cdcp, lambda V, F: cdcp_igl.angle_distortion(V, F, V)):\n"
        "        try: function(V, F)\n"
        "        except ValueError: pass\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)


def test_several_defects_are_all_reported():
    V, F = meshes.grid()
    F = np.delete(F, 18, axis=0)
    V = np.vstack([V, [[1, 2, 3]]])
    V[0] = V[1]
    names = [defect.name for defect in cdcp_igl.check(V, F).defects]
    assert names == ["unreferenced vertex", "several boundary loops", "degenerate face"]
    with pytest.raises(cdcp_igl.MeshError, match="Also: several boundary loops, degenerate face"):
        DiskMesh(V, F)


def test_pinches_behind_another_defect_are_named():
    _, V, F, _ = meshes.NASTY["hanging tetrahedron"]
    pinched = cdcp_igl.check(V, F).defects[1]
    assert (pinched.name, pinched.indices.tolist()) == ("non-manifold vertex", [6])


def test_one_based_faces_get_the_right_remedy():
    V, F = meshes.grid()
    assert "F - 1" in cdcp_igl.check(V, F + 1).defects[0].remedy


def test_split_vertices_get_the_right_remedy():
    _, V, F, _ = meshes.NASTY["split vertices"]
    assert "merging" in cdcp_igl.check(V, F).defects[0].remedy


def test_smaller_side_is_to_be_reversed():
    V, F = meshes.grid()
    wrong = np.array([1, 2, 30, 31])
    F = F.copy()
    F[wrong] = F[wrong, ::-1]
    defect = cdcp_igl.check(V, F).defects[0]
    np.testing.assert_array_equal(defect.indices, wrong)
    F[defect.indices] = F[defect.indices, ::-1]
    assert cdcp_igl.check(V, F).is_disk


def test_report_of_a_disk():
    V, F = meshes.grid(6, 8)
    report = cdcp_igl.check(V, F)
    assert report.is_disk
    assert (report.n_vertices, report.n_faces, report.n_boundary) == (48, 70, 24)
    assert report.ears.tolist() == [6, 63]
    assert report.chords.tolist() == [[6, 15], [32, 41]]
    assert "A triangulated disk." in str(report)


def test_chords_are_the_inner_edges_between_boundary_vertices():
    V, F = meshes.grid(3, 9)
    report = cdcp_igl.check(V, F)
    assert len(cdcp_igl.check(*meshes.strip(6)).chords) == 5
    boundary = set(DiskMesh(V, F).loop.tolist())
    inner = {tuple(sorted(e)) for f in F.tolist() for e in zip(f, f[1:] + f[:1], strict=True)}
    loop = DiskMesh(V, F).loop
    inner -= {tuple(sorted(e)) for e in zip(loop.tolist(), np.roll(loop, -1).tolist(), strict=True)}
    expected = sorted(e for e in inner if boundary.issuperset(e))
    assert sorted(map(tuple, report.chords.tolist())) == expected


@pytest.mark.parametrize("scale", [1e-200, 1e-12, 1.0, 1e12, 1e200])
def test_degeneracy_does_not_depend_on_the_unit(scale):
    V, F = meshes.grid()
    assert cdcp_igl.check(scale * V, F).is_disk
    _, sliver, face, _ = meshes.NASTY["sliver"]
    assert not cdcp_igl.check(scale * np.array(sliver), face).is_disk


def test_real_meshes_are_disks(real_mesh):
    for name in ("cthead_115491", "maze_6120", "face_1180_ears"):
        assert cdcp_igl.check(*real_mesh(name)).is_disk
