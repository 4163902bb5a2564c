"""Maps in files that other programs open: obj with all it had, glb, corners of their own."""

import re
import struct

import numpy as np
import pygltflib
import pytest
import surfaces
import trimesh
from batches import batch
from commands import invoke
from PIL import Image

from cdcp_igl import MeshError, datasets, disk_map, sphere_map, submesh, surface_map
from cdcp_igl.io import read_mesh, write_map
from cdcp_igl.io.painted import colours_at, images_of

SCENE = """\
# made by hand, in a hurry
mtllib scene.mtl
o Stra\xdfe
v 0 0 0 1 0 0
v  1.0 0 0  0 1 0
v 1 1 0 0 0 1
v 0 1 0 1 1 1 # the last of the square
vn 0 0 1
vt 0.5 0.5
v 2 0 0.25 1 0 0
v 2 1 0.25 1 0 0
v 3 0.5 0 1 0 0

g left quads
usemtl red
s 1
f 1/1/1  2//1 3 4 # a quad
usemtl blue
f -6//1 -3/1 \\
  -2 3
g tip
f 5 7/1/1 6
l 1/1 2/1 3
"""
HEAD = SCENE[: SCENE.index("f 1/1/1")]
FACES_WITH_TEXTURE = """\
f 1/1/1  2/2/1 3/3 4/4 # a quad
usemtl blue
f -6/2/1 -3/5 \\
  -2/6 3/3
g tip
f 5/5 7/7/1 6/6
l 1 2 3
"""


def scene(tmp_path, newline="\n", text=SCENE):
    path = tmp_path / "scene.obj"
    path.write_text(text, encoding="latin-1", newline=newline)
    return path, *read_mesh(path)


def corner_places(path):
    """(m, 3, 3) positions and (m, 3, 2) texture coordinates, by another reader."""
    mesh = trimesh.load(path, process=False)
    mesh = mesh.to_mesh() if isinstance(mesh, trimesh.Scene) else mesh
    return mesh.vertices[mesh.faces], mesh.visual.uv[mesh.faces], mesh


def corner_set(places, texture):
    return {tuple(corner) for corner in np.dstack([places, texture]).reshape(-1, 5).tolist()}


# The same for trimesh, which knows no comments after numbers, and corners of one kind only.
PLAIN = HEAD.replace(" # the last of the square", "")
PLAIN += "f 1//1 2//1 3//1 4//1\nusemtl blue\nf 2//1 5//1 6//1 3//1\ng tip\nf 5//1 7//1 6//1\n"


# -- obj files that came in --------------------------------------------------------------


@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_nothing_but_texture_coordinates_is_added(tmp_path, newline):
    given, V, F = scene(tmp_path, newline)
    uv = disk_map(V, F)
    write_map(tmp_path / "out.obj", V, F, uv, disk=True, like=given)
    texture = "".join(f"vt {u!r} {v!r}\n" for u, v in uv.uv.tolist())
    expected = HEAD.replace("vt 0.5 0.5\n", "") + texture + FACES_WITH_TEXTURE
    written = (tmp_path / "out.obj").read_bytes()
    assert written == expected.replace("\n", newline).encode("latin-1")
    for array, again in zip((V, F), read_mesh(tmp_path / "out.obj"), strict=True):
        np.testing.assert_array_equal(array, again)


@pytest.mark.parametrize("corners", [[0, 1, 2], [0], [1]])
def test_a_quad_that_is_cut_within_becomes_triangles(tmp_path, corners):
    given, V, F = scene(tmp_path, text=PLAIN)
    uv = V[F][:, :, :2] / 4
    uv[1, corners] += 0.5
    write_map(tmp_path / "out.obj", V, F, uv, disk=True, like=given)
    lines = (tmp_path / "out.obj").read_text("latin-1").splitlines()
    faces = [line for line in lines if line.startswith("f ")]
    assert [len(line.split()) - 1 for line in faces] == [3, 3, 4, 3]
    np.testing.assert_array_equal(read_mesh(tmp_path / "out.obj")[1], F)
    places, texture, _ = corner_places(tmp_path / "out.obj")
    assert corner_set(places, texture) == corner_set(V[F], uv)


def test_like_must_be_the_mesh(tmp_path):
    given, V, F = scene(tmp_path)
    out = tmp_path / "out.obj"
    for other in ((V + 1, F), (V, F[::-1]), (V, F[1:])):
        with pytest.raises(ValueError, match="another mesh"):
            write_map(out, *other, np.zeros((len(V), 2)), like=given)
    assert not out.exists()


