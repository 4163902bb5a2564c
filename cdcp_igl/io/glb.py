"""glTF 2.0, glb in one file: what browsers, viewers and game engines open.

References
----------
The Khronos Group. glTF 2.0 Specification. 2021.
"""

from __future__ import annotations

import json
import logging
import struct
from base64 import b64decode
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from .. import libigl
from ..arrays import Floats, Ints, unit_size
from ..errors import Damage, counted
from ..surface.triangles import (
    corner_cotangents,
    degenerate_faces,
    face_areas,
    lost_in_single_precision,
)
from .archives import NEVER_REFUSED
from .images import Image
from .polygons import fans, strips

log = logging.getLogger("cdcp_igl")

# Numbers that the specification gives to types, targets and ways to list triangles.
FLOAT, UNSIGNED_INT = 5126, 5125
VERTICES, INDICES = 34962, 34963
LISTS = TRIANGLES, STRIP, FAN = 4, 5, 6
COMPONENTS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
COLUMNS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}

# What a file may require that moves no vertex, by how its name begins.
HARMLESS = (
    *("KHR_materials_", "KHR_texture_", "EXT_texture_", "MSFT_texture_", "KHR_lights_"),
    *("EXT_lights_", "KHR_mesh_quantization", "KHR_animation_pointer", "KHR_xmp"),
)
INSTANCES = "EXT_mesh_gpu_instancing"

OLD = "it is glTF 1.0: convert it to 2.0, which replaced it in 2017"
SCENE = {
    "asset": {"version": "2.0", "generator": "cdcp_igl"},
    "scene": 0,
    "scenes": [{"nodes": [0]}],
    "nodes": [{"mesh": 0}],
}


class Part(NamedTuple):
    """The triangles of a primitive where a node puts them.

    `F` (m, 3) are rows of `positions` (n, 3), as in the file; `matrix` (4, 4) leads into the space
    of the scene. If it reflects, the triangles are `turned` there.
    """

    node: int
    primitive: int  # of its mesh
    accessor: int  # of the positions
    positions: Floats
    F: Ints
    matrix: Floats

    @property
    def turned(self) -> bool:
        """Whether the other side of the triangles is outside."""
        return bool(np.linalg.det(self.matrix[:3, :3]) < 0)

    @property
    def outward(self) -> Ints:
        """(m, 3) the faces of `read_gltf`, but for their vertices: the corners of `F`."""
        return self.F[:, ::-1] if self.turned else self.F


def read_gltf(path: Path) -> tuple[Floats, Ints]:
    """(n, 3) vertices and (m, 3) faces of all meshes of a glb or gltf file, where its nodes are.

    Primitives that share vertices share them here.
    """
    first: dict[tuple[int, int], int] = {}  # vertex of each accessor of a node
    vertices, faces, n = [np.empty((0, 3))], [np.empty((0, 3), np.int64)], 0
    for part in parts_of(*scene_and_body(path), path):
        place = part.node, part.accessor
        if place not in first:
            first[place] = n
            vertices.append(part.positions @ part.matrix[:3, :3].T + part.matrix[:3, 3])
            n += len(part.positions)
        faces.append(part.outward + first[place])
    return np.concatenate(vertices), np.concatenate(faces)


def texture_of_gltf(path: Path) -> Floats:
    """(m, 3, 2) texture coordinates of the corners of the faces of `read_gltf`, NaN without any."""
    scene, body = scene_and_body(path)
    found = [np.empty((0, 3, 2))]
    for part in parts_of(scene, body, path):
        primitive = primitive_of(scene, part)
        uv = np.full((len(part.positions), 2), np.nan)
        if "TEXCOORD_0" in primitive["attributes"]:
            uv = texture_of(scene, primitive, 0, body, path)
        found.append(uv[part.outward])
    return np.concatenate(found)


def primitive_of(scene: dict[str, Any], part: Part) -> dict[str, Any]:
    """Return what a scene says of the triangles of a part."""
    mesh = scene["meshes"][scene["nodes"][part.node]["mesh"]]
    primitive: dict[str, Any] = mesh["primitives"][part.primitive]
    return primitive


def texture_of(
    scene: dict[str, Any], primitive: dict[str, Any], number: int, body: bytes, path: Path
) -> Floats:
    """(n, 2) texture coordinates of a primitive, from the lower left."""
    accessor = primitive["attributes"][f"TEXCOORD_{number}"]
    return numbers(scene, accessor, body, path).astype(np.float64) * [1, -1] + [0, 1]


