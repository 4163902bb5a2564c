"""Files that are written again keep what they have: scenes of glTF, and ply files."""

import base64
import json
import struct
from itertools import chain

import numpy as np
import pytest
import trimesh
from commands import invoke

from cdcp_igl import MeshError, datasets, disk_map, submesh, surface_map
from cdcp_igl.io import read_mesh, read_texture, write_map
from cdcp_igl.io.images import checkerboard

KINDS = {5121: "u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
COLUMNS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
PIXEL = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNkYPhfDwAChwGA60e6kgAAAABJRU5ErkJggg=="
)


def doll():
    """A cube of two primitives, mirrored in a second node, and a strip: JSON and binary part."""
    random, scene, body = np.random.default_rng(1), {"accessors": [], "bufferViews": []}, b""

    def view(data, **more):
        nonlocal body
        scene["bufferViews"].append({"buffer": 0, "byteOffset": len(body), "byteLength": len(data)})
        scene["bufferViews"][-1] |= more
        body += data + bytes(-len(data) % 4)
        return len(scene["bufferViews"]) - 1

    def accessor(array, kind, component, **more):
        entry = {"bufferView": view(array.astype(KINDS[component]).tobytes())}
        entry |= {"componentType": component, "count": len(array), "type": kind}
        scene["accessors"].append(entry | more)
        return len(scene["accessors"]) - 1

    def attributes(V):
        n = len(V)
        box = {"min": V.min(axis=0).tolist(), "max": V.max(axis=0).tolist()}
        colour = view(random.bytes(4 * n), byteStride=4)  # of which three bytes are colours
        scene["accessors"].append({"bufferView": colour, "byteOffset": 1, "componentType": 5121})
        scene["accessors"][-1] |= {"normalized": True, "count": n, "type": "VEC3", "name": "dye"}
        return {
            "COLOR_0": len(scene["accessors"]) - 1,
            "POSITION": accessor(V, "VEC3", 5126, **box),
            "JOINTS_0": accessor(random.integers(0, 2, (n, 4)), "VEC4", 5121),
            "WEIGHTS_0": accessor(random.dirichlet(np.ones(4), n), "VEC4", 5126),
            "TEXCOORD_0": accessor(random.random((n, 2)), "VEC2", 5126),
            "TEXCOORD_1": accessor(random.random((n, 2)), "VEC2", 5126),
        }

    cube = np.array(list(np.ndindex(2, 2, 2)), float)
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    F = np.array(quads)[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    values = view(random.random((2, 3)).astype("<f4").tobytes())
    scene["accessors"].append({"componentType": 5126, "count": 8, "type": "VEC3"})
    scene["accessors"][0]["sparse"] = {
        "count": 2,
        "indices": {"bufferView": view(bytes([1, 6])), "componentType": 5121},
        "values": {"bufferView": values},
    }
    shared = attributes(cube)
    pair = [
        {
            "attributes": dict(shared),
            "indices": accessor(part.ravel(), "SCALAR", 5121),
            "targets": [{"POSITION": 0}],
            "material": k,
        }
        for k, part in enumerate((F[:6], F[6:]))
    ]
    grid = np.column_stack([np.arange(6) // 2, np.arange(6) % 2, np.arange(6) ** 2 / 9])
    strip = {"attributes": attributes(grid), "mode": 5, "extras": {"felt": True}}
    matrices = accessor(np.tile(np.eye(4).ravel(), (2, 1)), "MAT4", 5126)
    times = accessor(np.array([0, 1]), "SCALAR", 5126, min=[0], max=[1])
    turns = accessor(np.array([[0, 0, 0, 1], [0, 1, 0, 0]]), "VEC4", 5126)
    image = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}, "name": "leather"}
    return scene | {
        "asset": {"version": "2.0", "generator": "by hand", "extras": {"who": "a test"}},
        "scene": 0,
        "scenes": [{"nodes": [0, 1, 2, 3]}],
        "nodes": [
            {"mesh": 0, "skin": 0, "name": "body"},
            {"mesh": 0, "scale": [-1, 1, 1], "translation": [-3, 0, 0], "name": "its image"},
            {"mesh": 1, "translation": [0, 0, 3], "name": "hat"},
            {"children": [4], "name": "root"},
            {"name": "arm"},
        ],
        "meshes": [
            {"primitives": pair, "weights": [0.5], "name": "cube"},
            {"primitives": [strip], "name": "strip"},
        ],
        "materials": [image, {"name": "felt", "extensions": {"KHR_materials_unlit": {}}}],
        "textures": [{"source": 0}],
        "images": [{"bufferView": view(PIXEL), "mimeType": "image/png", "name": "dot"}],
        "extensionsUsed": ["KHR_materials_unlit"],
        "skins": [{"inverseBindMatrices": matrices, "joints": [3, 4]}],
        "animations": [
            {
                "channels": [{"sampler": 0, "target": {"node": 4, "path": "rotation"}}],
                "samplers": [{"input": times, "output": turns}],
            }
        ],
        "buffers": [{"byteLength": len(body)}],
    }, body


def write_scene(path, scene, body):
    if path.suffix == ".gltf":  # the buffer and the image beside it
        scene["buffers"][0]["uri"] = "its%20body.bin"
        (path.parent / "its body.bin").write_bytes(body)
        scene["images"][0] = {"uri": "dot.png", "name": "dot"}
        (path.parent / "dot.png").write_bytes(PIXEL)
        path.write_text(json.dumps(scene))
        return path
    text = json.dumps(scene).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(body), b"BIN\0") + body
    path.write_bytes(struct.pack("<4s2I", b"glTF", 2, 12 + len(chunks)) + chunks)
    return path


