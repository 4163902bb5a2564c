"""Cutting surfaces of any kind open, around their polygons: exact, and along good paths."""

import json
import re
from itertools import chain, pairwise

import meshes
import numpy as np
import pytest
import surfaces
from batches import batch
from commands import invoke
from hypothesis import given, settings
from hypothesis import strategies as st
from test_io import ply_header
from test_io_texture import corner_places, corner_set

import cdcp_igl
from cdcp_igl.atlas.cut_graph import Component, OpenedComponent, cut_to_disk
from cdcp_igl.atlas.cut_paths import open_to_disk, straight_path, straighten
from cdcp_igl.io import read_polygons, write_map
from cdcp_igl.io.polygons import triangles_of
from cdcp_igl.surface.sheets import fans_of_sheets
from cdcp_igl.surface.topology import Topology

RANDOM = surfaces.random_voxels(5)


def assert_disks(F, n, V, given):
    """Each component of the given sheets is one disk now, and nothing else touches it."""
    surface = Topology(F, n)
    assert surface.is_manifold
    count, part = surface.components
    size, fan = fans_of_sheets(np.asarray(V, float), np.asarray(given))
    assert count == Topology(fan.reshape(3, -1).T, size).components[0]
    for k in range(count):
        used, G = np.unique(F[part == k], return_inverse=True)
        component = Topology(G.reshape(-1, 3), len(used))
        assert component.euler_characteristic == 1
        assert len(component.loops) == 1


def assert_cut(cut, V, F):
    surfaces.assert_glues_back(cut, V, F)
    assert_disks(cut.F, len(cut.V), V, F)


@settings(max_examples=40)
@given(RANDOM)
def test_every_component_becomes_a_disk_and_glues_back(mesh):
    V, F = mesh
    cut = cdcp_igl.cut(V, F)
    assert_cut(cut, V, F)
    np.testing.assert_array_equal(cut.V[: len(V)], V)
    np.testing.assert_array_equal(np.unique(cut.F), np.arange(len(cut.V)))
    # Glued along its cut edges and nowhere else it is the surface again.
    np.testing.assert_array_equal(open_edges(F, cut.F), cut.edges)
    lengths = np.linalg.norm(V[cut.edges[:, 0]] - V[cut.edges[:, 1]], axis=1)
    assert cut.length == pytest.approx(lengths.sum())


def open_edges(F, F_cut, polygon_of_face=None):
    """Edges that several faces (of one polygon) share, not all with the same ends in F_cut."""
    polygons = np.zeros(len(F), int) if polygon_of_face is None else polygon_of_face
    ends = {}
    for face, opened, polygon in zip(F.tolist(), F_cut.tolist(), polygons.tolist(), strict=True):
        for k in range(3):
            i, j = sorted((k, (k + 1) % 3), key=lambda c, face=face: face[c])
            copies = ends.setdefault((polygon, face[i], face[j]), set())
            copies.add((opened[i], opened[j]))
    edges = sorted(edge for _, *edge in (key for key in ends if len(ends[key]) > 1))
    return np.array(edges, dtype=np.int64).reshape(-1, 2)


@settings(max_examples=50)
@given(st.integers(0, 10_000))
def test_sheets_part_into_a_manifold_however_they_meet(seed):
    rng = np.random.default_rng(seed)
    n, m = rng.integers(3, 9), rng.integers(1, 26)
    V, F = rng.random((n, 3)), [rng.permutation(n)[:3] for _ in range(m)]
    cut = cdcp_igl.cut(V, F, path=[])
    surfaces.assert_glues_back(cut, V, F)
    assert Topology(cut.F, len(cut.V)).is_manifold


@settings(max_examples=5)
@given(RANDOM, st.sampled_from([2.0**-600, 1024.0, 2.0**600]))
def test_the_unit_does_not_change_what_is_cut(mesh, scale):
    V, F = mesh
    cut, scaled = cdcp_igl.cut(V, F), cdcp_igl.cut(scale * V, F)
    np.testing.assert_array_equal(scaled.F, cut.F)
    assert scaled.length == scale * cut.length


def test_a_torus_is_cut_along_its_two_shortest_loops():
    V, F = surfaces.torus(n=30, k=10)
    cut = cdcp_igl.cut(V, F)
    meridian = sum(np.linalg.norm(V[j] - V[(j + 1) % 10]) for j in range(10))
    inner = V[5::10]
    assert cut.length == pytest.approx(
        meridian + np.linalg.norm(inner - np.roll(inner, 1, axis=0), axis=1).sum(), rel=0.1
    )