def parts_of(scene: dict[str, Any], body: bytes, path: Path) -> Iterator[Part]:
    """Yield all triangles of a scene, in the order of the faces of `read_gltf`."""
    for name in scene.get("extensionsRequired", []):
        if not name.startswith(HARMLESS):
            raise Damage(f"it requires the extension {name}, which is not read: export it without")
    for node, matrix in _placed_nodes(scene):
        primitives = scene["meshes"][scene["nodes"][node]["mesh"]]["primitives"]
        for number, primitive in enumerate(primitives):
            mode, place = primitive.get("mode", TRIANGLES), primitive["attributes"]["POSITION"]
            if mode not in LISTS:
                continue
            positions = numbers(scene, place, body, path).astype(np.float64)
            corners = np.arange(len(positions))
            if "indices" in primitive:
                corners = numbers(scene, primitive["indices"], body, path).ravel().astype(np.int64)
            yield Part(node, number, place, positions, _triangles(mode, corners), matrix)


def scene_and_body(path: Path) -> tuple[dict[str, Any], bytes]:
    """Return what the JSON part of a file says, instances as nodes, and its binary part."""
    scene, body = _json_and_body(path.read_bytes())
    nodes = scene.get("nodes", [])
    for node in [node for node in nodes if INSTANCES in node.get("extensions", {})]:
        attributes = node["extensions"].pop(INSTANCES)["attributes"]
        if not node["extensions"]:
            del node["extensions"]
        if "mesh" in node:
            of_each = {name: node.pop(name) for name in ("mesh", "skin", "weights") if name in node}
            first = len(nodes)
            nodes += [of_each | place for place in _instances(scene, attributes, body, path)]
            node["children"] = [*range(first, len(nodes)), *node.get("children", [])]
    for names in ("extensionsRequired", "extensionsUsed"):
        if left := [name for name in scene.pop(names, []) if name != INSTANCES]:
            scene[names] = left
    return scene, body


def _instances(
    scene: dict[str, Any], attributes: dict[str, int], body: bytes, path: Path
) -> list[dict[str, Any]]:
    """Return where each instance of a node is, as nodes say it."""
    rows = {name: numbers(scene, k, body, path).tolist() for name, k in attributes.items()}
    places = [name for name in ("TRANSLATION", "ROTATION", "SCALE") if name in rows]
    return [
        {name.lower(): row for name, row in zip(rows, each, strict=True) if name in places}
        for each in zip(*rows.values(), strict=True)
    ]


def _json_and_body(data: bytes) -> tuple[dict[str, Any], bytes]:
    if data[:4] != b"glTF":
        scene = json.loads(data)
        if str(scene["asset"]["version"]).startswith("1"):
            raise Damage(OLD)
        return scene, b""
    if data[4:8] == b"\1\0\0\0":
        raise Damage(OLD)
    (size,) = struct.unpack_from("<I", data, 12)
    return json.loads(data[20 : 20 + size]), data[28 + size :]


def _placed_nodes(scene: dict[str, Any]) -> Iterator[tuple[int, Floats]]:
    """Yield the nodes that have a mesh, and the matrix (4, 4) into the space of the scene."""
    nodes = scene.get("nodes", [])
    children = {child for node in nodes for child in node.get("children", [])}
    roots = [node for node in range(len(nodes)) if node not in children]
    if "scenes" in scene:
        roots = scene["scenes"][scene.get("scene", 0)].get("nodes", [])
    left = [(node, np.eye(4)) for node in reversed(roots)]
    for _ in nodes:  # of which each has one parent
        if not left:
            return
        node, above = left.pop()
        matrix = above @ _matrix(nodes[node])
        left += [(child, matrix) for child in reversed(nodes[node].get("children", []))]
        if "mesh" in nodes[node]:
            yield node, matrix
    if left:
        raise Damage("a node is a child of two others, or of itself, which glTF forbids")


def _matrix(node: dict[str, Any]) -> Floats:
    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T
    matrix, (*axis, w) = np.eye(4), node.get("rotation", (0, 0, 0, 1))
    cross = np.cross(axis, np.eye(3)).T  # as a matrix
    matrix[:3, :3] += 2 * (w * cross + cross @ cross)
    matrix[:3, :3] *= node.get("scale", 1)
    matrix[:3, 3] = node.get("translation", 0)
    return matrix