# -- a map for each corner ---------------------------------------------------------------


@pytest.fixture(scope="module")
def cut_open():
    """A cap, its faces to the right of x = 0 moved aside in the plane."""
    V, F, _ = datasets.spherical_cap(4)
    uv = disk_map(V, F).uv[F] / 2
    uv[V[F].mean(axis=1)[:, 0] > 0] += [0.5, 0.0]
    return V, F, uv


@pytest.mark.parametrize("suffix", ["obj", "glb"])
def test_corners_arrive_in_another_reader(tmp_path, suffix, cut_open):
    V, F, uv = cut_open
    path = tmp_path / f"a.{suffix}"
    write_map(path, V, F, uv, disk=True)
    places, texture, mesh = corner_places(path)
    exact = 0 if suffix == "obj" else 1e-7
    np.testing.assert_allclose(places, V[F], rtol=0, atol=exact)
    np.testing.assert_allclose(texture, uv, rtol=0, atol=exact)
    # Each pair of a vertex and its texture coordinates is written once.
    pairs = np.unique(np.dstack([V[F], uv]).reshape(-1, 5), axis=0)
    assert len(V) < len(mesh.visual.uv) == len(pairs) < F.size


def test_corners_in_ply_and_npz(tmp_path, cut_open):
    V, F, uv = cut_open
    write_map(tmp_path / "a.npz", V, F, uv)
    np.testing.assert_array_equal(np.load(tmp_path / "a.npz")["uv"], uv)
    write_map(tmp_path / "a.ply", V, F, uv, disk=True)
    for array, again in zip((V, F), read_mesh(tmp_path / "a.ply"), strict=True):
        np.testing.assert_array_equal(array, again)
    with (tmp_path / "a.ply").open("rb") as file:
        faces = trimesh.exchange.ply.load_ply(file)["metadata"]["_ply_raw"]["face"]["data"]
    np.testing.assert_array_equal(faces["texcoord"]["f1"].reshape(uv.shape), uv)


@pytest.mark.parametrize("like", [False, True])
def test_faces_on_no_disk(tmp_path, like):
    """In an obj file they have no texture coordinates, and the others keep theirs."""
    given, V, F = scene(tmp_path)
    uv = (V[F][:, :, :2] - [1, 1]) / 4  # zeros where the two quads meet
    uv[[0, 1, 4]] = np.nan  # the first quad and the tip
    path = tmp_path / "out.obj"
    write_map(path, V, F, uv, disk=True, like=given if like else None)
    lines = path.read_text("latin-1").splitlines()
    faces = [line.partition("#")[0] for line in lines if line.startswith(("f ", "  -2"))]
    with_texture = [re.search(r"\d/\d", line) is not None for line in faces]
    assert with_texture == (
        [False, True, True, False] if like else [False, False, True, True, False]
    )
    if like:
        assert faces[0] == "f 1//1  2//1 3 4 "
    assert sum(line.startswith("vt ") for line in lines) == 4
    np.testing.assert_array_equal(read_mesh(path)[1], F)
    for suffix in ("glb", "ply", "npz"):
        write_map(tmp_path / f"a.{suffix}", V, F, uv, disk=True)
    texture = corner_places(tmp_path / "a.glb")[1]
    np.testing.assert_allclose(texture, np.nan_to_num(uv), atol=1e-7)
    np.testing.assert_array_equal(np.load(tmp_path / "a.npz")["uv"], uv)
    uv[0, 0, 0] = 0
    with pytest.raises(ValueError, match="NaN or infinite in 1 row, the first 0"):
        write_map(path, V, F, uv)


def test_a_result_with_faces_on_no_disk(tmp_path):
    """Where one of its corners is nowhere, a face is on none, with all of them."""
    V, F = surfaces.torus()
    V, F = np.vstack([V, V[F[5, :2]].mean(axis=0)]), np.vstack([F, [*F[5, [1, 0]], len(V)]])
    result = surface_map(V, F)
    assert np.isnan(result.uv[-1]).all()
    for disk in (False, True):
        for suffix in ("obj", "ply", "glb", "npz"):
            write_map(tmp_path / f"a.{suffix}", V, F, result, disk=disk)
        uv = np.load(tmp_path / "a.npz")["uv"]
        np.testing.assert_array_equal(uv[:-1], result.uv[:-1])
        assert np.isnan(uv[-1]).all()
        last = (tmp_path / "a.obj").read_text().splitlines()[-1]
        assert last == "f {} {} {}".format(*F[-1] + 1)