def scene_of(path):
    data = path.read_bytes()
    (size,) = struct.unpack_from("<I", data, 12)
    return json.loads(data[20 : 20 + size]), data[28 + size :]


def entries(scene, body, number):
    """(count, columns) of an accessor, by this reader."""
    entry = scene["accessors"][number]
    kind, columns = np.dtype(KINDS[entry["componentType"]]), COLUMNS[entry["type"]]

    def read(of, count, columns, kind):
        view = scene["bufferViews"][of["bufferView"]]
        start = view["byteOffset"] + of.get("byteOffset", 0)
        step = view.get("byteStride", columns * kind.itemsize)
        rows = [np.frombuffer(body, kind, columns, start + step * k) for k in range(count)]
        return np.array(rows)

    if "bufferView" in entry:
        return read(entry, entry["count"], columns, kind)
    whole, sparse = np.zeros((entry["count"], columns), kind), entry["sparse"]
    rows = read(sparse["indices"], sparse["count"], 1, np.dtype("u1")).ravel()
    whole[rows] = read(sparse["values"], sparse["count"], columns, kind)
    return whole


def corners_of(scene, body, primitive):
    n = scene["accessors"][primitive["attributes"]["POSITION"]]["count"]
    rows = (
        entries(scene, body, primitive["indices"]).ravel() if "indices" in primitive else range(n)
    )
    if primitive.get("mode", 4) == 5:
        rows = [rows[k + i] for k in range(len(rows) - 2) for i in ((0, 1, 2), (1, 0, 2))[k % 2]]
    return np.array(rows)