def numbers(scene: dict[str, Any], number: int, body: bytes, path: Path) -> NDArray[Any]:
    """(count, columns) entries of an accessor."""
    kind = np.dtype(COMPONENTS[scene["accessors"][number]["componentType"]])
    entries = rows_of_accessor(scene, number, body, path).view(kind)
    if scene["accessors"][number].get("normalized"):
        return np.maximum(entries / np.iinfo(kind).max, -1)
    return entries


def rows_of_accessor(
    scene: dict[str, Any], number: int, body: bytes, path: Path
) -> NDArray[np.uint8]:
    """(count, k) bytes of the rows of an accessor, whatever they mean."""
    accessor = scene["accessors"][number]
    count, component = accessor["count"], accessor["componentType"]
    size = COLUMNS[accessor["type"]] * np.dtype(COMPONENTS[component]).itemsize

    def rows(of: dict[str, Any], count: int, size: int) -> NDArray[np.uint8]:
        view = scene["bufferViews"][of["bufferView"]]
        stride = view.get("byteStride", size)
        start = of.get("byteOffset", 0)
        return np.ndarray(
            (count, size), np.uint8, piece(scene, view, body, path), start, (stride, 1)
        )

    if "bufferView" in accessor:
        whole = rows(accessor, count, size).copy()
    elif count * size > NEVER_REFUSED:
        raise Damage(f"it has {count:,.0f} rows of zeros")
    else:
        whole = np.zeros((count, size), np.uint8)
    if sparse := accessor.get("sparse"):
        kind = np.dtype(COMPONENTS[sparse["indices"]["componentType"]])
        changed = rows(sparse["indices"], sparse["count"], kind.itemsize).copy().view(kind)
        whole[changed.ravel()] = rows(sparse["values"], sparse["count"], size)
    return whole


def piece(scene: dict[str, Any], view: dict[str, Any], body: bytes, path: Path) -> bytes:
    """Return the bytes that a buffer view shows."""
    uri = scene["buffers"][view["buffer"]].get("uri")
    if uri is not None and uri.startswith("data:"):
        body = b64decode(uri.partition(",")[2])
    elif uri is not None:
        beside = path.parent / unquote(uri)
        if not beside.is_file():
            raise Damage(f"its buffer {beside.name!r} is not beside it")
        body = beside.read_bytes()
    elif view["buffer"]:
        raise Damage("it has a buffer without data: export it without compression")
    start = view.get("byteOffset", 0)
    return body[start : start + view["byteLength"]]


def _triangles(mode: int, corners: Ints) -> Ints:
    if mode == STRIP:
        return strips(corners, np.array([len(corners)]))
    if mode == FAN:
        return fans(corners, [len(corners)])[0]
    return corners.reshape(-1, 3)


def write_glb(
    path: Path,
    V: Floats,
    F: Ints,
    texture: Floats,
    FT: Ints,
    vertex: Ints,
    image: Image | None,
    colours: Floats | None = None,
) -> None:
    """Write a surface with normals, texture coordinates and an image, in single precision.

    Or with colours (n, 3) or (n, 4) of the vertices, sRGB from 0 to 1, or both.

    Row k of `texture`, from the lower left corner of the image, belongs to ``vertex[k]``; a
    vertex with several is written as several. `FT` has the rows at the corners of F.
    """
    offset = _offset(V)
    with np.errstate(over="ignore"):
        single = (V - offset).astype("<f4")
    if not np.isfinite(single).all():
        raise ValueError("V is too large for a glb file, which has single precision: scale it.")
    flat = _n_flat(single, F)
    if flat and flat > (already := _n_flat(V, F)):
        faces = counted(flat - already, "face has", "faces have")
        log.warning("%s no area in single precision: scale the surface", faces)
    positions = single[vertex]
    warn_of_lost_faces(V, F, texture, FT)
    arrays = {
        "POSITION": positions,
        "NORMAL": _normals(V, F)[vertex],
        "TEXCOORD_0": from_upper_left(texture),
    }
    if colours is not None:
        arrays["COLOR_0"] = np.hstack([linear(colours[:, :3]), colours[:, 3:]])[vertex]
    pieces = [array.astype("<f4").tobytes() for array in arrays.values()]
    pieces.append(FT.astype("<u4").tobytes())
    accessors = [
        _accessor(view, FLOAT, len(vertex), f"VEC{array.shape[1]}")
        for view, array in enumerate(arrays.values())
    ]
    accessors[0] |= {"min": positions.min(axis=0).tolist(), "max": positions.max(axis=0).tolist()}
    accessors.append(_accessor(len(arrays), UNSIGNED_INT, FT.size, "SCALAR"))
    names = {name: number for number, name in enumerate(arrays)}
    shown = {"baseColorTexture": {"index": 0}} if image else {}
    scene: dict[str, Any] = {
        **SCENE,
        "meshes": [{"primitives": [{"attributes": names, "indices": len(arrays), "material": 0}]}],
        "materials": [
            {"pbrMetallicRoughness": {"metallicFactor": 0, **shown}, "doubleSided": True}
        ],
        "accessors": accessors,
        "bufferViews": [*({"target": VERTICES} for _ in arrays), {"target": INDICES}],
    }
    if image:
        scene |= {"images": [{"bufferView": len(pieces), "mimeType": image.mime}]}
        scene |= {"textures": [{"source": 0}]}
        scene["bufferViews"].append({})
        pieces.append(image.data)
    if offset.any():
        scene["nodes"] = [{"mesh": 0, "translation": offset.tolist()}]
    write_pieces(path, scene, pieces)


