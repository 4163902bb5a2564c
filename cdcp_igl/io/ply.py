"""Polygon file format, ply: ascii and both binary forms read, little-endian written."""

from __future__ import annotations

import re
from array import array
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from .damage import Damage
from .polygons import fans, strips

__all__ = ["read_ply", "write_ply"]

TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"},
    **{"float": "f4", "double": "f8", "float32": "f4", "float64": "f8"},
}
BYTE_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}
INDICES = ("vertex_indices", "vertex_index")
END_OF_LINE = re.compile(rb"\r\n|\n|\r")
MOST_ENTRIES = 1 << 16  # of a list, and no polygon has more; a wrong one claims gigabytes


class Property(NamedTuple):
    """A column of an element; a list has a type for its length."""

    name: str
    type: str
    length_type: str | None = None


class Element(NamedTuple):
    """A table of the file."""

    name: str
    rows: int
    properties: list[Property]


class Lists(NamedTuple):
    """A column of lists."""

    entries: NDArray[Any]  # of all rows, one after the other
    lengths: NDArray[Any]


# The columns of an element: numbers, or lists.
Table = dict[str, "NDArray[Any] | Lists"]


def read_ply(path: Path) -> tuple[Floats, Ints, Ints]:
    """(n, 3) vertices, (m, 3) faces and (m,) their polygons."""
    encoding, elements, body = _parse_header(path.read_bytes())
    if encoding == "ascii":
        tables = _ascii_tables(body, elements)
    else:
        tables = _binary_tables(body, elements, BYTE_ORDERS[encoding])
    vertices, faces = tables.get("vertex", {}), tables.get("face", {})
    axes = [vertices[axis] for axis in "xyz" if axis in vertices]
    if len(axes) < 3 or any(isinstance(axis, Lists) for axis in axes):
        raise Damage("its vertices have no x, y and z")
    V = np.column_stack(axes).astype(np.float64)
    polygons = next((faces[name] for name in INDICES if name in faces), None)
    if polygons is None:
        return V, *_from_strips(tables.get("tristrips", {}))
    if not isinstance(polygons, Lists):
        raise Damage("its faces are no lists of vertices")
    corners = polygons.entries.astype(np.int64)
    if (corners != polygons.entries).any():
        raise Damage("its faces have indices that are no integers")
    return V, *fans(corners, polygons.lengths)


def _from_strips(table: Table) -> tuple[Ints, Ints]:
    found = next((table[name] for name in INDICES if name in table), None)
    if found is not None and not isinstance(found, Lists):
        raise Damage("its strips are no lists of vertices")
    # Each row is a strip, or has several.
    rows = []
    if found is not None:
        ends = np.cumsum(found.lengths.astype(np.int64))
        rows = np.split(found.entries.astype(np.int64), ends[:-1])
    F = np.vstack([np.empty((0, 3), np.int64), *map(strips, rows)])
    return F, np.arange(len(F))


def _parse_header(data: bytes) -> tuple[str, list[Element], bytes]:
    """Return the encoding, the tables in their order, and what follows the header."""
    encoding, elements, at = "", list[Element](), 0
    for end in END_OF_LINE.finditer(data):
        line = data[at : end.start()].decode("latin-1")
        first, at = at == 0, end.end()
        match line.split():
            case ["ply"] if first:
                continue
            case _ if first:
                break
            case ["end_header"]:
                if not encoding:
                    raise Damage("its header does not state the format")
                return encoding, elements, data[at:]
            case ["format", "ascii" | "binary_little_endian" | "binary_big_endian" as encoding, _]:
                pass
            case ["element", name, count] if count.isdecimal():
                elements.append(Element(name, int(count), []))
            case ["property", "list", length, kind, name] if (
                elements and TYPES.get(length, "f")[0] != "f" and kind in TYPES
            ):
                elements[-1].properties.append(Property(name, TYPES[kind], TYPES[length]))
            case ["property", kind, name] if elements and kind in TYPES:
                elements[-1].properties.append(Property(name, TYPES[kind]))
            case ["comment" | "obj_info", *_] | []:
                pass
            case _:
                raise Damage(f"its header says {line!r}")
    raise Damage("it has no ply header, or no end of it")


def _ascii_tables(body: bytes, elements: list[Element]) -> dict[str, Table]:
    lines = (line for line in body.splitlines() if line.strip())
    tables = {}
    for name, count, properties in elements:
        rows = list(islice(lines, count))
        if len(rows) < count:
            raise Damage(f"it ends after {len(rows):,} rows of {count:,} in {name}")
        # As a rule all lists are as long as those of the first row, and numpy reads them.
        tables[name] = _ascii_equal(rows, properties) or _ascii_unequal(rows, name, properties)
    return tables


def _ascii_equal(rows: list[bytes], properties: list[Property]) -> Table | None:
    """Read a table all of whose lists are as long as in its first row; None if it is not."""
    try:
        values = np.loadtxt(rows, comments=None, ndmin=2) if rows else np.empty((0, 0))
    except ValueError:
        return None
    if len(values) != len(rows):  # numpy leaves out what it takes for a blank line
        return None
    table = Table()
    at = 0
    for column in properties if rows else ():
        length = 1
        if column.length_type and at < values.shape[1]:
            lengths = values[:, at]
            if (lengths != lengths[0]).any() or not 0 <= lengths[0] == int(lengths[0]):
                return None
            length = int(lengths[0])
            at += 1
        entries = values[:, at : at + length]
        at += length
        if at > values.shape[1]:
            return None
        table[column.name] = (
            Lists(entries.ravel(), lengths) if column.length_type else entries[:, 0]
        )
    return table


