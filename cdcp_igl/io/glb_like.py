"""A given glb or gltf file again, with other texture coordinates and otherwise as it is."""

from __future__ import annotations

import logging
from collections import defaultdict
from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from . import glb
from .glb import Part
from .images import MIME, Image

log = logging.getLogger("cdcp_igl")

IMAGES = MIME | {".ktx2": "image/ktx2"}  # of the extension KHR_texture_basisu


def write_glb_like(
    path: Path,
    given: Path,
    texture: Floats,
    FT: Ints,
    vertex: Ints,
    image: Image | None = None,
) -> None:
    """Write a given glb or gltf file again, with other texture coordinates.

    All its triangles show an image, if there is one, in the place of those of base colours.

    Nodes, materials, skins, animations and all that is not known here stay; what lay beside the
    file comes into it. Vertices with several texture coordinates are written again behind the
    others, with all that belongs to them, morph targets too. Only then strips and fans become
    triangles. A mesh of several nodes becomes one for each, and each instance of a mesh a node.

    `texture`, `FT` and `vertex` are as for `write_glb`, of the faces that `read_gltf` makes of
    `given`.
    """
    scene, body = glb.scene_and_body(given)
    parts: dict[tuple[int, int], list[tuple[Part, Ints]]] = defaultdict(list)
    m = 0
    for part in glb.parts_of(scene, body, given):
        corners = FT[m : m + len(part.F)]
        parts[part.node, part.accessor].append((part, corners[:, ::-1] if part.turned else corners))
        m += len(part.F)
    rewritten = _Rewritten(scene, body, given)
    upper_left, start = glb.from_upper_left(texture), 0
    for (node, _), those in parts.items():
        n = len(those[0][0].positions)
        low, high = np.searchsorted(vertex, (start, start + n))
        rewritten.set_texture(
            rewritten.own_mesh(node),
            [(part, corners - low) for part, corners in those],
            vertex[low:high] - start,
            upper_left[low:high],
        )
        start += n
    if image:
        rewritten.show(image)
    if rewritten.shows_old():
        log.warning("the images of %s fit the texture coordinates that it had", given.name)
    glb.write_pieces(path, rewritten.scene, rewritten.pieces)


