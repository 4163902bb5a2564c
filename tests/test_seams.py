"""Seams that are nearly there twice, loops that are closed, and points that were not measured."""

import numpy as np
import pytest
import surfaces
from commands import invoke
from meshes import grid

import cdcp_igl


def tube(columns=25, rows=13):
    t, z = np.meshgrid(np.linspace(0, 2 * np.pi, columns), np.linspace(0, 3, rows), indexing="ij")
    k = np.arange(columns * rows).reshape(columns, rows)
    a, b, c, d = (x.ravel() for x in (k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]))
    F = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return np.stack([np.cos(t), np.sin(t), z], -1).reshape(-1, 3), F


def globe():
    t, p = np.meshgrid(np.linspace(0, 2 * np.pi, 31), np.linspace(0, np.pi, 16), indexing="ij")
    x = np.stack([np.cos(t) * np.sin(p), np.sin(t) * np.sin(p), np.cos(p)], -1)
    return x.reshape(-1, 3), tube(31, 16)[1]


def test_a_tube_from_linspace_is_a_ring_by_the_call_that_the_error_names():
    V, F = tube()
    with pytest.raises(cdcp_igl.MeshError, match="fill=False"):
        cdcp_igl.annulus_map(V, F)
    sewn = cdcp_igl.clean(V, F, fill=False)
    assert sewn.changes[0] == "merged 13 vertices with an equal one"
    assert cdcp_igl.annulus_map(*sewn[:2]).valid


def test_a_globe_in_longitude_and_latitude_is_closed():
    cleaned = cdcp_igl.clean(*globe())
    assert cdcp_igl.check(*cleaned[:2]).kind == "genus 0, closed"


@pytest.mark.parametrize("far", [1e-9, 1e-6, 1e-4])
@pytest.mark.parametrize("unit", [1.0, 1e-3, 1e6])
def test_what_is_near_is_counted_and_sewn_by_the_call_that_is_named(far, unit):
    V, F = tube()
    V[-13:] += far * np.random.default_rng(0).uniform(0.3, 0.5, (13, 3))
    V *= unit
    report = cdcp_igl.check(V, F)
    count, within = report.near
    assert count == report.report()["near_pairs"] == 13
    assert f"clean with within={within:g}" in str(report)
    assert len(cdcp_igl.clean(V, F).V) == len(V)
    sewn = cdcp_igl.clean(V, F, within=within, fill=False)
    assert (len(sewn.V), cdcp_igl.check(*sewn[:2]).near) == (len(V) - 13, (0, 0.0))
    assert len(sewn.F) == len(F)


def test_in_the_shell_and_a_batch_too(tmp_path):
    V, F = tube()
    V[-13:] += 4e-7 * np.random.default_rng(0).uniform(size=(13, 3))
    np.savez(tmp_path / "tube.npz", V=V, F=F)
    surface, out = tmp_path / "tube.npz", tmp_path / "out.npz"
    named = "cdcp-igl map --clean --within 1e-06 sews them"
    assert named in invoke("check", surface).output
    assert named in invoke("map", "--cut", surface, out).output
    command = ("map", "--annulus", "--clean", surface, out, "--force")
    assert invoke(*command).exit_code == 2
    assert invoke(*command, "--within", 1e-6).exit_code == 0
    made = cdcp_igl.batch(surface, tmp_path / "maps", onto="annulus", clean=True, within=1e-6)
    assert made.records[0].changes[0] == "merged 13 vertices with an equal one"
    assert (tmp_path / "maps" / "tube.npz").read_bytes() == out.read_bytes()


def test_loose_triangles_off_by_rounding_are_one_surface():
    W, G = surfaces.sphere(6, 8)
    V, F = surfaces.soup(W, G)
    noise = np.random.default_rng(0).normal(size=V.shape)
    assert len(cdcp_igl.surface_map(V + 1e-12 * noise, F).charts) == 1


