"""VTK's surfaces, POLYDATA: legacy vtk files of all versions, and vtp; other types by meshio.

References
----------
Kitware. VTK file formats. https://docs.vtk.org/en/latest/vtk_file_formats/
"""

from __future__ import annotations

import re
import zlib
from base64 import b64decode, b64encode
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from ..errors import Damage
from ..extras import from_extra
from .polygons import strips, triangles_of, triangulated

# Numbers as legacy files and as XML files call them; VTK's own integers have 64 bits by now.
LEGACY = {"float": "f4", "double": "f8", "char": "i1", "unsigned_char": "u1", "short": "i2"}
LEGACY |= {"unsigned_short": "u2", "int": "i4", "unsigned_int": "u4", "long": "i8"}
LEGACY |= {"unsigned_long": "u8", "vtktypeint64": "i8", "vtktypeint32": "i4", "vtkidtype": "i4"}
VALUES = "PointData", "CellData", "FieldData"  # as XML files call them
XML = {
    f"{kind}{8 * size}": f"{kind[0].lower()}{size}"
    for kind in ("Int", "UInt", "Float")
    for size in (1, 2, 4, 8)
}
COLUMNS = {"VECTORS": 3, "NORMALS": 3, "TENSORS": 9, "TENSORS6": 6}  # of attributes
COLUMNS |= {"GLOBAL_IDS": 1, "PEDIGREE_IDS": 1, "EDGE_FLAGS": 1}
CELLS = ("VERTICES", "LINES", "POLYGONS", "TRIANGLE_STRIPS")
Surface = tuple[NDArray[Any], Ints, Ints]
# How legacy files begin, up to a surface, and up to the texture coordinates of vertices.
HEAD = rb"(?:[^\n]*\n){2}\s*(ASCII|BINARY)\s+DATASET\s+"
POLYDATA = re.compile(HEAD + rb"POLYDATA\s", re.IGNORECASE)
TEXTURE = re.compile(
    HEAD + rb".*?\nPOINT_DATA\s+(\d+)\b.*?\nTEXTURE_COORDINATES\s+\S+\s+([23])\s+(\w+)\s*?\n",
    re.IGNORECASE | re.DOTALL,
)


def read_vtk(path: Path) -> Surface:
    """Vertices, triangles and their polygons."""
    data = path.read_bytes()
    if path.suffix.lower() == ".vtp":
        return _read_vtp(_Xml(data))
    if path.suffix.lower() == ".vtk" and (kind := POLYDATA.match(data)):
        return _read_polydata(_Legacy(data, kind))
    mesh = _read_by_meshio(path)
    F, polygon = triangulated(mesh.points, mesh.cells)
    if len(F) == 0:
        raise Damage(
            "it has no triangles or polygons: ParaView's filter Extract Surface makes them"
        )
    return mesh.points, F, polygon


def _read_by_meshio(path: Path) -> Any:
    with from_extra("vtk"):
        import meshio
    try:
        return (meshio.vtk if path.suffix.lower() == ".vtk" else meshio.vtu).read(path)
    except (meshio.ReadError, AssertionError, LookupError, RuntimeError, ValueError):
        raise Damage(
            "it is damaged, or of a kind that meshio does not read: ParaView's filter Extract "
            "Surface makes PolyData"
        ) from None


def others_of_vtk(path: Path) -> Iterator[str]:
    """Yield what a file has besides a surface and texture coordinates, up to what is unreadable."""
    data = path.read_bytes()
    if path.suffix.lower() == ".vtp":
        yield from _others_of_vtp(_Xml(data).root)
    elif path.suffix.lower() == ".vtk" and (kind := POLYDATA.match(data)):
        yield from _others_of_polydata(_Legacy(data, kind))
    else:
        mesh = _read_by_meshio(path)
        yield from (*mesh.point_data, *mesh.cell_data, *mesh.field_data)


def texture_of_vtk(path: Path) -> Floats | None:
    """(n, 2) texture coordinates of the vertices, if there are any."""
    data = path.read_bytes()
    if path.suffix.lower() == ".vtp":
        return _texture_of_vtp(_Xml(data))
    if not (found := TEXTURE.match(data)):
        return None
    columns = int(found[3])
    uv = _Legacy(data, found).numbers(int(found[2]) * columns, found[4].decode())
    return uv.reshape(-1, columns)[:, :2].astype(np.float64)


