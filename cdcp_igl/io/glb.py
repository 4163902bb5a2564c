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
from typing import Any
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
from .images import Image
from .polygons import fans, strips

log = logging.getLogger("cdcp_igl")

# Numbers that the specification gives to types, targets and ways to list triangles.
FLOAT, UNSIGNED_INT = 5126, 5125
VERTICES, INDICES = 34962, 34963
TRIANGLES, STRIP, FAN = 4, 5, 6
COMPONENTS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}

PRIMITIVE = {
    "attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2},
    "indices": 3,
    "material": 0,
}
MATERIAL = {
    "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0},
    "doubleSided": True,
}
SCENE = {
    "asset": {"version": "2.0", "generator": "cdcp_igl"},
    "scene": 0,
    "scenes": [{"nodes": [0]}],
    "nodes": [{"mesh": 0}],
    "meshes": [{"primitives": [PRIMITIVE]}],
    "materials": [MATERIAL],
    "textures": [{"source": 0}],
}


def read_gltf(path: Path) -> tuple[Floats, Ints]:
    """(n, 3) vertices and (m, 3) faces of all meshes of a glb or gltf file, where its nodes are.

    Primitives that share vertices share them here.
    """
    scene, body = _scene_and_body(path.read_bytes())
    for name in scene.get("extensionsRequired", []):
        if "compression" in name:
            raise Damage(f"it is compressed by {name}: export it without")
    first: dict[tuple[int, int], int] = {}  # vertex of each accessor of a node
    vertices, faces, n = [np.empty((0, 3))], [np.empty((0, 3), np.int64)], 0
    for node, matrix in _placed_nodes(scene):
        for primitive in scene["meshes"][scene["nodes"][node]["mesh"]]["primitives"]:
            mode, place = primitive.get("mode", TRIANGLES), primitive["attributes"]["POSITION"]
            if mode not in (TRIANGLES, STRIP, FAN):
                continue
            positions = _numbers(scene, place, body, path).astype(np.float64)
            corners = np.arange(len(positions))
            if "indices" in primitive:
                corners = _numbers(scene, primitive["indices"], body, path).ravel().astype(np.int64)
            F = _triangles(mode, corners)
            if np.linalg.det(matrix[:3, :3]) < 0:
                F = F[:, ::-1]
            if (node, place) not in first:
                first[node, place] = n
                vertices.append(positions @ matrix[:3, :3].T + matrix[:3, 3])
                n += len(positions)
            faces.append(F + first[node, place])
    return np.concatenate(vertices), np.concatenate(faces)


def _scene_and_body(data: bytes) -> tuple[dict[str, Any], bytes]:
    """Return what the JSON part of a file says, and its binary part."""
    if data[:4] != b"glTF":
        return json.loads(data), b""
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
        raise Damage("its nodes go around in a circle")


def _matrix(node: dict[str, Any]) -> Floats:
    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T
    matrix, (*axis, w) = np.eye(4), node.get("rotation", (0, 0, 0, 1))
    cross = np.cross(axis, np.eye(3)).T  # as a matrix
    matrix[:3, :3] += 2 * (w * cross + cross @ cross)
    matrix[:3, :3] *= node.get("scale", 1)
    matrix[:3, 3] = node.get("translation", 0)
    return matrix


def _numbers(scene: dict[str, Any], number: int, body: bytes, path: Path) -> NDArray[Any]:
    """(count, columns) entries of an accessor."""
    accessor = scene["accessors"][number]
    if "sparse" in accessor or "bufferView" not in accessor:
        raise Damage("it has a sparse accessor: export it without")
    view = scene["bufferViews"][accessor["bufferView"]]
    uri = scene["buffers"][view["buffer"]].get("uri")
    if uri is not None and uri.startswith("data:"):
        body = b64decode(uri.partition(",")[2])
    elif uri is not None:
        body = (path.parent / unquote(uri)).read_bytes()
    kind = np.dtype(COMPONENTS[accessor["componentType"]])
    columns = {"SCALAR": 1, "VEC3": 3}[accessor["type"]]
    start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    stride = view.get("byteStride", columns * kind.itemsize)
    shape, strides = (accessor["count"], columns), (stride, kind.itemsize)
    numbers = np.ndarray(shape, kind, body, start, strides).copy()
    if accessor.get("normalized"):
        return np.maximum(numbers / np.iinfo(kind).max, -1)
    return numbers