def _ascii_unequal(rows: list[bytes], name: str, properties: list[Property]) -> Table:
    """Read a table row by row."""
    entries = [array("d") for _ in properties]
    lengths = [array("q") for _ in properties]
    for number, row in enumerate(rows, 1):
        words = iter(row.split())
        try:
            for column, values, sizes in zip(properties, entries, lengths, strict=True):
                sizes.append(int(next(words)) if column.length_type else 1)
                before = len(values)
                values.extend(map(float, islice(words, sizes[-1])))
                if len(values) != before + sizes[-1]:
                    raise ValueError
        except (ValueError, OverflowError, StopIteration):
            raise Damage(f"row {number:,} of {name} is not what the header says") from None
    return {
        column.name: Lists(np.array(values), np.array(sizes))
        if column.length_type
        else np.array(values)
        for column, values, sizes in zip(properties, entries, lengths, strict=True)
    }


def _binary_tables(body: bytes, elements: list[Element], order: str) -> dict[str, Table]:
    tables = {}
    start = 0
    for name, count, properties in elements:
        if count:
            # As a rule all lists are as long as those of the first row, and numpy reads them.
            read = _equal_rows(body, start, count, properties, order)
            table, start = read or _unequal_rows(body, start, count, properties, order)
        else:
            table = {}
        tables[name] = table
    return tables


def _number(body: bytes, kind: str, at: int) -> Any:
    if at + np.dtype(kind).itemsize > len(body):
        raise Damage("it is cut off")
    return np.frombuffer(body, kind, 1, at)[0]


def _length(body: bytes, kind: str, at: int) -> int:
    length = int(_number(body, kind, at))
    if not 0 <= length <= MOST_ENTRIES:
        raise Damage(f"it has a list of {length:,} entries")
    return length


def _equal_rows(
    body: bytes, start: int, count: int, properties: list[Property], order: str
) -> tuple[Table, int] | None:
    """Read a table all of whose lists are as long as in its first row; None if it is not."""
    fields: list[tuple[Any, ...]] = []
    for k, column in enumerate(properties):
        kind = order + column.type
        if column.length_type:
            length_type = order + column.length_type
            length = _length(body, length_type, start + np.dtype(fields).itemsize)
            fields += [(f"length {k}", length_type), (f"entries {k}", kind, (length,))]
        else:
            fields.append((f"entries {k}", kind))
    row = np.dtype(fields)
    if start + count * row.itemsize > len(body):
        return None
    values = np.frombuffer(body, row, count, start)
    table = Table()
    for k, column in enumerate(properties):
        entries = values[f"entries {k}"]
        if column.length_type:
            lengths = values[f"length {k}"]
            if (lengths != lengths[0]).any():
                return None
            table[column.name] = Lists(entries.ravel(), lengths)
        else:
            table[column.name] = entries
    return table, start + values.nbytes


def _unequal_rows(
    body: bytes, start: int, count: int, properties: list[Property], order: str
) -> tuple[Table, int]:
    """Read a table row by row."""
    entries: list[list[NDArray[Any]]] = [[] for _ in properties]
    lengths: list[list[int]] = [[] for _ in properties]
    at = start
    for _ in range(count):
        for column, values, sizes in zip(properties, entries, lengths, strict=True):
            length = 1
            if column.length_type:
                length = _length(body, order + column.length_type, at)
                at += np.dtype(column.length_type).itemsize
            kind = np.dtype(order + column.type)
            if at + length * kind.itemsize > len(body):
                raise Damage("it is cut off")
            values.append(np.frombuffer(body, kind, length, at))
            sizes.append(length)
            at += length * kind.itemsize
    table = Table()
    for column, values, sizes in zip(properties, entries, lengths, strict=True):
        joined = np.concatenate(values)
        table[column.name] = Lists(joined, np.array(sizes)) if column.length_type else joined
    return table, at


def write_ply(path: Path, V: Floats, F: Ints, texture: Floats, FT: Ints | None) -> None:
    """Write a surface in double precision, binary.

    Parameters
    ----------
    path : Path
    V : (n, 3) float64
    F : (m, 3) int64
    texture : (n, 2) or (k, 2) float64
        Properties u and v of the vertices; or, with `FT`, a list ``texcoord`` of each face:
        u and v at its first corner, its second and its third.
    FT : (m, 3) int64 or None
        Rows of `texture` at the corners of the faces.
    """
    vertices = V if FT is not None else np.column_stack([V, texture])
    columns = [("size", "u1"), ("corners", "<i4", (3,))]
    if FT is not None:
        columns += [("texture size", "u1"), ("texture", "<f8", (6,))]
    faces = np.empty(len(F), np.dtype(columns))
    faces["size"], faces["corners"] = 3, F
    if FT is not None:
        faces["texture size"], faces["texture"] = 6, texture[FT].reshape(-1, 6)
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {len(V)}",
        *(f"property double {axis}" for axis in "xyzuv"[: vertices.shape[1]]),
        f"element face {len(F)}",
        "property list uchar int vertex_indices",
        *(["property list uchar double texcoord"] if FT is not None else []),
        "end_header\n",
    ]
    with path.open("wb") as file:
        file.write("\n".join(header).encode("ascii"))
        file.write(vertices.astype("<f8").tobytes())
        file.write(faces.tobytes())
