"""Polygon file format, ply: ascii and both binary forms read, little-endian written."""

from __future__ import annotations

from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from .polygons import fans

__all__ = ["read_ply", "write_ply"]

TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"},
    **{"float": "f4", "double": "f8", "float32": "f4", "float64": "f8"},
}
BYTE_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}
INDICES = ("vertex_indices", "vertex_index")


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


def read_ply(path: Path) -> tuple[Floats, Ints]:
    """(n, 3) vertices and (m, 3) faces; all faces must have the same number of corners."""
    header, end, body = path.read_bytes().partition(b"end_header")
    if not header.startswith(b"ply") or not end:
        raise ValueError("it has no ply header")
    encoding, elements = _parse_header(header.decode("latin-1"))
    body = body[body.index(b"\n") + 1 :]
    if encoding == "ascii":
        tables = _ascii_tables(body, elements)
    else:
        tables = _binary_tables(body, elements, BYTE_ORDERS[encoding])
    try:
        V = np.column_stack([tables["vertex"][axis] for axis in "xyz"]).astype(np.float64)
    except KeyError as error:
        raise ValueError(f"it has no {error}") from error
    faces = tables.get("face", {})
    polygons = next((faces[name] for name in INDICES if name in faces), np.empty((0, 3)))
    return V, fans(polygons.astype(np.int64).ravel(), np.full(*polygons.shape))


def _parse_header(header: str) -> tuple[str, list[Element]]:
    """Return the encoding, and the tables in their order."""
    encoding, elements = "", list[Element]()
    for line in header.splitlines()[1:]:
        match line.split():
            case ["format", "ascii" | "binary_little_endian" | "binary_big_endian" as encoding, _]:
                pass
            case ["element", name, count] if count.isdecimal():
                elements.append(Element(name, int(count), []))
            case ["property", "list", length, kind, name] if {length, kind} <= TYPES.keys():
                elements[-1].properties.append(Property(name, TYPES[kind], TYPES[length]))
            case ["property", kind, name] if kind in TYPES:
                elements[-1].properties.append(Property(name, TYPES[kind]))
            case ["comment" | "obj_info", *_] | []:
                pass
            case _:
                raise ValueError(f"its header says {line!r}")
    if not encoding:
        raise ValueError("its header does not state the format")
    return encoding, elements


# A table maps the name of a property to its column: (count,), or (count, k) for lists, all
# of which must have the length k of the first.
Table = dict[str, NDArray[Any]]


def _ascii_tables(body: bytes, elements: list[Element]) -> dict[str, Table]:
    lines = iter(body.splitlines())
    tables = {}
    for name, count, properties in elements:
        rows = list(islice(lines, count))
        if len(rows) < count:
            raise ValueError(f"it ends after {len(rows):,} rows of {count:,} in {name}")
        values = np.loadtxt(rows, comments=None, ndmin=2) if rows else np.empty((0, 0))
        table = tables[name] = Table()
        at = 0
        for column in properties if rows else ():
            if column.length_type:
                length = _common_length(values[:, at], column)
                table[column.name] = values[:, at + 1 : at + 1 + length]
                at += 1 + length
            else:
                table[column.name] = values[:, at]
                at += 1
    return tables


def _binary_tables(body: bytes, elements: list[Element], order: str) -> dict[str, Table]:
    tables = {}
    start = 0
    for name, count, properties in elements:
        fields: list[tuple[Any, ...]] = []
        for column in properties if count else ():
            kind = order + column.type
            if column.length_type:
                length_type = order + column.length_type
                offset = start + np.dtype(fields).itemsize
                length = int(np.frombuffer(body, length_type, 1, offset)[0])
                fields += [(f"{column.name}: length", length_type), (column.name, kind, (length,))]
            else:
                fields.append((column.name, kind))
        row = np.dtype(fields)
        values = np.frombuffer(body, row, count, start) if count else np.empty(0, row)
        for column in properties if count else ():
            if column.length_type:
                _common_length(values[f"{column.name}: length"], column)
        tables[name] = {column: values[column] for column in row.names or ()}
        start += values.nbytes
    return tables


def _common_length(lengths: NDArray[Any], column: Property) -> int:
    if (lengths != lengths[0]).any():
        raise ValueError(f"its {column.name} differ in length: triangulate the polygons first")
    return int(lengths[0])


def write_ply(path: Path, V: Floats, F: Ints, uv: Floats) -> None:
    """Write a surface in double precision, binary, texture coordinates as u and v."""
    vertices = np.column_stack([V, uv]).astype("<f8")
    faces = np.empty(len(F), np.dtype([("size", "u1"), ("corners", "<i4", (3,))]))
    faces["size"], faces["corners"] = 3, F
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {len(V)}",
        *(f"property double {axis}" for axis in "xyzuv"),
        f"element face {len(F)}",
        "property list uchar int vertex_indices",
        "end_header\n",
    ]
    with path.open("wb") as file:
        file.write("\n".join(header).encode("ascii"))
        file.write(vertices.tobytes())
        file.write(faces.tobytes())
