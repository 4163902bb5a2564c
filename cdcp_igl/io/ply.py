"""Polygon file format, ply: ascii and both binary forms read, little-endian written."""

from __future__ import annotations

import re
from array import array
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from ..errors import Damage
from .polygons import rows_of_triangles, strips, triangles_of
from .text import culprit

TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"},
    **{"float": "f4", "double": "f8", "float32": "f4", "float64": "f8"},
}
BYTE_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}
INDICES = ("vertex_indices", "vertex_index")
COLOURS = ("red", "green", "blue", "alpha")
TEXTURE = (("u", "v"), ("s", "t"), ("texture_u", "texture_v"))  # of vertices; faces have texcoord
HEADER = 1 << 16  # bytes in which that of a file of triangles ends
END_OF_LINE = re.compile(rb"\r\n|\n|\r")


class Property(NamedTuple):
    """A column of an element, with types as ply names them; a list has one for its length."""

    name: str
    type: str
    length_type: str | None = None


class Element(NamedTuple):
    """A table of the file."""

    name: str
    rows: int
    properties: list[Property]


class Column(NamedTuple):
    """What a file has of a property: the entries of all rows, one after the other.

    Of a list there are several in a row, and `lengths` says how many.
    """

    entries: NDArray[Any]
    lengths: NDArray[Any] | None


Table = dict[str, Column]


def read_ply(path: Path) -> tuple[Floats, Ints, Ints]:
    """(n, 3) vertices, (m, 3) faces and (m,) their polygons."""
    tables = read_tables(path.read_bytes())
    vertices = tables.get("vertex", {})
    axes = [vertices[axis] for axis in "xyz" if axis in vertices]
    if len(axes) < 3 or any(axis.lengths is not None for axis in axes):
        raise Damage("its vertices have no x, y and z")
    V = np.column_stack([axis.entries for axis in axes]).astype(np.float64)
    polygons = lists_of_vertices(tables.get("face", {}), "faces")
    if polygons is not None:
        return V, *triangles_of(V, *polygons)
    rows = lists_of_vertices(tables.get("tristrips", {}), "strips")
    F = np.empty((0, 3), np.int64) if rows is None else strips(*rows)
    return V, F, np.arange(len(F))


def texture_of_ply(path: Path) -> Floats | None:
    """Texture coordinates of the vertices (n, 2), as u and v, or of the corners (m, 3, 2).

    The latter, of the faces of `read_ply`, if these have a list ``texcoord``; None without any.
    """
    tables = read_tables(path.read_bytes())
    vertices, faces = tables.get("vertex", {}), tables.get("face", {})
    if (of_corners := faces.get("texcoord")) and (polygons := lists_of_vertices(faces, "faces")):
        rows, _ = rows_of_triangles(read_ply(path)[0], *polygons)
        uv = of_corners.entries.astype(np.float64).reshape(-1, 2)
        if len(uv) != len(polygons[0]):
            raise Damage("its texture coordinates are not those of its corners")
        return uv[rows]
    for u, v in TEXTURE:
        if u in vertices and v in vertices:
            at = np.column_stack([vertices[u].entries, vertices[v].entries])
            return at.astype(np.float64)
    return None


def triangles_of_ply(path: Path) -> tuple[NDArray[Any], NDArray[Any]] | None:
    """(n, 3) vertices and (m, 3) faces of a binary file of triangles, mapped into memory.

    None of any other file, which `read_ply` reads, or says what is wrong with it.
    """
    data = np.memmap(path, np.uint8, "r")
    head = data[:HEADER].tobytes()
    try:
        encoding, elements, body = parse_header(head)
        if encoding == "ascii" or [element.name for element in elements[:2]] != ["vertex", "face"]:
            return None
        types = {name: BYTE_ORDERS[encoding] + kind for name, kind in TYPES.items()}
        start, tables = len(head) - len(body), list[NDArray[Any]]()
        for element in elements[:2]:
            kind = _type_of_row(data, start, element, types)
            tables.append(np.frombuffer(data, kind, element.rows, start))
            start += tables[-1].nbytes
    except (Damage, ValueError):
        return None
    names = [[column.name for column in element.properties] for element in elements[:2]]
    x = names[0].index("x") if "x" in names[0] else 0
    kinds = {column.type for column in elements[0].properties[x : x + 3]}
    corners = next((k for k, name in enumerate(names[1]) if name in INDICES), None)
    if corners is None or names[0][x : x + 3] != [*"xyz"] or len(kinds) > 1:
        return None
    if elements[1].properties[corners].length_type is None:
        return None
    if (tables[1][f"length {corners}"] != 3).any():
        return None
    first = tables[0][f"entries {x}"]
    V = np.lib.stride_tricks.as_strided(first, (len(first), 3), (first.strides[0], first.itemsize))
    return V, tables[1][f"entries {corners}"]


def lists_of_vertices(table: Table, what: str) -> tuple[Ints, Ints] | None:
    """Vertices of all rows, one after the other, and how many each has; None if there are none."""
    found = next((table[name] for name in INDICES if name in table), None)
    if found is None:
        return None
    if found.lengths is None:
        raise Damage(f"its {what} are no lists of vertices")
    vertices = found.entries.astype(np.int64)
    if (vertices != found.entries).any():
        raise Damage(f"its {what} have indices that are no integers")
    return vertices, found.lengths.astype(np.int64)


