"""Surfaces of VTK: legacy files of both generations, and vtp, as VTK, ParaView and Slicer write."""

import re
import zlib
from base64 import b64encode
from contextlib import suppress
from itertools import chain

import numpy as np
import pytest

import cdcp_igl
from cdcp_igl.io import read_mesh, read_polygons, read_texture, write_map

V = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [1, 1, 0], [1, 2, 0], [0, 2, 0], [3, 0, 0]], float)
L, TRIANGLE, STRIP = [0, 1, 2, 3, 4, 5], [1, 6, 2], [5, 4, 3]
POLYGONS = [L, TRIANGLE]
UV = V[:, :2] / 4


def legacy(version, binary):
    def put(rows, form):
        if binary:
            return np.array(rows).astype(form).tobytes() + b"\n"
        return " ".join(map(str, rows)).encode() + b"\n"

    text = [f"# vtk DataFile Version {version}\nL\n{'BINARY' if binary else 'ASCII'}\n".encode()]
    text += [b"DATASET POLYDATA\n", f"POINTS {len(V)} float\n".encode(), put(V.ravel(), ">f4")]
    text.append(b"METADATA\nINFORMATION 1\nNAME a LOCATION b\nDATA 2 1 2\n\n")
    for name, cells in (("LINES", [[0, 1]]), ("POLYGONS", POLYGONS), ("TRIANGLE_STRIPS", [STRIP])):
        corners = list(chain(*cells))
        if version >= "5":
            ends = np.cumsum([0, *map(len, cells)]).tolist()
            head = f"{name} {len(ends)} {len(corners)}\nOFFSETS vtktypeint64\n"
            text += [head.encode(), put(ends, ">i8"), b"CONNECTIVITY vtktypeint64\n"]
            text.append(put(corners, ">i8"))
        else:
            flat = [number for cell in cells for number in (len(cell), *cell)]
            text += [f"{name} {len(cells)} {len(flat)}\n".encode(), put(flat, ">i4")]
    text.append(f"POINT_DATA {len(V)}\nSCALARS s float\nLOOKUP_TABLE default\n".encode())
    text.append(put(np.arange(len(V)), ">f4"))
    return b"".join([*text, b"TEXTURE_COORDINATES uv 2 float\n", put(UV.ravel(), ">f4")])


def vtp(form, packed=False):
    """One of the ways in which vtp holds arrays: in text, coded, or after all else."""
    appended = b""

    def array(name, rows, kind, columns=1):
        nonlocal appended
        data = np.array(rows).astype("<" + {"Float32": "f4", "Int64": "i8"}[kind]).tobytes()
        head = f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="{columns}" format='
        if form == "ascii":
            return f'{head}"ascii">{" ".join(map(str, np.ravel(rows)))}</DataArray>'
        size = np.array([len(data)], "<u4").tobytes()
        if packed:
            block = zlib.compress(data)
            size = np.array([1, len(data), 0, len(block)], "<u4").tobytes()
            coded = b64encode(size) + b64encode(block)
            data = block
        else:
            coded = b64encode(size + data)
        if form == "binary":
            return f'{head}"binary">{coded.decode()}</DataArray>'
        start = len(appended)
        appended += size + data if form == "raw" else coded
        return f'{head}"appended" offset="{start}"/>'

    def cells(name, rows):
        ends, corners = np.cumsum([len(row) for row in rows]), list(chain(*rows))
        arrays = array("connectivity", corners, "Int64") + array("offsets", ends, "Int64")
        return f"<{name}>{arrays}</{name}>"

    body = f"<PointData TCoords='uv'>{array('uv', UV.ravel(), 'Float32', 2)}</PointData>"
    body += f"<Points>{array('Points', V.ravel(), 'Float32', 3)}</Points>"
    body += cells("Polys", POLYGONS) + cells("Strips", [STRIP])
    compressor = ' compressor="vtkZLibDataCompressor"' if packed else ""
    head = f'<VTKFile type="PolyData" byte_order="LittleEndian"{compressor}><PolyData><Piece>'
    encoding = "raw" if form == "raw" else "base64"
    tail = f'</Piece></PolyData><AppendedData encoding="{encoding}">_'.encode()
    return head.encode() + body.encode() + tail + appended + b"</AppendedData></VTKFile>"


FILES = {f"{v} {b}.vtk": legacy(v, b) for v in ("3.0", "4.2", "5.1") for b in (False, True)}
FILES |= {
    f"{form} {packed}.vtp": vtp(form, packed)
    for form in ("ascii", "binary", "raw", "base64")
    for packed in (False, True)
}


@pytest.mark.parametrize("name", FILES)
def test_surfaces_of_vtk_are_read(tmp_path, name):
    path = tmp_path / name
    path.write_bytes(FILES[name])
    W, F, polygon = read_polygons(path)
    np.testing.assert_array_equal(W, V)
    assert polygon.tolist() == [0, 0, 0, 0, 1, 2]
    np.testing.assert_array_equal(F[4:], [TRIANGLE, STRIP])
    assert cdcp_igl.check(W, F[:5]).is_disk
    np.testing.assert_array_equal(read_texture(path)[2], UV[F])


@pytest.mark.parametrize(
    "name", ["3.0 False.vtk", "5.1 True.vtk", "raw True.vtp", "ascii False.vtp"]
)
def test_whatever_is_cut_off_is_a_mesh_error(tmp_path, name):
    path, data = tmp_path / name, FILES[name]
    for length in range(40, len(data) - 120, 13):
        path.write_bytes(data[:length])
        with suppress(cdcp_igl.MeshError):
            read_mesh(path)


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("a.vtp", b'<VTKFile type="UnstructuredGrid"/>', "Extract Surface"),
        ("a.vtp", b"<VTKFile", "XML is broken"),
        ("b.vtp", vtp("raw", True).replace(b"ZLib", b"LZ4"), "compressed by"),
        ("a.vtk", legacy("3.0", False).replace(b"float", b"half"), "type 'half'"),
        ("a.vtk", legacy("3.0", False).replace(b"LINES", b"LINKS"), "it says 'LINKS"),
        ("a.vtk", legacy("3.0", False)[:140], "numbers of"),
    ],
)
def test_what_is_wrong_is_told(tmp_path, name, text, says):
    path = tmp_path / name
    path.write_bytes(text)
    with pytest.raises(cdcp_igl.MeshError, match=re.escape(says)):
        read_mesh(path)


def test_cells_that_meshio_does_not_know(tmp_path):
    pytest.importorskip("meshio")
    path = tmp_path / "prism.vtk"
    cells = f"CELLS 1 13\n12 {' '.join(map(str, range(12)))}\nCELL_TYPES 1\n16\n"
    points = f"DATASET UNSTRUCTURED_GRID\nPOINTS 12 float\n{'0 ' * 36}\n"
    path.write_text(f"# vtk DataFile Version 3.0\nL\nASCII\n{points}{cells}")
    with pytest.raises(cdcp_igl.MeshError, match=r"meshio does not read.*Surface"):
        read_mesh(path)


@pytest.mark.parametrize("suffix", ["vtk", "vtp"])
def test_maps_are_written_and_read_again(tmp_path, suffix):
    W, F, uv = cdcp_igl.datasets.spherical_cap(5)
    path = tmp_path / f"a.{suffix}"
    for plane in (uv, uv[F]):
        write_map(path, W, F, plane)
        for array, other in zip(read_texture(path), (W, F, (uv[F] + 1) / 2), strict=True):
            np.testing.assert_array_equal(array, other)