# -- glb and images ----------------------------------------------------------------------


@pytest.fixture(scope="module")
def cap():
    V, F, _ = datasets.spherical_cap(6)
    return V, F, disk_map(V, F)


def test_glb_in_two_other_readers(tmp_path, cap):
    V, F, result = cap
    path = tmp_path / "a.glb"
    write_map(path, V, F, result)
    places, texture, mesh = corner_places(path)
    np.testing.assert_allclose(places, V[F], rtol=0, atol=1e-7)
    np.testing.assert_allclose(texture, (result.uv[F] + 1) / 2, rtol=0, atol=1e-7)
    outwards = V / np.linalg.norm(V, axis=1, keepdims=True)  # a part of the unit sphere
    assert (np.einsum("ij,ij->i", mesh.vertex_normals, outwards) > 0.95).all()
    assert mesh.visual.material.baseColorTexture.size == (1024, 1024)

    gltf = pygltflib.GLTF2().load(path)
    positions = gltf.accessors[gltf.meshes[0].primitives[0].attributes.POSITION]
    np.testing.assert_array_equal(positions.max, V.astype("f4").max(axis=0))
    assert all(view.byteOffset % 4 == 0 for view in gltf.bufferViews)
    assert gltf.buffers[0].byteLength == len(gltf.binary_blob())
    (length,) = struct.unpack_from("<I", path.read_bytes(), 8)
    assert length == path.stat().st_size


def test_the_normals_do_not_show_the_cut(tmp_path, cut_open):
    V, F, uv = cut_open
    write_map(tmp_path / "a.glb", V, F, uv)
    gltf = pygltflib.GLTF2().load(tmp_path / "a.glb")
    blob, n = gltf.binary_blob(), gltf.accessors[0].count
    places, normals = (
        np.frombuffer(blob, "<f4", 3 * n, view.byteOffset).reshape(n, 3).tolist()
        for view in gltf.bufferViews[:2]
    )
    of_place = {}
    for place, normal in zip(places, normals, strict=True):
        assert of_place.setdefault(tuple(place), normal) == normal
    assert len(of_place) == len(V) < n


@pytest.mark.parametrize("form", ["png", "jpeg"])
def test_given_images(tmp_path, cap, form):
    picture = tmp_path / "photo.img"
    Image.new("RGB", (8, 4), (200, 30, 30)).save(picture, form)
    write_map(tmp_path / "a.glb", *cap, image=picture)
    _, _, mesh = corner_places(tmp_path / "a.glb")
    assert mesh.visual.material.baseColorTexture.size == (8, 4)
    write_map(tmp_path / "a.obj", *cap, image=picture)
    _, _, mesh = corner_places(tmp_path / "a.obj")
    assert mesh.visual.material.image.size == (8, 4)


def test_an_obj_that_shows_a_checkerboard(tmp_path, cap):
    V, F, result = cap
    path = tmp_path / "größer als 1.obj"
    write_map(path, *cap, image="checkerboard")
    places, texture, mesh = corner_places(path)
    np.testing.assert_array_equal(places, V[F])
    np.testing.assert_array_equal(texture, (result.uv[F] + 1) / 2)
    image = np.asarray(mesh.visual.material.image)
    assert image.shape == (1024, 1024, 3)
    np.testing.assert_array_equal(image[:16, 16:32], image[16:32, :16])
    assert (image[0, 0] != image[0, 16]).any()


@pytest.fixture(scope="module")
def patchwork(tmp_path_factory):
    """A ball whose halves show two images by two materials, in files of all types."""
    folder = tmp_path_factory.mktemp("patchwork")
    V, F, _ = datasets.spheroid(2)
    sphere, y = sphere_map(V, F), np.linspace(0, 1, 256)
    right, up = np.meshgrid(y, y[::-1])
    images = [np.dstack([right, up, 0 * up + k]) for k in (0, 1)]
    for name in ("ball.glb", "ball.obj"):
        write_map(folder / name, V, F, sphere, image=images[0])
    as_image = trimesh.load(folder / "ball.glb").to_mesh().visual.material.baseColorTexture
    as_image.save(folder / "ball.png")
    Image.fromarray(np.rint(255 * images[1]).astype("u1")).save(folder / "other.png")
    material = (folder / "ball.mtl").read_text()
    other = material.replace("surface", "other side").replace("ball.png", "other.png")
    (folder / "ball.mtl").write_text(f"{material}{other}bump dents.png\n")
    lines = (folder / "ball.obj").read_text().splitlines()
    half = len(lines) - len(F) // 2
    lines.insert(half, "usemtl other side")
    (folder / "ball.obj").write_text("\n".join(lines))
    return folder


