"""Surfaces of VTK: legacy files of both generations, and vtp, as VTK, ParaView and Slicer write."""

import re
import zlib
from base64 import b64encode
from contextlib import suppress
from itertools import chain

import numpy as np
import pytest
from commands import invoke
from scipy.io import savemat

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


@pytest.mark.parametrize("binary", [False, True])
def test_all_that_a_legacy_file_has_is_told(tmp_path, binary, caplog):
    """Fields stand before the points, too, as VTK writes those of a whole surface."""
    n, m = len(V), len(POLYGONS) + 2

    def put(count, size=4, byte=False):
        return (b"1 " * count if not binary else bytes(count * (1 if byte else size))) + b"\n"

    field = b"FIELD FieldData 2\nwhen 1 1 float\n" + put(1)
    field += b"METADATA\nINFORMATION 0\n\nlong 2 3 double\n" + put(6, 8)
    data = legacy("3.0", binary).replace(b"POLYDATA\n", b"POLYDATA\n" + field)
    for line, count in (("NORMALS up float", 3 * n), ("TENSORS bend float", 9 * n)):
        data += line.encode() + b"\n" + put(count)
    data += b"COLOR_SCALARS dye 4\n" + put(4 * n, byte=True)
    data += f"CELL_DATA {m}\nSCALARS part int 2\nLOOKUP_TABLE own\n".encode() + put(2 * m)
    data += b"LOOKUP_TABLE own 2\n" + put(8, byte=True)
    data += b"GLOBAL_IDS rows vtkIdType\n" + put(m)
    given = tmp_path / "a.vtk"
    given.write_bytes(data)
    W, F = read_mesh(given)
    np.testing.assert_array_equal(W, V)
    names = "when, long, lines, s, up, bend, dye, part, rows"
    for suffix in ("vtp", "obj", "npz"):
        write_map(tmp_path / f"b.{suffix}", W, F, UV, like=given)
        assert caplog.messages.pop() == f"not in b.{suffix}: {names} of a.vtk"
        caplog.clear()
    given.write_bytes(data.replace(b"COLOR_SCALARS", b"UNKNOWN_TO_US"))
    write_map(tmp_path / "c.obj", W, F, UV, like=given)
    assert "s, up, bend, dye, unreadable values of a.vtk" in caplog.messages[-1]


@pytest.mark.parametrize("packed", [False, True])
def test_values_of_a_vtp_file_are_told(tmp_path, packed, caplog):
    data = b"<CellData><DataArray type='Int64' Name='part' format='ascii'/></CellData>"
    given = tmp_path / "a.vtp"
    given.write_bytes(vtp("raw", packed).replace(b"<Points>", data + b"<Points>"))
    W, F = read_mesh(given)
    write_map(tmp_path / "b.vtk", W, F, UV, like=given)
    assert caplog.messages == ["not in b.vtk: part of a.vtp"]


@pytest.mark.parametrize("columns", [2, 3])
@pytest.mark.parametrize("suffix", ["npz", "mat"])
def test_arrays_besides_a_surface_are_told(tmp_path, suffix, columns, caplog):
    W, F, uv = cdcp_igl.datasets.square(4)
    path, more = tmp_path / f"a.{suffix}", {"LAT": W[:, 0], "names": np.array(["x"], object)}
    arrays = {"V": W[:, :columns], "F": F, "uv": uv} | more
    if suffix == "npz":
        np.savez(path, **arrays)
    else:
        savemat(path, arrays)
    told = f"LAT, names of a.{suffix}"
    for result in (cdcp_igl.disk_map(path), cdcp_igl.surface_map(path)):
        for name in ("b.obj", "b.npz"):
            caplog.clear()
            result.save(tmp_path / name)
            assert f"not in {name}: {told}" in caplog.messages
    for name in ("c.vtk", "c.npz"):
        said = invoke("map", path, tmp_path / name).output
        assert f"not in {name}: {told}" in " ".join(said.split())


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
