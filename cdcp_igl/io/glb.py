"""glTF 2.0 in one file, glb: what browsers, viewers and game engines open.

References
----------
The Khronos Group. glTF 2.0 Specification. 2021.
"""

from __future__ import annotations

import json
import logging
import struct
from pathlib import Path
from typing import Any

import numpy as np

from .. import libigl
from ..arrays import Floats, Ints
from ..certificate import lost_in_single_precision
from ..errors import counted
from ..surface.validation import unit_size
from .images import Image

log = logging.getLogger("cdcp_igl")

# Numbers that the specification gives to types and targets.
FLOAT, UNSIGNED_INT = 5126, 5125
VERTICES, INDICES = 34962, 34963

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


def write_glb(
    path: Path, V: Floats, F: Ints, texture: Floats, FT: Ints, vertex: Ints, image: Image
) -> None:
    """Write a surface with normals, texture coordinates and an image, in single precision.

    Row k of `texture`, from the lower left corner of the image, belongs to ``vertex[k]``; a
    vertex with several is written as several. `FT` has the rows at the corners of F.
    """
    with np.errstate(over="ignore"):
        positions = V.astype("<f4")[vertex]
    if not np.isfinite(positions).all():
        raise ValueError("V is too large for a glb file, which has single precision: scale it.")
    on_a_disk = texture[FT].any(axis=(1, 2))
    lost = lost_in_single_precision(texture, FT[on_a_disk])
    if len(lost):
        faces = counted(len(lost), "face has", "faces have")
        log.warning("%s no area on the texture in single precision: cut the surface", faces)
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


def _accessor(view: int, component: int, count: int, kind: str) -> dict[str, Any]:
    return {"bufferView": view, "componentType": component, "count": count, "type": kind}


def _normals(V: Floats, F: Ints) -> Floats:
    """(n, 3) unit normals of the vertices, faces weighted by area."""
    normals = libigl.vertex_normals(unit_size(V), F)  # products stay in range in any unit
    upwards = np.array([0.0, 0.0, 1.0])  # where there is none, as each must have length 1
    return np.where(np.isfinite(normals), normals, upwards)