def _surface(V: NDArray[Any], polygons: list[Ints], rows: list[Ints]) -> Surface:
    """Put polygons and strips, each a list of corners and of sizes, together."""
    F, polygon = triangles_of(V, *polygons)
    more = strips(*rows) if len(rows[0]) else np.empty((0, 3), np.int64)
    last = len(polygons[1])
    return V, np.vstack([F, more]), np.append(polygon, last + np.arange(len(more)))


# -- legacy files ----------------------------------------------------------------------


class _Legacy:
    """What follows the `head` of a legacy file, which says first whether it is binary."""

    def __init__(self, data: bytes, head: re.Match[bytes]) -> None:
        self.data, self.at, self.binary = data, head.end(), head[1].upper() == b"BINARY"
        version = re.match(rb"# vtk DataFile Version (\d+)", data)
        self.offsets = version is not None and int(version[1]) >= 5

    def words(self) -> list[str]:
        """Read the next line that is not empty."""
        line = re.compile(rb"\s*([^\n]*)\n?").match(self.data, self.at)
        assert line is not None  # it may be empty
        self.at = line.end()
        return line[1].decode("latin-1").split()

    def field(self, count: int) -> Iterator[str]:
        """Go past the arrays of a field; yield their names."""
        for _ in range(count):
            while (line := self.words()) == ["METADATA"]:
                self.skip_metadata()
            name, columns, rows, kind = line
            yield name
            self.numbers(int(columns) * int(rows), kind)

    def skip_metadata(self) -> None:
        """Go past what is said of an array, up to an empty line."""
        end = self.data.find(b"\n\n", self.at)
        self.at = len(self.data) if end < 0 else end

    def numbers(self, count: int, kind: str) -> NDArray[Any]:
        """(count,) numbers of a type."""
        if kind.lower() not in LEGACY or count < 0:
            raise Damage(f"it has {count} numbers of type {kind!r}")
        form = np.dtype(">" + LEGACY[kind.lower()])
        start = self.at
        if self.binary:
            self.at += count * form.itemsize
            return np.frombuffer(self.data, form, count, start)
        words = re.compile(rb"\S+").finditer(self.data, start)
        for word in islice(words, count):
            self.at = word.end()
        row = np.array(
            self.data[start : self.at].split(), np.float64 if form.kind == "f" else np.int64
        )
        if len(row) < count:
            raise Damage(f"it ends after {len(row):,} numbers of {count:,}")
        return row

    def lists(self, count: int, size: int) -> list[Ints]:
        """Corners of all cells of a kind, and how many each has."""
        if not self.offsets:
            return _lists(self.numbers(size, "int").astype(np.int64))
        rows = []
        for length in (count, size):
            _, kind = self.words()
            rows.append(self.numbers(length, kind).astype(np.int64))
        return [rows[1], np.diff(rows[0])]


def _read_polydata(file: _Legacy) -> Surface:
    V = np.empty((0, 3))
    cells = {name: [np.empty(0, np.int64)] * 2 for name in CELLS}
    while line := file.words():
        match [word.upper() for word in line]:
            case ["POINTS", count, _]:
                V = file.numbers(3 * int(count), line[2]).astype(np.float64).reshape(-1, 3)
            case [name, count, size] if name in CELLS:
                cells[name] = file.lists(int(count), int(size))
            case ["METADATA"]:
                file.skip_metadata()
            case ["FIELD", _, count]:
                [*file.field(int(count))]
            case ["POINT_DATA" | "CELL_DATA", *_]:
                break
            case _:
                raise Damage(f"it says {' '.join(line)[:40]!r}")
    return _surface(V, cells["POLYGONS"], cells["TRIANGLE_STRIPS"])


