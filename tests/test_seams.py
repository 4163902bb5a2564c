"""Seams of one's own, those that are nearly there twice, closed loops, points without data."""

import numpy as np
import pytest
import surfaces
from batches import batch
from commands import invoke
from hypothesis import given, settings
from hypothesis import strategies as st
from meshes import cells, grid

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


# -- seams of one's own ----------------------------------------------------------------


def edges_of(F):
    """(k, 2) edges, the smaller vertex first."""
    return np.unique(np.sort(np.vstack([F[:, [0, 1]], F[:, [1, 2]], F[:, [2, 0]]]), axis=1), axis=0)


def as_set(edges):
    return set(map(tuple, np.sort(edges, axis=1).tolist()))


def meridian(V, F):
    """Edges from pole to pole of a sphere in longitude and latitude."""
    flat = V[edges_of(F)]
    along = (abs(flat[..., 1]) < 1e-9).all(axis=1) & (flat[..., 0] > -1e-9).all(axis=1)
    return edges_of(F)[along]


def test_cuts_go_along_the_seams_given_and_elsewhere_only_if_that_is_asked_for():
    V, F = surfaces.sphere(12, 16)
    seams = meridian(V, F)
    result = cdcp_igl.surface_map(V, F, seams=seams)
    assert result.valid
    assert as_set(result.cut.edges) == as_set(seams)
    assert (len(result.charts), len(result.added)) == (1, 0)
    assert f"cut open along {len(seams)} edges, 0 of them added to the seams" in str(result)
    even = cdcp_igl.surface_map(V, F, seams=seams, scale_variation=0.2)
    assert as_set(even.cut.edges) == as_set(seams) | as_set(even.added)
    assert as_set(even.added).isdisjoint(as_set(seams))
    assert even.report()["added_edges"] == len(even.added) > 0
    assert even.texel_density.ratio < result.texel_density.ratio
    report = cdcp_igl.surface_map(V, F, seams=seams[:3]).report()
    assert report["cut_edges"] == 3 + report["added_edges"]


def test_seams_that_leave_an_uneven_scale_are_told(tmp_path, caplog):
    """As texels of the ball around a short slit: their sizes differ twentyfold, and more."""
    V, F = surfaces.sphere()
    slit = [F[0, :2], F[0, 1:]]
    result = cdcp_igl.surface_map(V, F, seams=slit)
    assert result.texel_density.ratio > 5
    assert len(result.added) == 0
    first = str(result).splitlines()[0]
    assert f"valid, scale variation {result.scale_variation:.2f}, asked for: 0.2" in first
    assert any(first.endswith(said) for said in caplog.messages)
    assert cdcp_igl.surface_map(V, F, seams=slit, scale_variation=np.inf).verdict == "valid"
    around = edges_of(F)  # each face for itself
    assert cdcp_igl.surface_map(V, F, seams=around).verdict == "valid"
    np.savez(tmp_path / "ball.npz", V=V, F=F)
    np.savetxt(tmp_path / "slit.txt", slit, fmt="%d")
    how = "--cut", "--seams", tmp_path / "slit.txt"
    told = invoke("map", tmp_path / "ball.npz", tmp_path / "a.obj", *how).output
    assert "asked for: 0.2" in " ".join(told.split())


def test_a_handle_that_no_seam_opens_is_cut():
    V, F = surfaces.torus()
    seams = edges_of(F)[:3]
    result = cdcp_igl.surface_map(V, F, seams=seams)
    assert (result.valid, len(result.charts)) == (True, 1)
    assert as_set(seams) <= as_set(result.cut.edges)
    assert len(result.added) > 0


@pytest.mark.parametrize("suffix", ["obj", "glb"])
def test_the_seams_of_a_file_by_its_texture_coordinates(tmp_path, suffix):
    """The boundaries of the charts are those of the file, one for one."""
    V, F = surfaces.sphere(12, 16)
    given = cdcp_igl.surface_map(V, F)
    file = tmp_path / f"sphere.{suffix}"
    given.save(file)
    result = cdcp_igl.surface_map(file, seams="uv")
    assert (len(result.cut.edges), len(result.added)) == (len(given.cut.edges), 0)
    assert result.cut.length == pytest.approx(given.cut.length, rel=1e-6)
    np.testing.assert_array_equal(result.face_chart, given.face_chart)
    out = tmp_path / "out.npz"
    assert invoke("map", "--cut", "--seams", "uv", file, out).exit_code == 0
    np.testing.assert_array_equal(np.load(out)["uv"], result.uv)
    made = batch(file, tmp_path / "maps", cut=True, seams="uv")
    np.testing.assert_array_equal(np.load(made.folder / "sphere.npz")["uv"], result.uv)
    if suffix == "glb":  # where the same place is there twice
        kept = cdcp_igl.surface_map(file, seams="keep")
        assert as_set(kept.cut.edges) == as_set(result.cut.edges)
    by_corners = cdcp_igl.surface_map(V, F, seams=given.uv)
    assert as_set(by_corners.cut.edges) == as_set(given.cut.edges)