def component(V, F):
    anywhere = np.zeros(F.shape, dtype=bool)
    return Component(V, F, polygon=np.arange(len(F)), rows=np.arange(len(F)), forbidden=anywhere)


def test_a_tube_is_cut_along_a_straight_line():
    """One of many shortest paths, most of which go to and fro."""
    tube = component(*surfaces.tube())
    opened = open_to_disk(tube)
    assert len(opened.cut_edges) == 23
    # The two ends have corners of pi in place of a straight boundary, the others nothing.
    assert opened.bend < tube.uncut.bend + 2 * np.pi + 0.1


def test_the_first_cut_of_a_closed_surface_has_no_loose_end(real_mesh):
    """Where the shortest paths begin, one edge would be left over."""
    V, F = real_mesh("any/handles_kitten_10000")
    kitten = component(np.asarray(V, float), np.asarray(F, np.int64))
    edges = cut_to_disk(kitten).cut_edges
    _, visits = np.unique([kitten.tail[edges], kitten.head[edges]], return_counts=True)
    assert visits.min() > 1


def test_a_long_sphere_is_cut_from_tip_to_tip():
    V, F = surfaces.sphere(rings=20, stretch=3)
    edges = cdcp_igl.cut(V, F).edges
    ends, count = np.unique(edges, return_counts=True)
    np.testing.assert_allclose(np.sort(V[ends[count == 1], 2]), [-3, 3], atol=0.1)


@settings(max_examples=20)
@given(st.integers(0, 10_000))
def test_straightening_lowers_what_a_flat_map_has_to_bend(seed):
    V, F = surfaces.voxels(seed, size=3, share=0.6)
    sheets = Topology(F, len(V))
    if not sheets.is_manifold or sheets.components[0] > 1 or sheets.genus == 0:
        V, F = surfaces.torus()
    first = cut_to_disk(component(V, F))
    opened = straighten(first)
    before, after = (o.bend + o.component.length[o.cut_edges].sum() for o in (first, opened))
    assert after <= before
    assert_disks(opened.F, opened.n, V, F)


def test_an_arc_is_laid_anew_by_the_faces_near_it(monkeypatch):
    """Of a bar with forty holes."""
    solid = np.ones((3, 81, 1), dtype=bool)
    solid[1, 1::2] = False
    bar, looked_at = component(*surfaces.skin(solid)), []
    part = OpenedComponent.part

    def counted(opened, rows):
        looked_at.append(len(rows))
        return part(opened, rows)

    monkeypatch.setattr(OpenedComponent, "part", counted)
    opened = straighten(cut_to_disk(bar))
    assert Topology(opened.F, opened.n).euler_characteristic == 1
    assert len(looked_at) > 40
    assert np.mean(looked_at) < len(bar.F) / 4


def test_the_bend_of_a_path_is_what_it_adds():
    """By the formula of the cost, for a path between two boundary vertices of a grid."""
    surface = component(*meshes.grid(10, 12))
    uncut = surface.uncut
    start, end = np.zeros((2, uncut.n), dtype=bool)
    start[5] = end[9 * 12 + 6] = True
    path = straight_path(uncut, start, end)
    opened = uncut.cut(path)

    def angle_to(ray, half):
        """Sum of the angles counterclockwise from a half-edge to another one, or the boundary."""
        total = surface.angle[half]
        while (half := surface.twin[surface.before(half)]) not in (ray, -1):
            total += surface.angle[half]
        return total

    expected = 0.0
    visits = [(surface.twin[come], on, 2 * np.pi) for come, on in pairwise(path)]
    for ray, half, flat in [(-1, path[0], np.pi), *visits, (-1, surface.twin[path[-1]], np.pi)]:
        left, around = angle_to(ray, half), uncut.angle_sum[surface.tail[half]]
        expected += abs(left - np.pi) + abs(around - left - np.pi) - abs(around - flat)
    assert opened.bend - uncut.bend == pytest.approx(expected)
    assert Topology(opened.F, opened.n).euler_characteristic == 2


# -- a path that is given --------------------------------------------------------------


def test_a_given_path_is_used_as_it_is():
    V, F = surfaces.torus(n=12, k=8)
    around = [*range(8), 0]
    cut = cdcp_igl.cut(V, F, path=around)
    np.testing.assert_array_equal(cut.edges, sorted(sorted(edge) for edge in pairwise(around)))
    surface = Topology(cut.F, len(cut.V))
    assert surface.euler_characteristic == 0
    assert len(surface.loops) == 2
    np.testing.assert_array_equal(cdcp_igl.cut(V, F, path=cut.edges).F, cut.F)
    for path in ([], np.zeros((0, 2), int)):
        np.testing.assert_array_equal(cdcp_igl.cut(V, F, path=path).F, F)


