"""Images that show a map on a surface: given ones, and the checkerboard."""

from __future__ import annotations

import struct
import zlib
from os import PathLike
from pathlib import Path
from typing import NamedTuple

import numpy as np

from .output import whole_file, write_text

CELLS, CELL = 64, 16  # along a side; pixels of each
COLOURS = ((238, 238, 234), (70, 105, 150))
PNG, JPEG = b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff"
MATERIAL = """\
newmtl surface
Ka 1 1 1
Kd 1 1 1
Ks 0 0 0
map_Kd {image}
"""


class Image(NamedTuple):
    """A PNG or JPEG file."""

    data: bytes
    mime: str
    suffix: str


def read_image(path: str | PathLike[str]) -> Image:
    """Read a file; ValueError if it is neither PNG nor JPEG."""
    data = Path(path).read_bytes()
    if data.startswith(PNG):
        return Image(data, "image/png", ".png")
    if data.startswith(JPEG):
        return Image(data, "image/jpeg", ".jpg")
    raise ValueError(f"{str(path)!r} is no PNG or JPEG image")


def checkerboard() -> Image:
    """Draw squares in two colours: angles show by their corners, areas by their size."""
    pixel = np.arange(CELLS * CELL) // CELL
    odd = (pixel[:, None] + pixel) % 2
    rows = np.array(COLOURS, dtype=np.uint8)[odd].reshape(len(pixel), -1)
    # Each row begins with its filter, 0 for none.
    data = np.column_stack([np.zeros(len(rows), np.uint8), rows]).tobytes()
    header = struct.pack(">2I5B", len(pixel), len(pixel), 8, 2, 0, 0, 0)  # 8 bits, RGB
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(data, 9)), (b"IEND", b""))
    return Image(PNG + b"".join(_chunk(*chunk) for chunk in chunks), "image/png", ".png")


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def write_material(path: Path, image: Image) -> str:
    """Write the mtl file of an obj file, and its image, beside it; return the name."""
    materials, picture = path.with_suffix(".mtl"), path.with_suffix(image.suffix)
    with whole_file(picture) as unfinished:
        unfinished.write_bytes(image.data)
    write_text(materials, MATERIAL.format(image=picture.name))
    return materials.name
