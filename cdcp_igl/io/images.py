"""Images that show a map on a surface: given ones, and the checkerboard."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Floats
from .output import whole_file, write_text

Texture = str | PathLike[str] | ArrayLike  # a file, or colours from 0 to 1

CELLS, CELL = 64, 16  # along a side; pixels of each
COLOURS = ((238, 238, 234), (70, 105, 150))
PNG, JPEG = b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff"
MATERIAL = """\
newmtl surface
Ka 1 1 1
Kd 1 1 1
Ks 0 0 0
"""
# What browsers show, and glTF 2.0 knows with its extension EXT_texture_webp.
MIME = {".png": "image/png", ".jpg": "image/jpeg", ".jpeg": "image/jpeg", ".webp": "image/webp"}
MAPS = ("map_", "bump", "disp", "decal", "norm", "refl")  # lines of mtl files that name images


class Image(NamedTuple):
    """A PNG or JPEG file."""

    data: bytes
    mime: str
    suffix: str


def as_image(image: Texture) -> Image:
    """Take an image: a file, the checkerboard by its name, or colours from 0 to 1.

    ValueError if a file is neither PNG nor JPEG, or an array is not (height, width, 3 or 4).
    """
    if not isinstance(image, str | PathLike):
        return png(np.rint(255 * colours(image)).astype(np.uint8))
    if image == "checkerboard":
        return checkerboard()
    data = Path(image).read_bytes()
    if data.startswith(PNG):
        return Image(data, "image/png", ".png")
    if data.startswith(JPEG):
        return Image(data, "image/jpeg", ".jpg")
    raise ValueError(f"{str(image)!r} is no PNG or JPEG image")


def colours(image: ArrayLike) -> Floats:
    """Take an array as an image (height, width, 3 or 4) of colours from 0 to 1, or ValueError."""
    if np.iscomplexobj(image):
        raise ValueError("the colours of a texture must be real")
    colors = np.asarray(image, dtype=np.float64)
    if colors.ndim != 3 or colors.shape[2] not in (3, 4) or colors.size == 0:
        raise ValueError(f"texture has shape {colors.shape}; it must be (height, width, 3 or 4)")
    if not (colors.min() >= 0 and colors.max() <= 1):  # NaN is neither
        raise ValueError("the colours of a texture must lie between 0 and 1")
    return colors


def checkerboard() -> Image:
    """Draw squares in two colours: angles show by their corners, areas by their size."""
    pixel = np.arange(CELLS * CELL) // CELL
    odd = (pixel[:, None] + pixel) % 2
    return png(np.array(COLOURS, dtype=np.uint8)[odd])


def png(pixels: NDArray[np.uint8]) -> Image:
    """Write pixels (height, width, 3 or 4), RGB or RGBA, as a PNG file."""
    height, width, channels = pixels.shape
    # Each row begins with its filter, 0 for none.
    rows = np.column_stack([np.zeros(height, np.uint8), pixels.reshape(height, -1)])
    header = struct.pack(">2I5B", width, height, 8, 2 if channels == 3 else 6, 0, 0, 0)  # 8 bits
    data = zlib.compress(rows.tobytes(), 9)
    chunks = ((b"IHDR", header), (b"IDAT", data), (b"IEND", b""))
    return Image(PNG + b"".join(_chunk(*chunk) for chunk in chunks), "image/png", ".png")


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def write_material(path: Path, image: Image, given: Iterable[Path] = ()) -> str:
    """Write the mtl file of an obj file, and its image, beside it; return the name.

    Of `given` mtl files, all materials are kept and show this image; others, which fit their old
    texture coordinates, go.
    """
    materials, picture = path.with_suffix(".mtl"), path.with_suffix(image.suffix)
    text, shown = "", f"map_Kd {picture.name}\n"
    for line in "\n".join(file.read_text("utf-8", "replace") for file in given).splitlines():
        keyword = line.split()[:1]
        if keyword and keyword[0].lower().startswith(MAPS):
            continue
        text += f"{line}\n{shown if keyword == ['newmtl'] else ''}"
    with whole_file(picture) as unfinished:
        unfinished.write_bytes(image.data)
    write_text(materials, text or MATERIAL + shown)
    return materials.name