@pytest.mark.parametrize("suffix", ["glb", "gltf"])
@pytest.mark.parametrize("cut_open", [False, True])
def test_a_scene_keeps_all_but_its_texture_coordinates(tmp_path, suffix, cut_open, caplog):
    given = write_scene(tmp_path / f"doll.{suffix}", *doll())
    before, old = doll()
    V, F = read_mesh(given)
    uv = np.random.default_rng(0).random((len(V), 2))
    if cut_open:
        moved = np.random.default_rng(0).integers(0, 2, (len(F), 1, 2))
        uv = (np.array([[0, 0], [1, 0], [0, 1]]) + moved) / 2  # some vertices are in one place
    (tmp_path / "a").mkdir()
    out = tmp_path / "a/out.glb"
    write_map(out, V, F, uv, disk=True, like=given)
    assert caplog.messages == [
        f"the images of {given.name} fit the texture coordinates that it had"
    ]
    again_V, again_F = read_mesh(out)
    np.testing.assert_array_equal(again_V[again_F], V[F])

    after, new = scene_of(out)
    touched = {"accessors", "bufferViews", "buffers", "meshes", "nodes", "images"}
    assert {k: after[k] for k in after.keys() - touched} == {
        k: before[k] for k in before.keys() - touched
    }
    assert before["nodes"][1].pop("mesh") == 0
    assert after["nodes"][1].pop("mesh") == 2  # which has texture coordinates of its own
    assert after["nodes"] == before["nodes"]
    view = after["bufferViews"][after["images"][0]["bufferView"]]
    assert new[view["byteOffset"] :][: view["byteLength"]] == PIXEL
    for number in (before["skins"][0]["inverseBindMatrices"], *range(-2, 0)):
        number %= len(before["accessors"])
        assert after["accessors"][number] == before["accessors"][number]
        np.testing.assert_array_equal(entries(after, new, number), entries(before, old, number))

    corner_uv = iter((uv if cut_open else uv[F]).tolist())
    meshes = [(0, 0, 1), (0, 2, -1), (1, 1, 1)]  # mesh before, after, and how faces are listed
    for was, now, step in meshes:
        old_mesh, new_mesh = before["meshes"][was], after["meshes"][now]
        assert old_mesh["name"] == new_mesh["name"]
        for one, other in zip(old_mesh["primitives"], new_mesh["primitives"], strict=True):
            rest = {"attributes", "targets", "indices", "mode"}
            assert {k: one[k] for k in one.keys() - rest} == {
                k: other[k] for k in other.keys() - rest
            }
            at, again = corners_of(before, old, one), corners_of(after, new, other)
            pairs = chain(
                ((one["attributes"][k], other["attributes"][k]) for k in one["attributes"]),
                (
                    (t["POSITION"], u["POSITION"])
                    for t, u in zip(one.get("targets", []), other.get("targets", []), strict=True)
                ),
            )
            n = None
            for a, b in pairs:
                x, y = entries(before, old, a), entries(after, new, b)
                assert n in (None, len(y))
                n = len(y)
                assert n == len(x) if not cut_open else n >= len(x)
                if a == one["attributes"]["TEXCOORD_0"]:
                    faces = [next(corner_uv)[::step] for _ in range(len(again) // 3)]
                    expected = np.array(faces, "f4").reshape(-1, 2)
                    np.testing.assert_allclose(y[again], [0, 1] + expected * [1, -1], atol=1e-7)
                else:
                    np.testing.assert_array_equal(y[: len(x)], x)
                    np.testing.assert_array_equal(y[again], x[at])
                    kept = ("componentType", "type", "normalized", "name", "min", "max")
                    x, y = before["accessors"][a], after["accessors"][b]
                    assert [x.get(k) for k in kept] == [y.get(k) for k in kept]
            assert ("indices" in one) == ("indices" in other) or cut_open
    assert next(corner_uv, None) is None


def test_the_file_that_was_given_is_kept_everywhere(tmp_path, caplog):
    scene, body = doll()
    scene["nodes"][0]["scale"] = [1, 2, 3]
    given = write_scene(tmp_path / "doll.glb", scene, body)
    surface_map(given).save(tmp_path / "a.glb")
    assert invoke("map", given, tmp_path / "b.glb", "--cut").exit_code == 0
    for name in ("a", "b"):
        after, _ = scene_of(tmp_path / f"{name}.glb")
        assert (after["animations"], after["skins"]) == (scene["animations"], scene["skins"])
        position = after["meshes"][0]["primitives"][0]["attributes"]["POSITION"]
        assert after["accessors"][position]["count"] > 8
    assert (tmp_path / "a.glb").read_bytes() == (tmp_path / "b.glb").read_bytes()
    caplog.clear()
    surface_map(given).save(tmp_path / "c.glb", image="checkerboard")
    after, new = scene_of(tmp_path / "c.glb")
    assert [after[name] for name in ("animations", "skins")] == [
        scene["animations"],
        scene["skins"],
    ]
    assert caplog.messages == []
    shown = {of["pbrMetallicRoughness"]["baseColorTexture"]["index"] for of in after["materials"]}
    image = after["images"][after["textures"][shown.pop()]["source"]]
    view = after["bufferViews"][image["bufferView"]]
    assert new[view["byteOffset"] :][: view["byteLength"]] == checkerboard().data
    assert (shown, PIXEL in new) == (set(), False)


def test_instances_are_nodes(tmp_path):
    """Each has its own place in the texture; what the node has besides moves them all."""
    random, (scene, body) = np.random.default_rng(3), doll()
    move, turn, size = random.normal(size=(3, 3)), random.normal(size=(3, 4)), [[1], [2], [-1]]
    turn /= np.linalg.norm(turn, axis=1, keepdims=True)
    size = size * random.uniform(0.5, 2, (3, 3))
    rows, attributes = {"TRANSLATION": move, "ROTATION": turn, "SCALE": size}, {}
    for name, array in rows.items():
        data = array.astype("<f4").tobytes()
        view = {"buffer": 0, "byteOffset": len(body), "byteLength": len(data)}
        scene["bufferViews"].append(view)
        entry = {"bufferView": len(scene["bufferViews"]) - 1, "componentType": 5126, "count": 3}
        scene["accessors"].append(entry | {"type": f"VEC{array.shape[1]}"})
        attributes[name] = len(scene["accessors"]) - 1
        body += data
    scene["buffers"][0]["byteLength"] = len(body)
    holder = next(node for node in scene["nodes"] if "mesh" in node)
    of_nodes = json.loads(json.dumps(scene))
    one = next(node for node in of_nodes["nodes"] if "mesh" in node)
    of_each = {name: one.pop(name) for name in ("mesh", "skin") if name in one}
    first = len(of_nodes["nodes"])
    of_nodes["nodes"] += [
        of_each | {"translation": t.tolist(), "rotation": r.tolist(), "scale": s.tolist()}
        for t, r, s in zip(*(array.astype("<f4") for array in rows.values()), strict=True)
    ]
    one["children"] = [*range(first, first + 3), *one.get("children", [])]
    holder["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": attributes}}
    scene["extensionsUsed"].append("EXT_mesh_gpu_instancing")
    scene["extensionsRequired"] = ["EXT_mesh_gpu_instancing"]
    given = write_scene(tmp_path / "many.glb", scene, body)
    plain = write_scene(tmp_path / "nodes.glb", of_nodes, body)
    V, F = read_mesh(given)
    for array, other in zip((V, F), read_mesh(plain), strict=True):
        np.testing.assert_array_equal(array, other)
    result = surface_map(given)
    result.save(tmp_path / "a.glb")
    W, G, uv = read_texture(tmp_path / "a.glb")
    np.testing.assert_array_equal(W[G], V[F])
    np.testing.assert_allclose(uv, result.packed(), atol=1e-6)
    after, _ = scene_of(tmp_path / "a.glb")
    assert after["extensionsUsed"] == ["KHR_materials_unlit"]
    assert "extensionsRequired" not in after


@pytest.mark.parametrize("suffix", ["glb", "gltf"])
def test_what_a_scene_requires_is_read_or_named(tmp_path, suffix):
    for name in ("KHR_materials_unlit", "KHR_texture_transform", "KHR_mesh_quantization"):
        scene, body = doll()
        scene["extensionsRequired"] = [name]
        assert len(read_mesh(write_scene(tmp_path / f"a.{suffix}", scene, body))[1])
    for name in ("KHR_draco_mesh_compression", "ACME_cloth"):
        scene, body = doll()
        scene["extensionsRequired"] = [name]
        path = write_scene(tmp_path / f"b.{suffix}", scene, body)
        with pytest.raises(MeshError, match=f"requires the extension {name}"):
            read_mesh(path)


# -- ply ---------------------------------------------------------------------------------

KEPT = {"red": "B", "green": "B", "blue": "B", "quality": "f", "nearest": "H"}
PLY = """ply
format {}
comment by a scanner
obj_info of 1999
element camera 1
property double focus
element vertex 7
property float x
property float u
property list uchar short names
property float y
property float z
property float v
property uchar red
property uchar green
property uchar blue
property float quality
property ushort nearest
element face 4
property int label
property list uchar uint vertex_index
property list uchar float texcoord
element edge 2
property int vertex1
property int vertex2
end_header
"""
PLACES = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0.3], [2, 1, 0.3], [3, 0.5, 0]]
POLYGONS = [[0, 1, 2, 3], [1, 4, 5, 2], [4, 6, 5], [3, 2, 0]]