@pytest.mark.parametrize(
    ("path", "wrong"),
    [([0, 1, 3], [1, 3]), ([0, 96], [0, 96]), ([[-1, 0], [0, 1]], [-1, 0])],
)
def test_a_path_off_the_edges_is_refused_by_its_steps(path, wrong):
    with pytest.raises(cdcp_igl.MeshError) as raised:
        cdcp_igl.cut(*surfaces.torus(n=12, k=8), path=path)
    assert raised.value.defect == "not an edge"
    np.testing.assert_array_equal(raised.value.indices, [wrong])


def test_a_moebius_strip_can_be_cut_across():
    _, V, F, _ = meshes.NASTY["Moebius strip"]
    with pytest.raises(cdcp_igl.MeshError, match=r"cdcp_igl\.cut\(V, F, path\)"):
        cdcp_igl.cut(V, F)
    assert cdcp_igl.surface_map(*cdcp_igl.cut(V, F, path=[0, 9])[:2], merge=False).valid


# -- surfaces of polygons --------------------------------------------------------------


def quads(F):
    """Of surfaces whose second half of faces are the other halves of quads."""
    k = len(F) // 2
    return np.column_stack([F[:k], F[k:, 2]])


def quads_of_voxels(seed, size, share):
    """Of random genus, in parts, with edges of four quads."""
    V, F = surfaces.voxels(seed, size, share)
    return V, quads(F).tolist()


def torus_with_holes(n, k, seed, holes):
    """Quads, some of which are missing."""
    V, F = surfaces.torus(n, k)
    missing = np.random.default_rng(seed).permutation(n * k)[:holes]
    return V, np.delete(quads(F), missing, axis=0).tolist()


def many_corners(n, k, seed, twist):
    """The duals of a torus, hexagons, and of a sphere: with two polygons of k corners."""
    V, F = surfaces.torus(n, k) if twist else surfaces.sphere(n, k)
    V = V + np.random.default_rng(seed).normal(0, 0.02, V.shape)
    return surfaces.dual(V, F)


SEED = st.integers(0, 10_000)
POLYGONS = st.one_of(
    st.builds(quads_of_voxels, SEED, st.integers(1, 4), st.floats(0.2, 0.9)),
    st.builds(torus_with_holes, st.integers(4, 12), st.integers(4, 8), SEED, st.integers(0, 6)),
    st.builds(many_corners, st.integers(3, 10), st.integers(4, 9), SEED, st.booleans()),
)


def triangles(V, polygons):
    return triangles_of(V, list(chain(*polygons)), [len(polygon) for polygon in polygons])


# -- cut around them -------------------------------------------------------------------


@settings(max_examples=50)
@given(POLYGONS)
def test_no_polygon_is_parted_and_every_component_becomes_a_disk(mesh):
    V, polygons = mesh
    F, whole = triangles(V, polygons)
    cut = cdcp_igl.cut(V, F, polygon_of_face=whole)
    assert len(open_edges(F, cut.F, whole)) == 0
    assert_cut(cut, V, F)


@settings(max_examples=4)
@given(POLYGONS, st.booleans())
def test_nor_is_one_parted_by_a_map(mesh, fill):
    """Whose cut grows."""
    V, polygons = mesh
    F, whole = triangles(V, polygons)
    result = cdcp_igl.surface_map(V, F, polygon_of_face=whole, fill=fill, scale_variation=0.7)
    assert result.valid
    assert len(open_edges(F, result.cut.F, whole)) == 0


def test_without_their_numbers_polygons_are_parted():
    """Or the tests above could not fail."""
    V, polygons = many_corners(8, 8, 0, twist=True)
    F, whole = triangles(V, polygons)
    assert len(open_edges(F, cdcp_igl.cut(V, F).F, whole)) > 0


@settings(max_examples=25)
@given(SEED, st.integers(1, 30))
def test_any_numbers_make_disks(seed, most):
    """Also where no polygon is one: sets of faces with vertices, holes and handles inside."""
    V, F = surfaces.voxels(seed, size=3)
    whole = np.random.default_rng(seed).integers(-most, most, len(F))
    assert_cut(cdcp_igl.cut(V, F, polygon_of_face=whole), V, F)


# -- there and back --------------------------------------------------------------------


