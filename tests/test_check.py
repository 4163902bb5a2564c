"""Every way in which the input can fail to be a disk."""

import re
from contextlib import suppress
from itertools import product

import meshes
import numpy as np
import pytest
from scipy.spatial import ConvexHull
from surfaces import sphere
from test_clean import assert_mended
from test_cutting import assert_cut
from test_surface_map import assert_consistent
from typer.main import get_command

import cdcp_igl
from cdcp_igl.command_line.program import app
from cdcp_igl.defects import CLEAN, CUT, DEFECTS
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
    report = cdcp_igl.check(V, F)
    assert not report.is_disk
    assert [d.name for d in report.defects] == [d.name for d in error.defects]
    assert f"- {defect}: " in str(report)
    with suppress(ValueError):  # it does not end the process
        cdcp_igl.angle_distortion(V, F, V)


# What the functions that mend or cut refuse besides bad arrays, and what they promise.
HOPELESS = "non-finite coordinate", "not orientable"
FAULTY = "repeated corner", "duplicate face", "inconsistent orientation"
MENDING = {
    cdcp_igl.clean: (assert_mended, "degenerate face"),
    cdcp_igl.cut: (assert_cut, *HOPELESS, *FAULTY),
    cdcp_igl.surface_map: (assert_consistent, HOPELESS[0], "degenerate face"),
}
NOT_ITS_ROWS = cdcp_igl.surface_map, "split vertices"  # it sews: test_seams_are_sewn


@pytest.mark.parametrize(
    ("function", "name"), [pair for pair in product(MENDING, meshes.NASTY) if pair != NOT_ITS_ROWS]
)
def test_nasty_meshes_are_mended_or_refused(function, name):
    defect, V, F, rows = meshes.NASTY[name]
    assert_promised, *refused = MENDING[function]
    if defect in {*refused, *meshes.BAD_ARRAYS}:
        with pytest.raises(cdcp_igl.MeshError) as raised:
            function(V, F)
        nothing_left = defect == "degenerate face"  # and no other one
        assert raised.value.defect == ("nothing left" if nothing_left else defect)
        if not nothing_left and defect != "not orientable":  # which is said of all faces
            np.testing.assert_array_equal(raised.value.indices, rows)
    else:
        assert_promised(function(V, F), V, F)


@pytest.mark.parametrize("row", DEFECTS.values(), ids=DEFECTS)
def test_commands_in_the_remedies_exist(row):
    commands = get_command(app).commands
    for command, option in re.findall(r"cdcp-igl (\w+)(?: (--[a-z]+))?", row.remedy_in_shell):
        options = [name for parameter in commands[command].params for name in parameter.opts]
        assert option in ["", *options]
    assert "cdcp_igl" not in row.remedy_in_shell


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


@pytest.mark.parametrize(
    ("name", "remedy"),
    [("one-based", "F - 1"), ("index n", "Correct"), ("split vertices", "merge")],
)
def test_the_remedy_is_the_right_one(name, remedy):
    _, V, F, _ = meshes.NASTY[name]
    assert remedy in cdcp_igl.check(V, F).defects[0].remedy


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
    assert len(cdcp_igl.check(*meshes.strip(6)).chords) == 5
    loop = DiskMesh(V, F).loop
    edges = {tuple(sorted(edge)) for face in F for edge in zip(face, np.roll(face, 1), strict=True)}
    sides = {tuple(sorted(edge)) for edge in zip(loop, np.roll(loop, 1), strict=True)}
    expected = sorted(edge for edge in edges - sides if np.isin(edge, loop).all())
    assert list(map(tuple, cdcp_igl.check(V, F).chords)) == expected


@pytest.mark.skipif(np.finfo(np.longdouble).maxexp == 1024, reason="it is float64 here")
def test_coordinates_beyond_float64_are_not_finite():
    V, F = meshes.grid()
    large = V.astype(np.longdouble)
    large[20, 1] = np.longdouble("1e400")
    [defect] = cdcp_igl.check(large, F).defects
    assert (defect.name, defect.indices.tolist()) == ("non-finite coordinate", [20])
    assert "with a NaN or infinite coordinate" in cdcp_igl.clean(large, F).changes[0]
    assert cdcp_igl.check(V.astype(np.longdouble), F).is_disk


@pytest.mark.parametrize("scale", [1e-200, 1e200])
def test_degeneracy_does_not_depend_on_the_unit(scale):
    V, F = meshes.grid()
    assert cdcp_igl.check(scale * V, F).is_disk
    _, sliver, face, _ = meshes.NASTY["sliver"]
    assert not cdcp_igl.check(scale * np.array(sliver), face).is_disk


@pytest.mark.parametrize(
    ("name", "kind", "components", "loops", "genus"),
    [
        ("closed", "genus 0, closed", 1, 0, 0),
        ("annulus", "genus 0, 2 boundary loops", 1, 2, 0),
        ("handle", "genus 1, 1 boundary loop", 1, 1, 1),
        ("two components", "2 components, genus 0, 2 boundary loops", 2, 2, 0),
        ("Moebius strip", "one-sided", 1, None, None),
        ("three pages", "3 components, not a manifold", 3, None, None),
        ("boundary vertices merged", "not a manifold", 1, None, None),
        ("reversed face", "disk", 1, 1, 0),
        ("NaN", "disk", 1, 1, 0),
        ("sliver", "disk", 1, 1, 0),
        ("quads", "not a triangle mesh", 0, None, None),
    ],
)
def test_the_class_of_a_surface(name, kind, components, loops, genus):
    _, V, F, _ = meshes.NASTY[name]
    report = cdcp_igl.check(V, F)
    assert report.kind == kind
    assert (report.n_components, report.n_loops, report.genus) == (components, loops, genus)
    assert kind in str(report)
    assert "but not" not in str(report).replace("but not fit", "")
    assert (" boundary vertices" in str(report)) == (loops is not None)
    assert "merge=False" not in report.in_shell