def _others_of_polydata(file: _Legacy) -> Iterator[str]:
    """Yield what stands before, between and behind the faces of a surface."""
    n, byte = 0, "unsigned_char" if file.binary else "float"
    while line := file.words():
        match [line[0].upper(), *line[1:]]:
            case ["POINTS", count, kind]:
                file.numbers(3 * int(count), kind)
            case [name, count, size] if name in CELLS:
                file.lists(int(count), int(size))
                if name in ("VERTICES", "LINES"):
                    yield name.lower()
            case ["METADATA"]:
                file.skip_metadata()
            case ["POINT_DATA" | "CELL_DATA", count]:
                n = int(count)
            case ["FIELD", _, count]:
                yield from file.field(int(count))
            case ["LOOKUP_TABLE", _, count]:
                file.numbers(4 * int(count), byte)
            case ["TEXTURE_COORDINATES", _, columns, kind]:
                file.numbers(n * int(columns), kind)
            case [_, name, *shape]:
                yield name
                file.numbers(*_values(file, line[0].upper(), shape, n, byte))
            case _:
                raise Damage(f"it says {' '.join(line)[:40]!r}")


def _values(file: _Legacy, what: str, shape: list[str], n: int, byte: str) -> tuple[int, str]:
    """How many numbers of which type follow the line of an attribute."""
    if what == "COLOR_SCALARS":
        return n * int(shape[0]), byte
    if what == "SCALARS":
        file.words()  # of its lookup table
        return n * int([*shape, "1"][1]), shape[0]
    return n * COLUMNS[what], shape[0]


def _lists(flat: Ints) -> list[Ints]:
    """Corners and sizes of rows before which their number stands."""
    starts, at = [], 0
    while at < len(flat):
        starts.append(at)
        if flat[at] < 0:
            raise Damage("a face has a negative number of corners")
        at += 1 + int(flat[at])
    if at != len(flat):
        raise Damage("its faces are cut off")
    return [np.delete(flat, starts), flat[starts]]


# -- XML files -------------------------------------------------------------------------


class _Xml:
    """A vtp file: its elements, and the numbers of each array."""

    def __init__(self, data: bytes) -> None:
        from xml.etree import ElementTree  # not imported with the library

        appended = re.search(rb"<AppendedData[^>]*encoding=.(\w+).[^>]*>\s*_", data)
        self._body, self._raw = b"", False
        if appended:
            end = data.rindex(b"</AppendedData>")
            self._body, self._raw = data[appended.end() : end], appended[1] == b"raw"
            data = data[: appended.end() - 1] + data[end:]
        try:
            self.root = ElementTree.fromstring(data)
        except ElementTree.ParseError as error:
            raise Damage(f"its XML is broken: {error}") from None
        kind, said = self.root.get("type"), self.root.get
        if kind != "PolyData":
            raise Damage(f"it is {kind}: ParaView's filter Extract Surface makes PolyData")
        self._order = "<" if said("byte_order", "LittleEndian") == "LittleEndian" else ">"
        self._head = np.dtype(self._order + XML[said("header_type", "UInt32")])
        if said("compressor") not in (None, "vtkZLibDataCompressor"):
            raise Damage(f"it is compressed by {said('compressor')}: write it without")
        self._packed = bool(said("compressor"))

    def numbers(self, array: Any) -> NDArray[Any]:
        """Read the numbers of an element."""
        kind = np.dtype(self._order + XML[array.get("type")])
        if array.get("format", "ascii") == "ascii":
            text = (array.text or "").split()
            return np.array(text, np.float64 if kind.kind == "f" else np.int64)
        if array.get("format") == "appended":
            code, coded = self._body[int(array.get("offset")) :], not self._raw
        else:
            code, coded = (array.text or "").strip().encode(), True
        return np.frombuffer(_block(code, coded, self._head, self._packed), kind)


def _read_vtp(file: _Xml) -> Surface:
    vertices, n = [np.empty((0, 3))], 0
    lists: dict[str, list[list[Ints]]] = {"Polys": [], "Strips": []}
    for piece in file.root.iter("Piece"):
        points = piece.find("Points/DataArray")
        V = np.empty((0, 3)) if points is None else file.numbers(points).reshape(-1, 3)
        for name, found in lists.items():
            by_name = {each.get("Name"): each for each in piece.findall(f"{name}/DataArray")}
            if len(by_name) > 1:
                corners, ends = (
                    file.numbers(by_name[each]).astype(np.int64)
                    for each in ("connectivity", "offsets")
                )
                found.append([corners + n, np.diff(ends, prepend=0)])
        vertices.append(V.astype(np.float64))
        n += len(V)
    empty = [[np.empty(0, np.int64)] * 2]
    joined = [
        [np.concatenate(each) for each in zip(*(empty + lists[name]), strict=True)]
        for name in lists
    ]
    return _surface(np.concatenate(vertices), *joined)