def test_a_ring_between_seams_is_filled_and_a_slit_is_not():
    x, y, F = cells(13, 13)
    V = np.column_stack([x, y, 0 * x])
    middle = (abs(x[F] - 6) <= 2).all(axis=1) & (abs(y[F] - 6) <= 2).all(axis=1)
    rim = as_set(edges_of(F[middle])) & as_set(edges_of(F[~middle]))
    result = cdcp_igl.surface_map(V, F, seams=sorted(rim))
    assert (len(result.charts), len(result.added)) == (2, 0)
    assert result.distortion.max < 1e-6
    slit = [[13 * 6 + k, 13 * 6 + k + 1] for k in range(3, 9)]
    result = cdcp_igl.surface_map(V, F, seams=slit)
    assert as_set(slit) < as_set(result.cut.edges)
    assert result.distortion.max < 1e-6


@pytest.mark.parametrize("outline", ["free", "disk"])
def test_where_no_seam_may_run_there_is_none(outline):
    V, F = surfaces.sphere(12, 16)
    once = cdcp_igl.surface_map(V, F, outline=outline)
    front = edges_of(F[V[F][..., 0].mean(axis=1) > 0])
    for forbidden in (once.cut.edges, front):
        result = cdcp_igl.surface_map(V, F, outline=outline, forbidden=forbidden)
        assert result.valid
        assert as_set(result.cut.edges).isdisjoint(as_set(forbidden))
    cube, faces = surfaces.skin(np.ones((1, 1, 1), dtype=bool))
    net = cdcp_igl.surface_map(cube, faces).cut.edges
    other = cdcp_igl.surface_map(cube, faces, forbidden=net[:1])
    assert tuple(net[0]) not in as_set(other.cut.edges)
    assert other.distortion.max < 1e-6


def test_forbidden_edges_that_leave_no_way():
    V, F = surfaces.torus(n=12, k=8)
    ring = edges_of(F)[np.diff(edges_of(F) // 8, axis=1).ravel() == 1]  # between two of its circles
    with pytest.raises(cdcp_igl.MeshError, match="across forbidden edges") as error:
        cdcp_igl.surface_map(V, F, forbidden=ring)
    assert error.value.defect == "no way for a cut"
    with pytest.raises(cdcp_igl.MeshError, match="across forbidden edges"):
        cdcp_igl.surface_map(*surfaces.sphere(), forbidden=edges_of(surfaces.sphere()[1]))


@pytest.mark.parametrize("name", ["seams", "forbidden"])
@pytest.mark.parametrize(
    ("edges", "kind", "says"),
    [
        ([[0, 1], [1, 99999]], cdcp_igl.MeshError, "1 of 2 pairs of {} are no edge"),
        ([[-1, 0]], cdcp_igl.MeshError, "1 of 1 pairs of {} are no edge"),
        ([[3, 3]], cdcp_igl.MeshError, "no edge"),
        ([0, 1], ValueError, "{} must be edges"),
        ([[0, 1, 2]], ValueError, "{} must be edges"),
        ([[0.0, 1.0]], ValueError, "{} must be edges"),
        ([[0], [1, 2]], ValueError, "{} must be an array of numbers"),
        ("cut", ValueError, "{} must be"),
        (3, ValueError, "{} must be edges"),
    ],
)
def test_what_is_no_edge_is_said(name, edges, kind, says):
    V, F = surfaces.sphere()
    with pytest.raises(kind, match=says.format(name)):
        cdcp_igl.surface_map(V, F, **{name: edges})


def test_what_else_is_wrong_with_seams_is_said(tmp_path):
    V, F = surfaces.sphere()
    for options, says in (
        ({"seams": edges_of(F)[:2], "forbidden": edges_of(F)[1:4]}, "1 edge is in seams and in"),
        ({"seams": "uv"}, "those of a file"),
        ({"seams": np.zeros((3, 3, 2))}, "coordinates of 3 faces; F has"),
    ):
        with pytest.raises(ValueError, match=says):
            cdcp_igl.surface_map(V, F, **options)
    np.savez(tmp_path / "sphere.npz", V=V, F=F)
    (tmp_path / "edges.txt").write_text("0 1 2")
    for option in (["--seams", tmp_path / "edges.txt"], ["--seams", "uv"], ["--clean"]):
        more = ["--seams", "keep"] if option == ["--clean"] else []
        done = invoke("map", "--cut", *option, *more, tmp_path / "sphere.npz", tmp_path / "o.npz")
        assert done.exit_code == 2, done.output


@settings(max_examples=6, deadline=None)
@given(surfaces.random_voxels(2), st.integers(0, 1000), st.floats(0, 1), st.floats(0, 1))
def test_any_edges_are_cut_or_left_whole(mesh, seed, share, part):
    V, F = mesh
    edges, random = edges_of(F), np.random.default_rng(seed)
    some = random.random(len(edges)) < share
    is_seam = random.random(len(edges)) < part
    seams, forbidden = edges[some & is_seam], edges[some & ~is_seam]
    try:
        result = cdcp_igl.surface_map(V, F, seams=seams, forbidden=forbidden)
    except cdcp_igl.MeshError as error:
        if error.defect != "no way for a cut":
            raise
        return
    assert result.valid
    surfaces.assert_glues_back(result.cut, V, F)
    assert as_set(result.added) == as_set(result.cut.edges) - as_set(seams)
    if not any(change.startswith("split off") for change in result.changes):
        assert as_set(result.cut.edges).isdisjoint(as_set(forbidden))