def values_of_ply():
    """Element by element, rows of pairs of a type, as struct has it, and a value."""
    random = np.random.default_rng(5)
    vertices = []
    for k, (x, y, z) in enumerate(PLACES):
        names = [("B", k % 3), *(("h", name) for name in random.integers(-9, 9, k % 3).tolist())]
        others = [(kind, int(random.integers(256))) for kind in KEPT.values()]
        others[3] = ("f", float(np.float32(random.random())))
        vertices.append([("f", x), ("f", 7), *names, ("f", y), ("f", z), ("f", 8), *others])
    faces = [
        [("i", -k), ("B", len(p)), *(("I", i) for i in p), ("B", 2 * len(p))]
        + [("f", 9)] * (2 * len(p))
        for k, p in enumerate(POLYGONS)
    ]
    return [[("d", 1 / 3)]], vertices, faces, [[("i", 0), ("i", 1)], [("i", 2), ("i", 5)]]


def written(elements, form):
    if form == "ascii 1.0":
        rows = [" ".join(f"{value!r}" for _, value in row) for rows in elements for row in rows]
        return "".join(f"{row}\n" for row in rows).encode()
    order = "<" if "little" in form else ">"
    cells = [cell for rows in elements for row in rows for cell in row]
    return struct.pack(order + "".join(kind for kind, _ in cells), *(value for _, value in cells))


