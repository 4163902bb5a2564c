"""A given ply file again, with other texture coordinates and otherwise as it is."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from . import ply
from .ply import Element, Property
from .polygons import rows_of_triangles

Block = NDArray[Any]  # (n, ...) what n rows have of a property: bytes or, in ascii, words

AT_VERTICES = [Property("s", "double"), Property("t", "double")]  # as Blender names them
TRIANGLES = Property("vertex_indices", "int", "uchar")  # instead of strips


class Change(NamedTuple):
    """What becomes of an element, and its rows, as they are written."""

    name: str
    rows: int
    dropped: set[int]  # properties
    new: list[Property]
    body: list[bytes]


def write_ply_like(path: Path, given: Path, V: Floats, texture: Floats, FT: Ints | None) -> None:
    """Write a given ply file again, with other texture coordinates, in double precision.

    The encoding, comments, types, all other properties and elements stay as they are; numbers in
    ascii do as they are written. Only a polygon that was cut open within is written as triangles,
    and so are strips. `texture` and `FT` are as for `write_ply`, of the faces that `read_ply` makes
    of `given`, whose vertices are V.
    """
    file = _Rows(given.read_bytes())
    changes, of_faces = [], any(element.name == "face" for element, _ in file.found)
    for element, runs in file.found:
        pieces = [file.blocks(element, rows) for rows in runs]
        name, new, dropped = element.name, list[Property](), _old_texture(element)
        if FT is None and name == "vertex":
            new, ends = AT_VERTICES, np.cumsum([len(rows) for rows in runs])[:-1]
            for blocks, uv in zip(pieces, np.split(texture, ends), strict=True):
                blocks += [file.encoded(new[k], uv[:, [k]]) for k in (0, 1)]
        elif FT is not None and name == "face":
            new = [_texcoord(max((len(rows[_corners(element)][0]) for rows in runs), default=0))]
            pieces = list(_textured(file, element, runs, pieces, V, texture, FT, new[0]))
        elif FT is not None and name == "tristrips" and not of_faces:
            _, F, _ = ply.read_ply(given)
            name, new, dropped = "face", [TRIANGLES, _texcoord(3)], set(range(len(pieces[0])))
            old = [np.empty((len(F), 0), pieces[0][0].dtype) for _ in dropped]
            corners = (F, texture[FT].reshape(-1, 6))
            pieces = [[*old, *map(file.encoded, new, corners)]]
        kept = [
            np.hstack([block for k, block in enumerate(blocks) if k not in dropped])
            for blocks in pieces
        ]
        body = [file.joined(rows) for rows in kept]
        changes.append(Change(name, sum(map(len, kept)), dropped, new, body))
    with path.open("wb") as out:
        out.writelines(file.header(changes))
        for change in changes:
            out.writelines(change.body)
        out.write(file.rest)


def _old_texture(element: Element) -> set[int]:
    """Which properties are texture coordinates."""
    names = [column.name for column in element.properties]
    pairs = [pair for pair in ply.TEXTURE if element.name == "vertex" and {*pair} <= {*names}]
    old = [name for pair in pairs for name in pair]
    old += ["texcoord"] * (element.name == "face")
    return {k for k, name in enumerate(names) if name in old}


def _corners(element: Element) -> str:
    """Name the field of rows that has the vertices of a polygon."""
    return next(f"entries {k}" for k, it in enumerate(element.properties) if it.name in ply.INDICES)


def _texcoord(corners: int) -> Property:
    return Property("texcoord", "double", "uchar" if 2 * corners < 256 else "uint")


def _textured(
    file: _Rows,
    element: Element,
    runs: list[NDArray[Any]],
    pieces: list[list[Block]],
    V: Floats,
    texture: Floats,
    FT: Ints,
    texcoord: Property,
) -> Iterator[list[Block]]:
    """Yield rows of faces with their texture coordinates; some in triangles, where a cut is."""
    name = _corners(element)
    column = int(name.split()[1])
    vertices = [rows[name].astype(np.int64) for rows in runs]
    sizes = np.concatenate([np.full(*polygons.shape) for polygons in vertices])
    triangles, _ = rows_of_triangles(V, np.concatenate([*map(np.ravel, vertices)]), sizes)
    start = face = 0
    for polygons, blocks in zip(vertices, pieces, strict=True):
        n, k = polygons.shape
        those = slice(face, face + n * (k - 2))
        corners = triangles[those].reshape(n, -1) - (start + k * np.arange(n)[:, None])
        at_corners, at = FT[those].reshape(n, -1), np.zeros((n, k), np.int64)
        start, face = start + n * k, those.stop
        np.put_along_axis(at, corners, at_corners, 1)
        whole = (np.take_along_axis(at, corners, 1) == at_corners).all(axis=1)
        for some in np.split(np.arange(n), 1 + np.flatnonzero(np.diff(whole))):
            rows, there = [block[some] for block in blocks], at[some]
            if not whole[some[0]]:
                rows, there = [np.repeat(block, k - 2, axis=0) for block in rows], at_corners[some]
                F = np.take_along_axis(polygons[some], corners[some], 1).reshape(-1, 3)
                rows[column] = file.encoded(element.properties[column], F)
                there = there.reshape(-1, 3)
            uv = texture[there].reshape(len(there), -1)
            yield [*rows, file.encoded(texcoord, uv)]


class _Rows:
    """A file taken apart into what its rows have of each property, in bytes or in words."""

    def __init__(self, data: bytes) -> None:
        encoding, _, body = ply.parse_header(data)
        self.found, self.types, end = ply.runs_of_elements(data)
        lines = data[: len(data) - len(body)]
        ends = [found.end() for found in ply.END_OF_LINE.finditer(lines)]
        self.lines = [lines[i:j] for i, j in zip([0, *ends], ends, strict=False)]
        self.newline = self.lines[0].lstrip(b"ply \t")
        self.in_words = encoding == "ascii"
        self.cells: Block = (
            np.array(body.split(), object) if self.in_words else np.frombuffer(body, np.uint8, end)
        )
        self.rest = b"" if self.in_words else body[end:]

    def blocks(self, element: Element, rows: NDArray[Any]) -> list[Block]:
        """Return the next rows, apart by property."""
        unit = 8 if self.in_words else 1  # as which words were read
        width, fields = rows.dtype.itemsize // unit, dict(rows.dtype.fields or {})
        first = [
            fields[f"{'length' if column.length_type else 'entries'} {k}"][1] // unit
            for k, column in enumerate(element.properties)
        ]
        cells, self.cells = np.split(self.cells, [len(rows) * width])
        return np.split(cells.reshape(len(rows), width), first[1:], axis=1)

    def encoded(self, column: Property, values: NDArray[Any]) -> Block:
        """Write values (n, k) as a property, a row each."""
        if self.in_words:
            words = [[b"%d" % len(row)] * bool(column.length_type) for row in values]
            for word, row in zip(words, values.tolist(), strict=True):
                word += [repr(value).encode() for value in row]
            return np.array(words, object)
        entries = np.ascontiguousarray(values, self.types[column.type]).view(np.uint8)
        if not column.length_type:
            return entries
        length = np.full((len(values), 1), values.shape[1], self.types[column.length_type])
        return np.hstack([length.view(np.uint8), entries])

    def joined(self, rows: Block) -> bytes:
        """Return the rows as they are in the file."""
        if not self.in_words:
            return rows.tobytes()
        return b"".join(b" ".join(row) + self.newline for row in rows.tolist())

    def header(self, changes: list[Change]) -> Iterator[bytes]:
        """Yield the lines of the header, of which only those of changed properties change."""
        following, number = iter(changes), 0
        change = Change("", 0, set(), [], [])
        for line in self.lines:
            keyword, *words = line.split() or [b""]
            if keyword in (b"element", b"end_header"):
                for column in change.new:
                    of = f"list {column.length_type} " if column.length_type else ""
                    yield f"property {of}{column.type} {column.name}".encode() + self.newline
            if keyword == b"element":
                change, number = next(following), 0
                if words != (new := [change.name.encode("latin-1"), b"%d" % change.rows]):
                    line = b" ".join([keyword, *new]) + self.newline
            if keyword == b"property":
                number += 1
                if number - 1 in change.dropped:
                    continue
            yield line