def _triangles(mode: int, corners: Ints) -> Ints:
    if mode == STRIP:
        return strips(corners, np.array([len(corners)]))
    if mode == FAN:
        return fans(corners, [len(corners)])[0]
    return corners.reshape(-1, 3)


def write_glb(
    path: Path, V: Floats, F: Ints, texture: Floats, FT: Ints, vertex: Ints, image: Image
) -> None:
    """Write a surface with normals, texture coordinates and an image, in single precision.

    Row k of `texture`, from the lower left corner of the image, belongs to ``vertex[k]``; a
    vertex with several is written as several. `FT` has the rows at the corners of F.
    """
    with np.errstate(over="ignore"):
        single = V.astype("<f4")
    if not np.isfinite(single).all():
        raise ValueError("V is too large for a glb file, which has single precision: scale it.")
    flat = _n_flat(single, F)
    if flat and flat > (already := _n_flat(V, F)):
        faces = counted(flat - already, "face has", "faces have")
        log.warning("%s no area in single precision: scale the surface, and move it to 0", faces)
    positions = single[vertex]
    on_a_disk = np.flatnonzero(texture[FT].any(axis=(1, 2)))
    lost = on_a_disk[lost_in_single_precision(texture, FT[on_a_disk])]
    if len(lost):
        area = face_areas(V, F)
        log.warning(
            "%s no area on the texture in single precision, %.2g of the surface: cut the surface",
            counted(len(lost), "face has", "faces have"),
            area[lost].sum() / area.sum(),
        )
    upper_left = np.column_stack([texture[:, 0], 1 - texture[:, 1]])  # where glTF has its origin
    arrays = (positions, _normals(V, F).astype("<f4")[vertex], upper_left.astype("<f4"))
    pieces = [*(array.tobytes() for array in arrays), FT.astype("<u4").tobytes(), image.data]
    views: list[dict[str, Any]] = []
    at = 0
    for piece in pieces:
        views.append({"buffer": 0, "byteOffset": at, "byteLength": len(piece)})
        at += len(piece) + -len(piece) % 4
    for view, target in zip(views, (VERTICES, VERTICES, VERTICES, INDICES), strict=False):
        view["target"] = target
    box = {"min": positions.min(axis=0).tolist(), "max": positions.max(axis=0).tolist()}
    scene = {
        **SCENE,
        "images": [{"bufferView": len(arrays) + 1, "mimeType": image.mime}],
        "accessors": [
            _accessor(0, FLOAT, len(vertex), "VEC3") | box,
            _accessor(1, FLOAT, len(vertex), "VEC3"),
            _accessor(2, FLOAT, len(vertex), "VEC2"),
            _accessor(3, UNSIGNED_INT, FT.size, "SCALAR"),
        ],
        "bufferViews": views,
        "buffers": [{"byteLength": at}],
    }
    text = json.dumps(scene, separators=(",", ":")).encode("ascii")
    text += b" " * (-len(text) % 4)
    with path.open("wb") as file:
        file.write(struct.pack("<4s2I", b"glTF", 2, 28 + len(text) + at))
        file.write(struct.pack("<I4s", len(text), b"JSON") + text)
        file.write(struct.pack("<I4s", at, b"BIN\0"))
        for piece in pieces:
            file.write(piece + b"\0" * (-len(piece) % 4))


def _n_flat(V: Floats, F: Ints) -> int:
    return len(degenerate_faces(corner_cotangents(unit_size(V), F)))


def _accessor(view: int, component: int, count: int, kind: str) -> dict[str, Any]:
    return {"bufferView": view, "componentType": component, "count": count, "type": kind}


def _normals(V: Floats, F: Ints) -> Floats:
    """(n, 3) unit normals of the vertices, faces weighted by area."""
    normals = libigl.vertex_normals(unit_size(V), F)  # products stay in range in any unit
    upwards = np.array([0.0, 0.0, 1.0])  # where there is none, as each must have length 1
    return np.where(np.isfinite(normals), normals, upwards)