FORMS = ["ascii 1.0", "binary_little_endian 1.0", "binary_big_endian 1.0"]


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("cut_open", [False, True])
def test_a_ply_file_keeps_all_but_its_texture_coordinates(tmp_path, form, cut_open):
    given, out = tmp_path / "given.ply", tmp_path / "out.ply"
    values = values_of_ply()
    given.write_bytes(PLY.format(form).encode() + written(values, form))
    V, F = read_mesh(given)
    uv = np.random.default_rng(0).random((7, 2))
    header = PLY.format(form).replace("property float u\n", "").replace("property float v\n", "")
    _, vertices, faces, _ = values
    for row in vertices:  # without u and v
        del row[1], row[4 + row[1][1]]
    if cut_open:
        uv = uv[F]
        uv[1] += 1  # a part of the first polygon
        header = header.replace("float texcoord", "double texcoord").replace("face 4", "face 5")
        label, *_ = faces[0]
        triangles = [[label, ("B", 3), *(("I", int(i)) for i in F[k]), None] for k in (0, 1)]
        faces[:1] = triangles
        at = [*uv[:2], uv[[2, 2, 3, 3], [0, 1, 1, 2]], *uv[4:]]
        assert F[2:4].tolist() == [[1, 4, 5], [1, 5, 2]]
        for row, there in zip(faces, at, strict=True):
            size = row[1][1]
            row[2 + size :] = [("B", 2 * size), *(("d", u) for u in there.ravel().tolist())]
    else:
        header = header.replace("property list uchar float texcoord\n", "")
        header = header.replace("nearest\n", "nearest\nproperty double s\nproperty double t\n")
        for row, there in zip(vertices, uv.tolist(), strict=True):
            row += [("d", u) for u in there]
        for row in faces:
            del row[2 + row[1][1] :]
    write_map(out, V, F, uv, disk=True, like=given)
    assert out.read_bytes() == header.encode() + written(values, form)
    np.testing.assert_array_equal(read_texture(out)[2], uv if cut_open else uv[F])