def write_scene(path, V, polygons):
    """An obj file with colours, normals, two materials, groups and comments."""
    lines = ["# two materials", "mtllib scene.mtl", "o thing"]
    lines += [f"v {x!r} {y!r} {z!r} {k % 3 / 2} 0.5 1" for k, (x, y, z) in enumerate(V.tolist())]
    lines += ["vn 0 0 1", "vn 0 1.0 0", ""]
    half = len(polygons) // 2
    for k, polygon in enumerate(polygons):
        if k in (0, half):
            lines += [f"g part {k}", f"usemtl {'red' if k else 'blue'}", "s 1"]
        lines.append("f " + " ".join(f"{v + 1}//{k % 2 + 1}" for v in polygon))
    path.write_text("\n".join([*lines, "# end", ""]))


def assert_only_texture_was_added(given, written):
    """Line by line; texture coordinates come before the first face, and in its corners."""
    new = re.sub(r"(?<=\d)/\d+/", "//", re.sub("vt .*\n", "", written.read_text()))
    assert new == given.read_text()


SCENES = {
    "cube": lambda: quads_of_voxels(0, 1, 1.0),
    "blocks": lambda: quads_of_voxels(5, 3, 0.5),
    "torus": lambda: torus_with_holes(12, 8, 0, 0),
    "torn torus": lambda: torus_with_holes(12, 8, 3, 5),
    "hexagons": lambda: many_corners(8, 8, 0, twist=True),
    "two large polygons": lambda: many_corners(8, 9, 0, twist=False),
}


@pytest.mark.parametrize("name", SCENES)
def test_nothing_but_texture_coordinates_is_added(name, tmp_path):
    given, out = tmp_path / "given.obj", tmp_path / "out.obj"
    write_scene(given, *SCENES[name]())
    V, F, polygon_of_face = read_polygons(given)
    result = cdcp_igl.surface_map(V, F, polygon_of_face=polygon_of_face)
    write_map(out, V, F, result, like=given)
    assert_only_texture_was_added(given, out)
    assert corner_set(*corner_places(out)[:2]) == corner_set(V[F], result.packed())
    assert batch([given], tmp_path / "maps", cut=True, format="obj").failed == ()
    assert (tmp_path / "maps" / "given.obj").read_text() == out.read_text()


def test_polygons_on_no_disk_stay(tmp_path):
    """One that repeats another has its texture; one with a corner of its own has none."""
    V, polygons = SCENES["torus"]()
    given, out = tmp_path / "given.obj", tmp_path / "out.obj"
    own = len(V)
    write_scene(given, np.vstack([V, [9, 9, 9]]), [*polygons, polygons[7], [0, own, 0]])
    run = invoke("map", given, out, "--cut")
    assert run.exit_code == 0, run.output
    assert "left out 2 faces that repeated another" in run.output
    assert_only_texture_was_added(given, out)
    faces = [line for line in out.read_text().splitlines() if line.startswith("f ")]
    textured = [bool(re.search(r"\d/\d", face)) for face in faces]
    assert textured == [True] * (len(polygons) + 1) + [False]


@pytest.mark.parametrize("suffix", ["obj", "off", "ply", "npz"])
def test_polygons_are_read_from_files(tmp_path, suffix):
    V, polygons = SCENES["two large polygons"]()
    F, polygon_of_face = triangles(V, polygons)
    path = tmp_path / f"a.{suffix}"
    faces = "".join(f"{len(p)} {' '.join(map(str, p))}\n" for p in polygons)
    rows = "".join(f"{x!r} {y!r} {z!r}\n" for x, y, z in V.tolist())
    header = ply_header("ascii", len(V), len(polygons), "double")
    if suffix == "obj":
        write_scene(path, V, polygons)
    elif suffix == "npz":
        np.savez(path, V=V, F=F)
        polygon_of_face = np.arange(len(F))
    else:
        start = f"OFF\n{len(V)} {len(polygons)} 0\n" if suffix == "off" else header
        path.write_text(start + rows + faces)
    for array, other in zip(read_polygons(path), (V, F, polygon_of_face), strict=True):
        np.testing.assert_array_equal(array, other)


def test_defects_of_faces_name_the_polygons_of_the_file(tmp_path):
    V, F = meshes.grid()
    polygons = quads(F).tolist()
    polygons[7] = polygons[7][::-1]
    path = tmp_path / "quads.obj"
    write_scene(path, V, polygons)
    said = "2 faces are oriented unlike the others (polygons 7)"
    out = "--force", tmp_path / "out.obj"
    for command, *rest in (["check"], ["map", *out], ["compare", "--methods", "lscm"]):
        run = invoke(command, path, *rest)
        assert run.exit_code == 2
        assert said in " ".join(run.output.split())
    [defect] = json.loads(invoke("check", "--json", path).stdout)[0]["defects"]
    assert (defect["of"], defect["indices"]) == ("polygons", [7, 7])