def test_rows_are_counted_and_all_is_reported_where_an_array_is_bad():
    _, V, F, _ = meshes.NASTY["NaN"]
    F = np.delete(F, 18, axis=0)
    for faces, count, second in (
        (F, len(F), "several boundary loops"),
        (F + 1, 0, "index out of range"),
    ):
        report = cdcp_igl.check(V, faces)
        assert (report.n_vertices, report.n_faces) == (len(V), count)
        assert [d.name for d in report.defects] == ["non-finite coordinate", second]


@NASTY
def test_the_next_step_and_the_remedies_are_what_works(case):
    """Where the step is `clean`, it gives a disk; where it is `surface_map`, there is a map."""
    _, V, F, _ = case
    report = cdcp_igl.check(V, F)
    assert f"Next: {report.next_step}" in str(report)
    if report.next_step.startswith("cdcp_igl.clean"):
        assert cdcp_igl.check(*cdcp_igl.clean(V, F)[:2]).is_disk
    elif report.next_step.startswith("cdcp_igl.surface_map"):
        assert cdcp_igl.surface_map(V, F).valid
        assert "Next: cdcp-igl map --cut" in report.in_shell
    elif report.next_step.startswith("cdcp_igl.sphere_map"):
        assert cdcp_igl.sphere_map(V, F).valid
        assert "Next: cdcp-igl map --sphere" in report.in_shell
    else:
        [defect] = [found for found in report.defects if found.remedy == report.next_step]
        assert f"Next: {defect.remedy_in_shell}" in report.in_shell
    for defect in report.defects:
        assert defect.in_shell in report.in_shell
        if CLEAN in DEFECTS[defect.name].by:
            assert "cdcp_igl.clean" in defect.remedy
            assert "--clean" in defect.remedy_in_shell
        if CUT in DEFECTS[defect.name].by:
            assert "cdcp_igl.cut" in defect.remedy or "cdcp_igl.surface_map" in defect.remedy
            assert "--cut" in defect.remedy_in_shell


def test_a_closed_surface_with_another_defect_is_not_for_the_sphere():
    V, F = sphere()
    F[5] = F[5, ::-1]
    assert cdcp_igl.check(V, F).next_step.startswith("cdcp_igl.surface_map")


def test_the_outer_loop_is_the_one_that_reaches_farthest():
    """Not the one with the most vertices, nor the longest, which may be a river."""
    V, F = rivered_square()
    [defect] = cdcp_igl.check(V, F).defects
    assert defect.name == "several boundary loops"
    outline = np.flatnonzero((abs(V[:, :2]) == 1).any(axis=1))
    assert len(np.intersect1d(defect.indices, outline)) == 0
    assert cdcp_igl.check(V, F).n_boundary == len(outline) < len(defect.indices)


def test_the_side_that_faces_point_to():
    """A closed surface points outward, a plane one upward; open in space, whatever."""
    V, F, _ = cdcp_igl.datasets.spheroid(2, 1.5)
    small = 1e-3 * V + 50
    both = np.vstack([V, small]), np.vstack([F, F[:, ::-1] + len(V)])
    assert cdcp_igl.check(V, F).side == cdcp_igl.check(V, F[1:, ::-1]).side == ""
    assert cdcp_igl.check(*both).side == "faces point inward"
    assert (
        "- side: faces point inward; cdcp-igl map --clean turns" in cdcp_igl.check(*both).in_shell
    )
    assert "point inward" in str(cdcp_igl.surface_map(*both))
    flat, G, _ = cdcp_igl.datasets.square(4)
    assert (
        cdcp_igl.check(flat, G).side == cdcp_igl.check(np.roll(flat, 1, 1), G[:, ::-1]).side == ""
    )
    for clockwise in (G[:, ::-1], np.vstack([G[3:, ::-1], G[:3]])):
        assert cdcp_igl.check(flat[:, :2], clockwise).side == "faces are clockwise"
    assert "clockwise" in str(cdcp_igl.disk_map(flat, G[:, ::-1]))

    rng = np.random.default_rng(0)
    for _ in range(6):
        V = rng.normal(size=(20, 3))
        cleaned = cdcp_igl.clean(V, ConvexHull(V).simplices)
        assert np.linalg.det(cleaned.V[cleaned.F]).sum() > 0
        F = cleaned.F[:, ::-1]
        assert cdcp_igl.clean(cleaned.V, F).changes[-1] == f"turned {len(F)} faces outward"


def rivered_square():
    """A square with a winding slit in which faces are missing."""
    V, F, _ = cdcp_igl.datasets.square(20)
    middle = V[F].mean(axis=1)
    river = abs(middle[:, 1] - 0.6 * np.sin(9 * middle[:, 0])) < 0.11
    inside = (abs(V[F][:, :, :2]) < 0.9).all(axis=(1, 2))
    cleaned = cdcp_igl.clean(V, F[~(river & inside)])
    used, faces = np.unique(cleaned.F[cleaned.face_index >= 0], return_inverse=True)
    return cleaned.V[used], faces.reshape(-1, 3)