def test_strips_that_are_cut_open_become_triangles(tmp_path):
    given, out = tmp_path / "given.ply", tmp_path / "out.ply"
    header = "ply\nformat ascii 1.0\nelement vertex 5\n"
    header += "".join(f"property {'double' if k else 'int'} {k or 'id'}\n" for k in ["", *"xyz"])
    header += "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
    given.write_text(
        header + "".join(f"{k} {k // 2} {k % 2} 0.10\n" for k in range(5)) + "5 0 1 2 3 4\n"
    )
    V, F = read_mesh(given)
    uv = np.arange(18.0).reshape(3, 3, 2)
    write_map(out, V, F, uv, disk=True, like=given)
    assert "0.10\n" in out.read_text()
    for array, expected in zip(read_texture(out), (V, F, uv), strict=True):
        np.testing.assert_array_equal(array, expected)
    write_map(out, V, F, V[:, :2], disk=True, like=given)
    assert out.read_text().endswith("\n5 0 1 2 3 4\n")


def test_colours_go_from_type_to_type(tmp_path, caplog):
    """As bytes; what else a file has, and the new one has not, is said in a line."""
    V, F, _ = datasets.spherical_cap(3)
    colours = np.random.default_rng(3).integers(0, 256, (len(V), 3))
    first = tmp_path / "scan.ply"
    rows = "".join(
        f"{x!r} {y!r} {z!r} 0.5 {r} {g} {b}\n"
        for (x, y, z), (r, g, b) in zip(V.tolist(), colours.tolist(), strict=True)
    )
    properties = [*(f"float {axis}" for axis in "xyz"), "float quality"]
    properties += [f"uchar {name}" for name in ("red", "green", "blue")]
    header = ["ply", "format ascii 1.0", "comment by hand", f"element vertex {len(V)}"]
    header += [f"property {it}" for it in properties]
    header += [f"element face {len(F)}", "property list uchar int vertex_indices", "end_header\n"]
    faces = "".join(f"3 {i} {j} {k}\n" for i, j, k in F.tolist())
    first.write_text("\n".join(header) + rows + faces)
    disk_map(first).save(tmp_path / "a.obj")
    assert caplog.messages == ["not in a.obj: comments, quality of scan.ply"]
    line = (tmp_path / "a.obj").read_text().splitlines()[0].split()
    np.testing.assert_array_equal(np.rint(255 * np.array(line[4:], float)), colours[0])
    said = "not in c.ply: materials, NORMAL of b.glb"
    for before, after in (("a.obj", "b.glb"), ("b.glb", "c.ply"), ("c.ply", "d.ply")):
        done = invoke("map", tmp_path / before, tmp_path / after)
        assert done.exit_code == 0
        assert (said in " ".join(done.output.split())) == (after == "c.ply")
    assert caplog.messages[1:] == [said]
    for name in ("c.ply", "d.ply"):
        mesh = trimesh.load(tmp_path / name, process=False)
        np.testing.assert_array_equal(mesh.vertex_attributes["color"][:, :3], colours)
    caplog.clear()
    disk_map(first).save(tmp_path / "a.npz")
    disk_map(submesh(first, vertices=V[:, 0] < 0.5)).save(tmp_path / "part.obj")
    assert caplog.messages == [
        f"not in {name}: colours, comments, quality of scan.ply" for name in ("a.npz", "part.obj")
    ]
    assert len((tmp_path / "part.obj").read_text().splitlines()[0].split()) == 4