def test_no_face_collapses_however_much_is_merged():
    V, F = tube()
    assert len(cdcp_igl.clean(V, F, within=10, fill=False).F) == len(F)
    with pytest.raises(ValueError, match="within must be"):
        cdcp_igl.clean(V, F, within=-1)


def test_a_sphere_with_holes_is_mapped_and_a_bowl_is_closed_by_the_call_that_is_named():
    V, F = surfaces.sphere(12, 16)
    result = cdcp_igl.sphere_map(V, F[1:])
    assert (result.valid, result.filled, len(result.uv)) == (True, 1, len(F) - 1)
    assert len(result.points) == len(V)
    bowl = F[V[F].mean(axis=1)[:, 2] < 0.3]
    used, rows = np.unique(bowl, return_inverse=True)
    V, F = V[used], rows.reshape(-1, 3)
    with pytest.raises(cdcp_igl.MeshError, match="close=True"):
        cdcp_igl.sphere_map(V, F)
    assert cdcp_igl.clean(V, F).changes == ()
    closed = cdcp_igl.clean(V, F, close=True)
    assert cdcp_igl.sphere_map(*closed[:2]).valid


def depth_image():
    """A face before a camera at 0: what it did not see is at 0."""
    y, x = np.mgrid[-1:1:14j, -1:1:12j]
    z = 0.8 - 0.25 * np.exp(-2 * (x * x + y * y))
    P = np.stack([x * z / 2, y * z / 2, z], -1)
    unseen = x * x + y * y > 0.95
    unseen[6:8, 3:5] = True
    return P, unseen


@pytest.mark.parametrize("lost", [0, -1, -9999])
def test_points_that_were_not_measured_are_named_and_dropped(lost):
    P, unseen = depth_image()
    P[unseen, 0 if lost > -9999 else 2 :] = lost
    V, F = P.reshape(-1, 3), tube(14, 12)[1]
    defect = cdcp_igl.check(V, F).defects[0]
    assert defect.name == "points without data"
    np.testing.assert_array_equal(defect.indices, np.flatnonzero(unseen))
    assert f"{lost}" in defect.what
    cleaned = cdcp_igl.clean(V, F)
    assert "without data" in cleaned.changes[0]
    assert not unseen.ravel()[cleaned.vertex_index[cleaned.vertex_index >= 0]].any()
    assert cdcp_igl.disk_map(*cleaned[:2]).valid
    assert (cdcp_igl.surface_map(V, F).face_chart[unseen.ravel()[F].any(axis=1)] == -1).all()


def test_a_pole_of_many_vertices_and_a_floor_are_no_missing_data():
    V, F = grid()
    for mesh in (globe(), (V * [1, 1, 0], F), surfaces.voxels(3, size=2)):
        names = {defect.name for defect in cdcp_igl.check(*mesh).defects}
        assert "points without data" not in names


@pytest.mark.parametrize("row", ["boundary", "one boundary loop", "points without data"])
def test_in_the_shell_the_remedy_leads_out(tmp_path, row):
    """Each call is refused and names a command, which maps the surface."""
    W, G = surfaces.sphere(12, 16)
    P, _ = depth_image()
    P[8:, :3] = 0
    V, F, onto = {
        "boundary": (W, G[W[G].mean(axis=1)[:, 2] < 0.3], "--sphere"),
        "one boundary loop": (*tube(), "--annulus"),
        "points without data": (P.reshape(-1, 3), tube(14, 12)[1], ""),
    }[row]
    used, rows = np.unique(F, return_inverse=True)
    surface, out = tmp_path / "a.npz", tmp_path / "out.npz"
    np.savez(surface, V=V[used], F=rows.reshape(-1, 3))
    refused = invoke("map", *[onto] * bool(onto), surface, out)
    assert refused.exit_code
    assert f"map {onto} --clean".replace("  ", " ") in " ".join(refused.output.split())
    assert invoke("map", *[onto] * bool(onto), "--clean", surface, out).exit_code == 0
