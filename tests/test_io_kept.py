"""Files that are written again keep what they have: scenes of glTF."""

import base64
import json
import struct
from itertools import chain

import numpy as np
import pytest
from commands import invoke

from cdcp_igl import surface_map
from cdcp_igl.io import read_mesh, write_map

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
    surface_map(given).save(tmp_path / "c.glb", image="checkerboard")
    assert "skins" not in scene_of(tmp_path / "c.glb")[0]