def write_pieces(path: Path, scene: dict[str, Any], pieces: list[bytes]) -> None:
    """Write a scene and, one after the other, the bytes of its buffer views."""
    at = 0
    for view, data in zip(scene["bufferViews"], pieces, strict=True):
        view |= {"buffer": 0, "byteOffset": at, "byteLength": len(data)}
        at += len(data) + -len(data) % 4
    scene["buffers"] = [{"byteLength": at}]
    text = json.dumps(scene, separators=(",", ":")).encode("ascii")
    text += b" " * (-len(text) % 4)
    with path.open("wb") as file:
        file.write(struct.pack("<4s2I", b"glTF", 2, 28 + len(text) + at))
        file.write(struct.pack("<I4s", len(text), b"JSON") + text)
        file.write(struct.pack("<I4s", at, b"BIN\0"))
        for data in pieces:
            file.write(data + b"\0" * (-len(data) % 4))


def linear(colours: Floats) -> Floats:
    """Linear colours, as glTF has them at vertices, of sRGB (IEC 61966-2-1)."""
    return np.where(colours <= 0.04045, colours / 12.92, ((colours + 0.055) / 1.055) ** 2.4)


def srgb(colours: Floats) -> Floats:
    """Colours in sRGB of linear ones."""
    at = np.clip(colours, 0, 1)
    return np.where(at <= 0.0031308, 12.92 * at, 1.055 * at ** (1 / 2.4) - 0.055)


def from_upper_left(texture: Floats) -> NDArray[np.float32]:
    """(k, 2) texture coordinates in single precision, from where glTF has their origin."""
    return np.column_stack([texture[:, 0], 1 - texture[:, 1]]).astype("<f4")


def warn_of_lost_faces(V: Floats, F: Ints, texture: Floats, FT: Ints) -> None:
    """Say which part of the surface has no area on the texture in single precision."""
    on_a_disk = np.flatnonzero(texture[FT].any(axis=(1, 2)))
    lost = on_a_disk[lost_in_single_precision(texture, FT[on_a_disk])]
    if len(lost):
        area = face_areas(V, F)
        log.warning(
            "%s no area on the texture in single precision, %.2g of the surface: cut the surface",
            counted(len(lost), "face has", "faces have"),
            area[lost].sum() / area.sum(),
        )


def _offset(V: Floats) -> Floats:
    """(3,) middle of a surface that is farther from 0 than it is large, in single precision."""
    low, high = V.min(axis=0), V.max(axis=0)
    middle = low + (high - low) / 2
    far = np.abs(middle).max() > (high - low).max()
    with np.errstate(over="ignore"):
        offset = middle.astype(np.float32).astype(np.float64)
    return offset if far and np.isfinite(offset).all() else np.zeros(3)


def _n_flat(V: Floats, F: Ints) -> int:
    return len(degenerate_faces(corner_cotangents(unit_size(V), F)))


def _accessor(view: int, component: int, count: int, kind: str) -> dict[str, Any]:
    return {"bufferView": view, "componentType": component, "count": count, "type": kind}


def _normals(V: Floats, F: Ints) -> Floats:
    """(n, 3) unit normals of the vertices, faces weighted by area."""
    normals = libigl.vertex_normals(unit_size(V), F)  # products stay in range in any unit
    upwards = np.array([0.0, 0.0, 1.0])  # where there is none, as each must have length 1
    return np.where(np.isfinite(normals), normals, upwards)