class _Rewritten:
    """A scene and the bytes of its buffer views, to be changed, beside the scene as it was.

    An accessor that is used for one thing is replaced at its place, and so is its view; others
    are added at the end, so that all numbers stay.
    """

    def __init__(self, given: dict[str, Any], body: bytes, path: Path) -> None:
        self.given, self.body, self.path = given, body, path
        self.scene = deepcopy(given)
        self.views: list[dict[str, Any]] = self.scene.setdefault("bufferViews", [])
        self.pieces = [glb.piece(given, view, body, path) for view in self.views]
        self.mesh_of_node: dict[int, int] = {}
        self.textured: list[dict[str, Any]] = []  # primitives whose texture coordinates are new
        self.materials: set[int] = set()  # of those that had texture coordinates before
        self.shown: int | None = None  # the texture that is new
        self.extended: dict[tuple[int, int, int], int] = {}
        for image in self.scene.get("images", []):
            beside = path.parent / unquote(image.get("uri", "data:"))
            mime = IMAGES.get(beside.suffix.lower())
            if mime and beside.is_file():
                del image["uri"]
                image |= {"bufferView": self._add({}, beside.read_bytes()), "mimeType": mime}
        # What uses an accessor: the vertices of primitives that share them, or else a primitive.
        self.users: dict[int, set[tuple[Any, ...]]] = defaultdict(set)
        nodes = enumerate(given["nodes"])
        holders = [(f"node {k}", node["mesh"]) for k, node in nodes if "mesh" in node]
        rest = set(range(len(given["meshes"]))) - {mesh for _, mesh in holders}
        for holder, mesh in (*holders, *((f"mesh {mesh}", mesh) for mesh in rest)):
            for number, primitive in enumerate(given["meshes"][mesh]["primitives"]):
                listed = primitive.get("mode", glb.TRIANGLES) in glb.LISTS
                one = primitive["attributes"]["POSITION"] if listed else f"primitive {number}"
                for attributes in (primitive["attributes"], *primitive.get("targets", [])):
                    for name, accessor in attributes.items():
                        self.users[accessor].add((holder, one, name == "TEXCOORD_0"))
                if "indices" in primitive:
                    self.users[primitive["indices"]].add((holder, number, "indices"))
        self.uses = [
            *(accessor.get("bufferView") for accessor in given["accessors"]),
            *(image.get("bufferView") for image in given.get("images", [])),
        ]

    def own_mesh(self, node: int) -> int:
        """Give a node a mesh that no node before it has; the first keeps its mesh."""
        meshes, mesh = self.scene["meshes"], self.given["nodes"][node]["mesh"]
        if node not in self.mesh_of_node:
            if mesh in self.mesh_of_node.values():
                meshes.append(deepcopy(self.given["meshes"][mesh]))
                self.scene["nodes"][node]["mesh"] = mesh = len(meshes) - 1
            self.mesh_of_node[node] = mesh
        return self.mesh_of_node[node]

    def set_texture(
        self, mesh: int, parts: list[tuple[Part, Ints]], vertex: Ints, texture: NDArray[np.float32]
    ) -> None:
        """Set the texture coordinates of primitives that share their vertices.

        Row k of `texture` belongs to ``vertex[k]``, ascending; corners are rows of `texture`.
        """
        n = len(parts[0][0].positions)
        again = np.flatnonzero(np.diff(vertex, prepend=-1) == 0)
        row = vertex.copy()
        row[again] = n + np.arange(len(again))
        rows = np.append(np.arange(n), vertex[again])
        whole = np.zeros((len(rows), 2), "<f4")
        whole[row] = texture
        made: int | None = None
        for part, corners in parts:
            primitive = self.scene["meshes"][mesh]["primitives"][part.primitive]
            attributes = primitive["attributes"]
            old = attributes.pop("TEXCOORD_0", None)
            primitive.get("extensions", {}).pop(
                "KHR_draco_mesh_compression", None
            )  # the same again
            if old is not None and "material" in primitive:
                self.materials.add(primitive["material"])
            self.textured.append(primitive)
            if len(again):
                for each in (attributes, *primitive.get("targets", [])):
                    for name, accessor in each.items():
                        each[name] = self._extended(mesh, part.accessor, accessor, rows)
                if (row[corners] != part.F).any():
                    self._set_indices(primitive, row[corners].ravel(), len(rows))
            if made is None:
                entry = {"componentType": glb.FLOAT, "type": "VEC2"}
                made = self._put(old, entry, whole.view(np.uint8))
            attributes["TEXCOORD_0"] = made

    def show(self, image: Image) -> None:
        """Let the primitives whose texture coordinates are replaced show an image.

        It takes the place of the images of their base colours, unless others show these, too.
        """
        scene = self.scene
        textures, images, materials = (
            scene.setdefault(name, []) for name in ("textures", "images", "materials")
        )
        if any("material" not in primitive for primitive in self.textured):
            materials.append({})
        base, before = list[dict[str, Any]](), list[int]()
        for primitive in self.textured:
            material = materials[primitive.setdefault("material", len(materials) - 1)]
            base.append(material.setdefault("pbrMetallicRoughness", {}))
            if info := base[-1].pop("baseColorTexture", None):
                before.append(info["index"])
        shown = (textures[info["index"]].get("source") for info in _textures_in(materials))
        others = {None, *shown}
        sources = dict.fromkeys(textures[number].get("source") for number in before)
        free = [source for source in sources if source not in others] or [len(images)]
        images += [{}] * (free[0] == len(images))
        new = {"bufferView": self._add({}, image.data), "mimeType": image.mime}
        for source in free:
            view = images[source].get("bufferView")
            if view is not None and self.uses.count(view) < 2:
                self.pieces[view] = b"\0"
            images[source] = {k: x for k, x in images[source].items() if k != "uri"} | new
        sampled = {k: x for one in before[:1] for k, x in textures[one].items() if k == "sampler"}
        self.shown = len(textures)
        textures.append({"source": free[0]} | sampled)
        for of in base:
            of["baseColorTexture"] = {"index": self.shown}

    def shows_old(self) -> bool:
        """Whether images are shown by texture coordinates that are replaced."""
        old = [self.scene["materials"][material] for material in self.materials]
        infos = [info for info in _textures_in(old) if info.get("texCoord", 0) == 0]
        return any(info["index"] != self.shown for info in infos)

    def _extended(self, mesh: int, group: int, accessor: int, rows: Ints) -> int:
        """Repeat rows of an attribute; what primitives share, they go on to share."""
        key = mesh, group, accessor
        if key not in self.extended:
            data = glb.rows_of_accessor(self.given, accessor, self.body, self.path)[rows]
            entry = self.given["accessors"][accessor]
            self.extended[key] = self._put(accessor, entry, data)
        return self.extended[key]

    def _set_indices(self, primitive: dict[str, Any], corners: Ints, n: int) -> None:
        old = primitive.get("indices")
        kind = glb.UNSIGNED_INT if old is None else self.given["accessors"][old]["componentType"]
        if n > np.iinfo(glb.COMPONENTS[kind]).max:  # which is no index
            kind = glb.UNSIGNED_INT
        data = corners.astype(glb.COMPONENTS[kind])[:, None].view(np.uint8)
        entry = {"componentType": kind, "type": "SCALAR"}
        primitive["indices"] = self._put(old, entry, data, glb.INDICES)
        primitive["mode"] = glb.TRIANGLES

    def _put(
        self,
        old: int | None,
        entry: dict[str, Any],
        rows: NDArray[np.uint8],
        target: int = glb.VERTICES,
    ) -> int:
        """Write rows of an attribute, or of indices, as an accessor; return its number."""
        entry = {name: entry[name] for name in entry if name not in ("byteOffset", "sparse")}
        view: dict[str, Any] = {"target": target}
        if target == glb.VERTICES:
            size = rows.shape[1]
            view["byteStride"] = size + -size % 4  # as the specification asks for
            rows = np.pad(rows, ((0, 0), (0, view["byteStride"] - size)))
        accessors = self.scene["accessors"]
        if old is None or len(self.users[old]) > 1:
            accessors.append({})
            number, at = len(accessors) - 1, None
        else:
            number, at = old, self.given["accessors"][old].get("bufferView")
            at = at if self.uses.count(at) == 1 else None
        if at is None:
            at = self._add(view, rows.tobytes())
        else:
            self.views[at], self.pieces[at] = view, rows.tobytes()
        accessors[number] = entry | {"bufferView": at, "count": len(rows)}
        return number

    def _add(self, view: dict[str, Any], data: bytes) -> int:
        self.views.append(view)
        self.pieces.append(data)
        return len(self.views) - 1


def _textures_in(value: Any) -> Iterator[dict[str, Any]]:
    """Yield what refers to a texture in materials."""
    if isinstance(value, dict) and "index" in value:
        yield value
    for part in (
        value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    ):
        yield from _textures_in(part)