@pytest.mark.parametrize("suffix", ["glb", "obj"])
def test_an_image_goes_over_to_the_new_layout(tmp_path, patchwork, suffix, caplog):
    given, out = patchwork / f"ball.{suffix}", tmp_path / f"new.{suffix}"
    assert invoke("map", given, out, "--cut", "--bake", 256).exit_code == 0
    assert caplog.messages == []
    places = []
    for path in (given, out):
        images, of_face, uv = images_of(path)
        shown = np.array([colours_at(image, uv.mean(axis=1)) for image in images])
        places.append((shown[of_face, np.arange(len(uv))], uv))
        assert len(images) == (2 if (path, suffix) == (given, "obj") else 1)
    (before, old), (after, new) = places
    assert abs(old - new).max() > 0.1
    near = abs(before - after).max(axis=1)
    assert (near < 0.02).mean() > 0.95  # beside the seam between hemispheres the image jumps
    if suffix == "obj":
        text = (tmp_path / "new.mtl").read_text()
        assert re.findall("newmtl (.*)", text) == ["surface", "other side"]
        assert (text.count("map_Kd new.png"), text.count("bump"), text.count("map_Kd")) == (2, 0, 2)
        assert out.read_text().startswith("mtllib new.mtl\n")
        assert out.read_text().count("usemtl") == 2
    batch_of_one = batch(given, tmp_path / "maps", cut=True, bake=256, format="glb")
    assert batch_of_one.failed == ()
    assert images_of(tmp_path / "maps" / "ball.glb").images[0].shape == (256, 256, 3)


def test_images_that_are_not_there(tmp_path, patchwork, cap):
    V, F, result = cap
    write_map(tmp_path / "a.obj", V, F, result)
    with pytest.raises(MeshError, match="shows no image"):
        disk_map(tmp_path / "a.obj").bake(tmp_path / "a.obj")
    for name, *options in (["b.obj", "--disk"], ["b.obj", "--clean"], ["b.npz"], ["b.obj"]):
        done = invoke("map", tmp_path / "a.obj", tmp_path / name, "--bake", 9, *options)
        assert done.exit_code == 2
    with pytest.raises(ValueError, match="glb"):
        batch(tmp_path / "a.obj", tmp_path / "maps", bake=9)
    lost = tmp_path / "lost.obj"
    lost.write_bytes((patchwork / "ball.obj").read_bytes())
    (tmp_path / "ball.mtl").write_bytes((patchwork / "ball.mtl").read_bytes())
    with pytest.raises(MeshError, match=r"its image 'ball\.png' is not beside it"):
        surface_map(lost).bake(lost)
    with pytest.raises(ValueError, match="a part of a surface has other faces"):
        disk_map(submesh(patchwork / "ball.obj", vertices=read_mesh(lost)[0][:, 0] < 0)).bake(lost)


UPRIGHT = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])  # y becomes z, as Blender has it


