"""Meshes of quads and other polygons: cut around them, and given back as they were."""

import json
import re
from itertools import chain

import meshes
import numpy as np
import pytest
import surfaces
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from test_cutting import assert_disks, open_edges
from test_io import ply_header
from typer.testing import CliRunner

import cdcp_igl
from cdcp_igl.batching import batch
from cdcp_igl.command_line.program import app
from cdcp_igl.io import read_polygons, write_map
from cdcp_igl.io.polygons import fans

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


def triangles(polygons):
    return fans(list(chain(*polygons)), [len(polygon) for polygon in polygons])


# -- cut around them -------------------------------------------------------------------


@settings(max_examples=50)
@given(POLYGONS)
def test_no_polygon_is_parted_and_every_component_becomes_a_disk(mesh):
    V, polygons = mesh
    F, whole = triangles(polygons)
    cut = cdcp_igl.cut(V, F, polygon_of_face=whole)
    assert len(open_edges(F, cut.F, whole)) == 0
    np.testing.assert_array_equal(cut.vertex_index[cut.F], F)
    assert_disks(cut.F, len(cut.V), F)


@settings(max_examples=4)
@given(POLYGONS, st.booleans())
def test_nor_is_one_parted_by_a_map(mesh, fill):
    """Whose cut grows."""
    V, polygons = mesh
    F, whole = triangles(polygons)
    result = cdcp_igl.surface_map(V, F, polygon_of_face=whole, fill=fill, spread=0.7)
    assert result.valid
    assert len(open_edges(F, result.cut.F, whole)) == 0


def test_without_their_numbers_polygons_are_parted():
    """Or the tests above could not fail."""
    V, polygons = many_corners(8, 8, 0, twist=True)
    F, whole = triangles(polygons)
    assert len(open_edges(F, cdcp_igl.cut(V, F).F, whole)) > 0


@settings(max_examples=25)
@given(SEED, st.integers(1, 30))
def test_any_numbers_make_disks(seed, most):
    """Also where no polygon is one: sets of faces with vertices, holes and handles inside."""
    V, F = surfaces.voxels(seed, size=3)
    whole = np.random.default_rng(seed).integers(-most, most, len(F))
    cut = cdcp_igl.cut(V, F, polygon_of_face=whole)
    np.testing.assert_array_equal(cut.vertex_index[cut.F], F)
    assert_disks(cut.F, len(cut.V), F)


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


def texture_at_corners(path):
    """The corners of all triangles, of all materials, by another reader."""
    scene = trimesh.load(path, process=False)
    corners = [
        np.dstack([part.vertices[part.faces], part.visual.uv[part.faces]]).reshape(-1, 5)
        for part in scene.geometry.values()
    ]
    assert len(corners) == 2
    return {tuple(corner) for corner in np.concatenate(corners).tolist()}


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
    expected = np.dstack([V[F], result.packed()]).reshape(-1, 5).tolist()
    assert texture_at_corners(out) == {tuple(corner) for corner in expected}


def test_nor_by_a_batch(tmp_path):
    given = tmp_path / "given.obj"
    write_scene(given, *SCENES["hexagons"]())
    made = batch([given], tmp_path / "maps", cut=True, format="obj")
    assert made.failed == ()
    assert_only_texture_was_added(given, tmp_path / "maps" / "given.obj")


def test_polygons_on_no_disk_stay(tmp_path):
    """One that repeats another has its texture; one with a corner of its own has none."""
    V, polygons = SCENES["torus"]()
    given, out = tmp_path / "given.obj", tmp_path / "out.obj"
    own = len(V)
    write_scene(given, np.vstack([V, [9, 9, 9]]), [*polygons, polygons[7], [0, own, 0]])
    run = CliRunner().invoke(app, ["map", str(given), str(out), "--cut"])
    assert run.exit_code == 0, run.output
    assert "left out 2 faces that repeated another" in run.output
    assert_only_texture_was_added(given, out)
    faces = [line for line in out.read_text().splitlines() if line.startswith("f ")]
    textured = [bool(re.search(r"\d/\d", face)) for face in faces]
    assert textured == [True] * (len(polygons) + 1) + [False]


@pytest.mark.parametrize("suffix", ["obj", "off", "ply", "npz"])
def test_polygons_are_read_from_files(tmp_path, suffix):
    V, polygons = SCENES["two large polygons"]()
    F, polygon_of_face = triangles(polygons)
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
    out = str(tmp_path / "out.obj")
    for command in (["check"], ["map", "--force"], ["compare", "--methods", "lscm"]):
        arguments = [str(path), out] if "map" in command else [str(path)]
        run = CliRunner().invoke(app, [*command, *arguments])
        assert run.exit_code == 2
        assert said in " ".join(run.output.split())
    run = CliRunner().invoke(app, ["check", "--json", str(path)])
    [defect] = json.loads(run.stdout)[0]["defects"]
    assert (defect["of"], defect["indices"]) == ("polygons", [7, 7])
