"""The images that a file shows on its surface, and where."""

from __future__ import annotations

import struct
from base64 import b64decode
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from ..errors import Damage, Defect, MeshError
from ..extras import from_extra
from . import glb, ply
from .obj import material_files
from .reading import file_to_read
from .text import decoded, read_obj, words_of_lines
from .texture import read_texture


class Painted(NamedTuple):
    """Images (height, width, 3 or 4) from 0 to 1, the one (m,) of each face, -1 for none, and uv.

    `uv` (m, 3, 2) are places of the corners of the faces of `read_mesh`, v upwards.
    """

    images: list[Floats]
    of_face: Ints
    uv: Floats


def images_of(path: Path) -> Painted:
    """Read what a file shows on its surface; MeshError if that is nothing."""
    uv = read_texture(path)[2]
    with file_to_read(path):
        files, of_face, uv = IMAGES[path.suffix.lower()](path, uv)
    if not files:
        raise MeshError(Defect.of("unreadable file", reason=f"{path.name!r} shows no image"))
    return Painted([pixels(file) for file in files], of_face, uv)


def pixels(file: Path | bytes) -> Floats:
    """(height, width, 3 or 4) colours from 0 to 1; ValueError if it is no image."""
    with from_extra("plot"):
        from PIL import Image
    data = file if isinstance(file, bytes) else file.read_bytes()
    try:
        with Image.open(BytesIO(data)) as image:
            image.load()
            has_alpha = image.mode in ("RGBA", "LA", "PA") or "transparency" in image.info
            return np.asarray(image.convert("RGBA" if has_alpha else "RGB")) / 255
    except (OSError, SyntaxError, ValueError, struct.error, Image.DecompressionBombError) as error:
        name = "an image within" if isinstance(file, bytes) else repr(file.name)
        raise ValueError(f"{name} is no image, or damaged: {error}") from None


Found = tuple[list[Any], Ints, Floats]  # files or bytes, the one of each face, and uv


def _of_gltf(path: Path, uv: Floats) -> Found:
    scene, body = glb.scene_and_body(path)
    names, of_face, m = list[int](), np.full(len(uv), -1), 0
    for part in glb.parts_of(scene, body, path):
        faces = slice(m, m := m + len(part.F))
        primitive = glb.primitive_of(scene, part)
        info = base_texture(scene, primitive.get("material"))
        image = scene["textures"][info["index"]].get("source") if info else None
        if info is None or image is None:  # which is of a type that an extension knows
            continue
        if image not in names:
            names.append(image)
        of_face[faces] = names.index(image)
        if number := info.get("texCoord", 0):
            uv[faces] = glb.texture_of(scene, primitive, number, body, path)[part.outward]
        uv[faces] = _transformed(uv[faces], info)
    return [_image_of_gltf(scene, body, path, scene["images"][k]) for k in names], of_face, uv


def base_texture(scene: dict[str, Any], material: int | None) -> dict[str, Any] | None:
    """Return the texture of the base colours of a material, if it has one."""
    if material is None:
        return None
    info: dict[str, Any] | None = (
        scene["materials"][material].get("pbrMetallicRoughness", {}).get("baseColorTexture")
    )
    return info


def _transformed(uv: Floats, info: dict[str, Any]) -> Floats:
    """Apply KHR_texture_transform, which has v downwards."""
    change = info.get("extensions", {}).get("KHR_texture_transform")
    if not change:
        return uv
    angle = change.get("rotation", 0.0)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    down = (uv * [1, -1] + [0, 1]) * change.get("scale", 1) @ turn.T + change.get("offset", 0)
    return down * [1, -1] + [0, 1]


def _image_of_gltf(
    scene: dict[str, Any], body: bytes, path: Path, image: dict[str, Any]
) -> Path | bytes:
    if "bufferView" in image:
        return glb.piece(scene, scene["bufferViews"][image["bufferView"]], body, path)
    if image["uri"].startswith("data:"):
        return b64decode(image["uri"].partition(",")[2])
    return _beside(path, unquote(image["uri"]))


def _beside(path: Path, name: str) -> Path:
    beside = path.parent / name.replace("\\", "/")
    if not beside.is_file():
        raise Damage(f"its image {beside.name!r} is not beside it")
    return beside


def _of_obj(path: Path, uv: Floats) -> Found:
    materials, of_polygon, files, current = list[str](), list[int](), dict[str, Path](), ""
    for library in material_files(path):
        files |= images_of_materials(library)
    for _, (keyword, *words) in words_of_lines(path, continued=True):
        if keyword == "usemtl":
            current = " ".join(words)
        elif keyword == "f":
            if current not in materials:
                materials.append(current)
            of_polygon.append(materials.index(current))
    named = list(dict.fromkeys(files[name] for name in materials if name in files))
    image = [named.index(files[name]) if name in files else -1 for name in materials]
    return named, np.array(image)[of_polygon][read_obj(path)[2]], uv


def images_of_materials(path: Path) -> dict[str, Path]:
    """Return the image that each material of a mtl file shows by ``map_Kd``."""
    images, name = dict[str, Path](), ""
    for _, (keyword, *words) in words_of_lines(path):
        if keyword == "newmtl":
            name = " ".join(words)
        elif keyword == "map_Kd" and words:
            whole = path.parent / decoded(" ".join(words))
            images[name] = whole if whole.is_file() else _beside(path, decoded(words[-1]))
    return images


def _of_ply(path: Path, uv: Floats) -> Found:
    data = path.read_bytes()
    _, _, body = ply.parse_header(data)
    lines = data[: len(data) - len(body)].decode("latin-1").splitlines()
    begin = "comment TextureFile "  # of MeshLab
    names = [line[len(begin) :].strip() for line in lines if line.startswith(begin)]
    of_face = np.zeros(len(uv), np.int64)
    if numbers := ply.read_tables(data).get("face", {}).get("texnumber"):
        of_face = numbers.entries.astype(np.int64)[ply.read_ply(path)[2]]
    return [_beside(path, decoded(name)) for name in names], of_face, uv


IMAGES: dict[str, Callable[[Path, Floats], Found]] = {
    ".glb": _of_gltf,
    ".gltf": _of_gltf,
    ".obj": _of_obj,
    ".ply": _of_ply,
}


def colours_at(image: Floats, uv: Floats, *, nearest: bool = False) -> NDArray[np.float64]:
    """(k, channels) bilinear colours of an image at points (k, 2); beside the square it repeats."""
    from scipy.ndimage import map_coordinates  # slow to import, and used here alone

    height, width = image.shape[:2]
    at = [(1 - uv[:, 1]) * height - 0.5, uv[:, 0] * width - 0.5]
    order = 0 if nearest else 1
    channels = [
        map_coordinates(image[..., k], at, order=order, mode="grid-wrap")
        for k in range(image.shape[2])
    ]
    return np.stack(channels, axis=1)