def read_tables(data: bytes) -> dict[str, Table]:
    """Return the columns of all elements."""
    return {element.name: _table(element, runs) for element, runs in runs_of_elements(data)[0]}


def runs_of_elements(
    data: bytes,
) -> tuple[list[tuple[Element, list[NDArray[Any]]]], dict[str, str], int]:
    """Return the rows of all elements, in runs; how types are read; and where the rows end.

    Numbers in ascii are read as doubles, eight bytes each, as if these were in the file.
    """
    encoding, elements, body = parse_header(data)
    if encoding == "ascii":
        body, types = _numbers(body).tobytes(), dict.fromkeys(TYPES, "f8")
    else:
        types = {name: BYTE_ORDERS[encoding] + kind for name, kind in TYPES.items()}
    found, start = [], 0
    for element in elements:
        runs, start = _read_runs(body, start, element, types)
        found.append((element, runs))
    if encoding == "ascii" and start < len(body):
        raise Damage("it has more numbers than its header says")
    return found, types, start


def parse_header(data: bytes) -> tuple[str, list[Element], bytes]:
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
                elements[-1].properties.append(Property(name, kind, length))
            case ["property", kind, name] if elements and kind in TYPES:
                elements[-1].properties.append(Property(name, kind))
            case ["comment" | "obj_info", *_] | []:
                pass
            case _:
                raise Damage(f"its header says {line!r}")
    raise Damage("it has no ply header, or no end of it")


def _numbers(text: bytes) -> Floats:
    """(k,) numbers of a body in ascii."""
    numbers = array("d")
    for number, line in enumerate(text.splitlines(), 1):
        try:
            numbers.extend(map(float, line.split()))
        except ValueError:
            wrong = culprit(line.decode("latin-1").split(" "), float, "number")
            raise Damage(f"line {number:,} after its header: {wrong}") from None
    return np.array(numbers)


def _read_runs(
    body: bytes, start: int, element: Element, types: dict[str, str]
) -> tuple[list[NDArray[Any]], int]:
    """Return the rows of an element that begins at a byte, and where it ends.

    Rows whose lists have the same lengths are read at once: as a rule, all.
    """
    runs = list[NDArray[Any]]()
    lists = [k for k, column in enumerate(element.properties) if column.length_type]
    left = most = element.rows
    while left:
        kind = _type_of_row(body, start, element, types)
        there = (len(body) - start) // kind.itemsize
        if not there:
            raise Damage(
                f"it ends after {element.rows - left:,} rows of {element.rows:,} in {element.name}"
            )
        rows = np.frombuffer(body, kind, min(left, most, there), start)
        same = np.ones(len(rows), dtype=bool)
        for k in lists:
            same &= rows[f"length {k}"] == rows[f"length {k}"][0]
        n = len(rows) if same.all() else int(same.argmin())
        runs.append(rows[:n])
        start += n * kind.itemsize
        left -= n
        most = 2 * n  # lest many rows be looked at for each run of a mixture
    return runs, start


def _table(element: Element, runs: list[NDArray[Any]]) -> Table:
    table = Table()
    for k, column in enumerate(element.properties if runs else ()):
        entries = np.concatenate([rows[f"entries {k}"].ravel() for rows in runs])
        is_list = column.length_type is not None
        lengths = np.concatenate([rows[f"length {k}"] for rows in runs]) if is_list else None
        table[column.name] = Column(entries, lengths)
    return table


def _type_of_row(body: Any, start: int, element: Element, types: dict[str, str]) -> np.dtype[Any]:
    """Return the type of rows whose lists are as long as in the row that begins at a byte."""
    fields: list[tuple[Any, ...]] = []
    for k, column in enumerate(element.properties):
        shape: tuple[int, ...] = ()
        if column.length_type:
            length_type = types[column.length_type]
            (length,) = np.frombuffer(body, length_type, 1, start + np.dtype(fields).itemsize)
            if not (0 <= length <= len(body) and length == int(length)):
                raise Damage(f"it has a list of {length:,.0f} entries in {element.name}")
            fields.append((f"length {k}", length_type))
            shape = (int(length),)
        fields.append((f"entries {k}", types[column.type], shape))
    return np.dtype(fields)


def write_ply(
    path: Path,
    V: Floats,
    F: Ints,
    texture: Floats,
    FT: Ints | None,
    colours: Floats | None = None,
) -> None:
    """Write a surface in double precision, binary.

    Without `FT`, `texture` has a row for each vertex: properties s and t. Else `FT` has its rows
    at the corners of the faces: a list ``texcoord``, u and v at the first corner, the second and
    the third. Colours (n, 3) or (n, 4) of the vertices, from 0 to 1, are in bytes.
    """
    properties = dict.fromkeys("xyz" if FT is not None else "xyzst", "double")
    blocks = [np.ascontiguousarray(V if FT is not None else np.hstack([V, texture]), "<f8")]
    if colours is not None:
        properties |= dict.fromkeys(COLOURS[: colours.shape[1]], "uchar")
        blocks.append(np.rint(255 * colours).astype("u1"))
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
        *(f"property {kind} {name}" for name, kind in properties.items()),
        f"element face {len(F)}",
        "property list uchar int vertex_indices",
        *(["property list uchar double texcoord"] if FT is not None else []),
        "end_header\n",
    ]
    with path.open("wb") as file:
        file.write("\n".join(header).encode("ascii"))
        file.write(np.hstack([block.view(np.uint8) for block in blocks]).tobytes())
        file.write(faces.tobytes())
