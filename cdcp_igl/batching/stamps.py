"""The mark in a file that says what it was made from.

It is what tells a result, which may be made again, from a file that somebody would miss. It
is a comment of the file's own format, so that other programs read the file as before.
"""

from __future__ import annotations

import json
import os
import re
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple
from zipfile import ZipFile

__all__ = ["Stamp", "put_stamp", "read_stamp"]

ENDS = 4096  # bytes at both ends of a file among which the mark is looked for
PNG_END = 12  # bytes of the last chunk of a png file


class Stamp(NamedTuple):
    """What a file was made from: a digest of the bytes of the input, and one of the options."""

    input: str
    options: str

    def __str__(self) -> str:
        return f"cdcp_igl: input {self.input} options {self.options}"


MARK = re.compile(rb"cdcp_igl: input ([0-9a-f]{64}) options ([0-9a-f]{16})")


def read_stamp(path: Path) -> Stamp | None:
    """Return the mark of a file, None if it has none."""
    with path.open("rb") as file:
        found = MARK.findall(file.read(ENDS))
        file.seek(max(file.seek(0, 2) - ENDS, 0))
        found += MARK.findall(file.read())
    # An obj file may have kept, among its comments, the mark of the one it was made from.
    return Stamp(*(digest.decode() for digest in found[-1])) if found else None


def put_stamp(path: Path, stamp: Stamp) -> None:
    """Mark a file that has just been written, and is not yet in its place."""
    _STAMPERS[path.suffix.lower()](path, str(stamp).encode())


def _append(template: bytes) -> Callable[[Path, bytes], None]:
    def put(path: Path, mark: bytes) -> None:
        with path.open("rb+") as file:
            file.seek(-1, os.SEEK_END)
            if file.read() != b"\n":  # an obj file as it was, perhaps with its last line open
                file.write(b"\n")
            file.write(template % mark)

    return put


def _into_archive(path: Path, mark: bytes) -> None:
    with ZipFile(path, "a") as archive:
        archive.comment = mark


def _into_ply(path: Path, mark: bytes) -> None:
    header, end, body = path.read_bytes().partition(b"end_header")
    path.write_bytes(b"%scomment %s\n%s%s" % (header, mark, end, body))


def _into_glb(path: Path, mark: bytes) -> None:
    data = path.read_bytes()
    (length,) = struct.unpack_from("<I", data, 12)
    scene = json.loads(data[20 : 20 + length])
    asset = scene.pop("asset")
    scene = {"asset": {**asset, "extras": {"made": mark.decode()}}, **scene}  # near the start
    text = json.dumps(scene, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    rest = data[20 + length :]
    head = struct.pack("<4sIIII", b"glTF", 2, 20 + len(text) + len(rest), len(text), 0x4E4F534A)
    path.write_bytes(head + text + rest)


def _into_png(path: Path, mark: bytes) -> None:
    data = path.read_bytes()
    chunk = b"tEXtComment\0" + mark
    text = struct.pack(">I", len(chunk) - 4) + chunk + struct.pack(">I", zlib.crc32(chunk))
    path.write_bytes(data[:-PNG_END] + text + data[-PNG_END:])


def _into_jpg(path: Path, mark: bytes) -> None:
    data = path.read_bytes()
    # The segment that tells the format has to stay the first one.
    end = 4 + struct.unpack_from(">H", data, 4)[0]
    comment = struct.pack(">2sH", b"\xff\xfe", len(mark) + 2) + mark
    path.write_bytes(data[:end] + comment + data[end:])


_STAMPERS: dict[str, Callable[[Path, bytes], None]] = {
    ".npz": _into_archive,
    ".obj": _append(b"# %s\n"),
    ".mtl": _append(b"# %s\n"),
    ".ply": _into_ply,
    ".glb": _into_glb,
    ".png": _into_png,
    ".jpg": _into_jpg,
    ".svg": _append(b"<!-- %s -->\n"),
    ".html": _append(b"<!-- %s -->\n"),
    ".pdf": _append(b"%% %s\n"),
}