def _texture_of_vtp(file: _Xml) -> Floats | None:
    rows = []
    for of_points in file.root.iterfind(".//Piece/PointData[@TCoords]"):
        name = of_points.get("TCoords")
        for array in (each for each in of_points if each.get("Name") == name):
            columns = int(array.get("NumberOfComponents", 1))
            rows.append(file.numbers(array).reshape(-1, columns)[:, :2].astype(np.float64))
    return np.concatenate(rows) if rows else None


def _others_of_vtp(root: Any) -> Iterator[str]:
    for lines in ("Verts", "Lines"):
        if any(int(piece.get(f"NumberOf{lines}", 0)) for piece in root.iter("Piece")):
            yield {"Verts": "vertices"}.get(lines, "lines")
    for data in (each for kind in VALUES for each in root.iter(kind)):
        yield from (each.get("Name") for each in data if each.get("Name") != data.get("TCoords"))


def _block(code: bytes, coded: bool, head: np.dtype[Any], packed: bool) -> bytes:
    """Return the bytes of an array, after whose length they stand, or in packed blocks."""

    def plain(start: int, size: int) -> bytes:
        if not coded:
            return code[start : start + size]
        return b64decode(code[start : start + 4 * -(-size // 3)])[:size]

    def end(start: int, size: int) -> int:
        return start + (4 * -(-size // 3) if coded else size)

    width = head.itemsize
    (first,) = np.frombuffer(plain(0, width), head)
    if not packed:
        both = plain(0, width + int(first))
        if len(both) < width + int(first):
            raise Damage("an array is cut off")
        return both[width:]
    size = (3 + int(first)) * width
    sizes = np.frombuffer(plain(0, size), head)[3:].astype(np.int64)
    blocks, start = plain(end(0, size), int(sizes.sum())), np.cumsum(sizes) - sizes
    return b"".join(
        zlib.decompress(blocks[a : a + b])
        for a, b in zip(start.tolist(), sizes.tolist(), strict=True)
    )


# -- writing ---------------------------------------------------------------------------


def write_vtk(path: Path, V: Floats, F: Ints, texture: Floats, *, xml: bool) -> None:
    """Write a surface with texture coordinates, a row for each vertex, in double precision.

    Legacy, binary, version 3.0, which all programs read; or vtp.
    """
    if xml:
        path.write_text(_vtp(V, F, texture), encoding="ascii")
        return
    rows = np.column_stack([np.full(len(F), 3), F])
    with path.open("wb") as file:
        for text, array in (
            (
                "# vtk DataFile Version 3.0\nmap\nBINARY\nDATASET POLYDATA\n"
                f"POINTS {len(V)} double",
                V,
            ),
            (f"POLYGONS {len(F)} {rows.size}", rows.astype(">i4")),
            (f"POINT_DATA {len(V)}\nTEXTURE_COORDINATES uv 2 double", texture),
        ):
            data = array.astype(">f8") if array.dtype.kind == "f" else array
            file.write(text.encode() + b"\n" + data.tobytes() + b"\n")


def _vtp(V: Floats, F: Ints, texture: Floats) -> str:
    def array(name: str, rows: NDArray[Any]) -> str:
        data = rows.astype("<f8" if rows.dtype.kind == "f" else "<i8").tobytes()
        kind = "Float64" if rows.dtype.kind == "f" else "Int64"
        code = b64encode(np.uint64(len(data)).astype("<u8").tobytes() + data).decode()
        columns = rows.shape[1] if rows.ndim == 2 else 1
        return (
            f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="{columns}" '
            f'format="binary">{code}</DataArray>'
        )

    ends = np.arange(3, F.size + 1, 3)
    return (
        '<?xml version="1.0"?>\n<VTKFile type="PolyData" version="1.0" '
        'byte_order="LittleEndian" header_type="UInt64">\n<PolyData>\n'
        f'<Piece NumberOfPoints="{len(V)}" NumberOfPolys="{len(F)}">\n'
        f'<PointData TCoords="uv">{array("uv", texture)}</PointData>\n'
        f"<Points>{array('Points', V)}</Points>\n"
        f"<Polys>{array('connectivity', F.ravel())}{array('offsets', ends)}</Polys>\n"
        "</Piece>\n</PolyData>\n</VTKFile>\n"
    )