def test_blender_opens_what_is_written(tmp_path):
    """By its Python module: texture coordinates, places and colours of all corners, and names."""
    bpy = pytest.importorskip("bpy")
    V, F, _ = datasets.spherical_cap(3)
    colours = np.random.default_rng(2).integers(0, 256, V.shape) / 255
    lines = [
        "o helmet",
        *(
            "v {!r} {!r} {!r} {!r} {!r} {!r}".format(*row)
            for row in np.hstack([V, colours]).tolist()
        ),
    ]
    lines += ["usemtl brass", *("f {} {} {}".format(*row) for row in (F + 1).tolist())]
    (tmp_path / "given.obj").write_text("\n".join(lines))
    openers = {
        "obj": bpy.ops.wm.obj_import,
        "ply": bpy.ops.wm.ply_import,
        "glb": bpy.ops.import_scene.gltf,
    }
    for result, suffixes in ((disk_map, openers), (surface_map, ("obj", "glb"))):
        result = result(tmp_path / "given.obj")
        uv = result.packed() if result.uv.ndim == 3 else result.packed()[F]
        for suffix in suffixes:
            path = tmp_path / f"written.{suffix}"
            result.save(path)
            bpy.ops.wm.read_factory_settings(use_empty=True)
            openers[suffix](filepath=str(path))
            (thing,) = (thing for thing in bpy.data.objects if thing.type == "MESH")
            mesh = thing.data
            shown = [mesh.uv_layers.active.data[loop.index].uv[:] for loop in mesh.loops]
            np.testing.assert_allclose(np.reshape(shown, uv.shape), uv, atol=1e-6)
            at = [mesh.vertices[loop.vertex_index].co[:] for loop in mesh.loops]
            placed = np.reshape(at, (-1, 3, 3)) @ np.array(thing.matrix_world)[:3, :3].T
            np.testing.assert_allclose(
                placed, V[F] @ (np.eye(3) if suffix == "ply" else UPRIGHT), atol=1e-6
            )
            painted = mesh.color_attributes[0]
            k = [
                loop.index if painted.domain == "CORNER" else loop.vertex_index
                for loop in mesh.loops
            ]
            seen = np.reshape([painted.data[i].color_srgb[:3] for i in k], (-1, 3, 3))
            np.testing.assert_allclose(seen, colours[F], atol=0.51 / 255)
            if suffix == "obj":
                assert (thing.name, mesh.materials[0].name) == ("helmet", "brass")


# -- what is refused ---------------------------------------------------------------------


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".glb", ".npz"])
@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"V": np.nan}, "NaN"),
        ({"F": 10**6}, "outside"),
        ({"F": -1}, "outside"),
        ({"uv": np.nan}, "uv is NaN or infinite in 1 row, the first 0"),
        ({"uv": 1j}, "uv has shape"),
    ],
)
def test_what_is_no_map_is_not_written(tmp_path, cap, suffix, change, says):
    V, F, result = cap
    given = {"V": V, "F": F, "uv": result.uv.astype(np.result_type(float, *change.values()))}
    for name, value in change.items():
        given[name] = given[name].copy()
        given[name][0, 0] = value
    with pytest.raises(ValueError, match=says):
        write_map(tmp_path / f"a{suffix}", **given)
    with pytest.raises(ValueError, match="uv has shape"):
        write_map(tmp_path / f"a{suffix}", V, F, result.uv[1:])
    assert list(tmp_path.iterdir()) == []


def test_options_that_do_not_go_together(tmp_path, cap):
    V, F, result = cap
    for name, options, says in (
        ("a.ply", {"image": "checkerboard"}, "shows no image"),
        ("a.obj", {"image": __file__}, "no PNG or JPEG"),
        ("a\0.obj", {}, "holds a zero"),
    ):
        with pytest.raises(ValueError, match=says):
            write_map(tmp_path / name, V, F, result, **options)
    with pytest.raises(ValueError, match="single precision"):
        write_map(tmp_path / "a.glb", V * 1e39, F, result)
    with pytest.raises(MeshError):
        write_map(tmp_path / "a.obj", V, F, result, like=tmp_path / "a\0.obj")
    assert list(tmp_path.iterdir()) == []


def test_faces_that_single_precision_flattens_are_logged(tmp_path, cap, caplog):
    V, F, result = cap
    write_map(tmp_path / "a.glb", V, F, result)
    assert caplog.messages == []
    write_map(tmp_path / "a.glb", 1e-60 * V, F, result)
    assert caplog.messages == [
        f"{len(F)} faces have no area in single precision: scale the surface"
    ]


@pytest.mark.parametrize("away", [1e5, 1e6, 1e7])
def test_far_from_the_origin_a_glb_is_as_exact_as_near_it(tmp_path, cap, caplog, away):
    """A terrain in metres of a national grid."""
    V, F, result = cap
    V = [100, 100, 10] * V + [0.4 * away, away, 300]
    write_map(tmp_path / "a.glb", V, F, result)
    again, faces = read_mesh(tmp_path / "a.glb")
    np.testing.assert_array_equal(faces, F)
    np.testing.assert_allclose(again, V, rtol=0, atol=200 * 2**-24)
    assert caplog.messages == []
