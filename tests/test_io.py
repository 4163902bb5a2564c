"""Meshes from files of all types, and maps to them and back."""

import os
import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from meshes import grid
from scipy.io import loadmat, savemat
from scipy.sparse import eye

from cdcp_igl import check, disk_map
from cdcp_igl.io import read_mesh, write_map

V5 = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0]], float)
ROWS = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n2 0 0\n"
POINTS = "v " + ROWS[:-1].replace("\n", "\nv ") + "\n"
TRIANGLES = [[0, 1, 2], [0, 2, 3]]
TWO = "f 1 2 3\nf 1 3 4\n"


def ply_header(form, n, m, kind="float", element="face", after=""):
    lines = [
        *("ply", f"format {form} 1.0", "comment it ends with end_header", f"element vertex {n}"),
        *(f"property {kind} {axis}" for axis in "xyz"),
        *(f"element {element} {m}", "property list uchar int vertex_index", f"{after}end_header\n"),
    ]
    return "\n".join(lines)


def assert_read(path, V, F):
    for read, expected in zip(read_mesh(path), (V, F), strict=True):
        np.testing.assert_array_equal(read, expected)


# -- reading ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "faces"),
    [
        (POINTS + TWO, TRIANGLES),
        (POINTS + "f 1 2 3 4\nf 2 5 3\n", [*TRIANGLES, [1, 4, 2]]),
        (POINTS + "f 1 2 5 3 4\n", [[0, 1, 3], [1, 2, 3], [1, 4, 2]]),
        (POINTS + "vt 0 0\nvn 0 0 1\nf 1/1/1 2/1/1 3/1/1\nf 1//1 3//1 4//1\n", TRIANGLES),
        (POINTS + "# a\no b\ng c\nusemtl d\nl 1 2\n  f 1 2 3 \r\n\nf\t1 3 4", TRIANGLES),
        (POINTS, np.empty((0, 3))),
        (POINTS.replace("\n", " .1 .2 .3\n") + TWO, TRIANGLES),
        (POINTS.replace("\n", " # v\n") + "f 1 2 3 # a\nf 1 3 4\t#b\n", TRIANGLES),
        (POINTS + "f 1 \\\n2 3\nf 1 3\\\n \\\n4\n", TRIANGLES),
        ((POINTS + TWO).replace("\n", "\r"), TRIANGLES),
        ("\xef\xbb\xbf" + POINTS + TWO, TRIANGLES),
        (POINTS + "g Stra\xdfe\n" + TWO, TRIANGLES),
    ],
)
def test_obj(tmp_path, text, faces):
    path = tmp_path / "a.OBJ"
    path.write_bytes(text.encode("latin-1"))
    assert_read(path, V5, faces)


def test_negative_indices_in_obj_count_back(tmp_path):
    path = tmp_path / "a.obj"
    path.write_text(POINTS + "f -5 -4 -3\nv 9 9 9\nf -6 -4 -3\n")
    assert_read(path, [*V5, [9, 9, 9]], TRIANGLES)


@pytest.mark.parametrize(
    "text",
    [
        "OFF\n5 3 0\n" + ROWS + "4 0 1 2 3\n3 1 4 2\n3 0 1 4 255 0 0\n",
        "OFF 5 3\n# comment\n\n" + ROWS.replace("\n", "  # x\n") + "4 0 1 2 3\n3 1 4 2\n3 0 1 4",
        "COFF\n5 3 0\n" + ROWS.replace("\n", " 1 0 0 1\n") + "4 0 1 2 3\n3 1 4 2\n3 0 1 4\n",
    ],
)
def test_off(tmp_path, text):
    path = tmp_path / "a.off"
    path.write_text(text)
    assert_read(path, V5, [*TRIANGLES, [1, 4, 2], [0, 1, 4]])


@pytest.mark.parametrize("newline", ["\n", "\r", "\r\n"])
def test_ply_as_text_with_blank_lines(tmp_path, newline):
    path = tmp_path / "a.ply"
    body = "\n" + ROWS + " \t\n3 0 1 2\n\n3 0 2 3"
    path.write_bytes((ply_header("ascii", 5, 2) + body).replace("\n", newline).encode())
    assert_read(path, V5, TRIANGLES)


@settings(max_examples=15)
@given(st.lists(st.tuples(st.integers(3, 6), st.integers(1, 9)), max_size=9), st.randoms())
def test_ply_with_polygons_of_all_sizes(tmp_path_factory, runs, random):
    """In runs of equal ones, between other columns; in all encodings."""
    sizes = [size for size, times in runs for _ in range(times)]
    polygons = [random.sample(range(10), size) for size in sizes]
    V = np.arange(30.0).reshape(10, 3) / 8
    F = [[p[0], *p[k : k + 2]] for p in polygons for k in range(1, len(p) - 1)]
    path = tmp_path_factory.mktemp("ply") / "a.ply"
    after = "property list int double texcoord\nproperty float quality\n"
    for kind, code in (("float", "f"), ("double", "d")):
        rows = [" ".join(map(str, row)) for row in V.tolist()]
        rows += [f"{len(p)} {' '.join(map(str, p))} 2 0.5 0.25 .5" for p in polygons]
        header = ply_header("ascii", 10, len(polygons), kind, after=after)
        path.write_text(header + "\n".join(rows))
        assert_read(path, V, np.reshape(F, (-1, 3)))
        for form, order in (("binary_little_endian", "<"), ("binary_big_endian", ">")):
            data = V.astype(order + code).tobytes()
            for p in polygons:
                data += struct.pack(f"{order}B{len(p)}ii2df", len(p), *p, 2, 0.5, 0.25, 0.5)
            header = ply_header(form, 10, len(polygons), kind, after=after)
            path.write_bytes(header.encode() + data)
            assert_read(path, V, np.reshape(F, (-1, 3)))


@pytest.mark.parametrize("rows", [["9 0 1 2 3 -1 4 3 2 2"], ["4 0 1 2 3", "4 4 3 2 2"], []])
def test_ply_strips(tmp_path, rows):
    path = tmp_path / "a.ply"
    header = ply_header("ascii", 5, len(rows), element="tristrips").replace("uchar", "int")
    path.write_text(header + ROWS + "\n".join(rows) + "\n")
    assert_read(path, V5, np.reshape([[0, 1, 2], [2, 1, 3], [4, 3, 2]] if rows else [], (-1, 3)))


@pytest.mark.parametrize(
    "name", ["a", "vertex part", "endloop of a facet with a vertex", "endsolid"]
)
@pytest.mark.parametrize("end", [None, "endsolid", "end solid"])
def test_stl_corners_are_merged_in_order_of_appearance(tmp_path, end, name):
    path = tmp_path / "a.stl"
    corners = V5[[[2, 0, 1], [3, 0, 2]]]
    if end is None:  # a binary file
        facets = (struct.pack("<12fH", 0, 0, 1, *np.ravel(c), 0) for c in corners)
        path.write_bytes(bytes(80) + struct.pack("<I", 2) + b"".join(facets))
    else:
        loops = ("".join("vertex {} {} {}\n".format(*p) for p in c) for c in corners)
        facets = (f"facet normal 0 0 1\nouter loop\n{a}endloop\nendfacet\n" for a in loops)
        path.write_text(f"solid {name}\n{''.join(facets)}{end} {name}\n")
    assert_read(path, V5[[2, 0, 1, 3]], [[0, 1, 2], [3, 1, 0]])


# -- archives --------------------------------------------------------------------------


def save(path, **arrays):
    savemat(path, arrays) if path.suffix == ".mat" else np.savez(path, **arrays)


@pytest.mark.parametrize("suffix", ["npz", "mat"])
@pytest.mark.parametrize("names", ["VF", "vf"])
@pytest.mark.parametrize("first", [0, 1])
def test_archives(tmp_path, suffix, names, first):
    V, F = grid()
    path = tmp_path / f"a.{suffix}"
    save(path, **{names[0]: V, names[1]: (F + first).astype(np.uint16)})
    notes = []
    read_V, read_F = read_mesh(path, notes.append)
    np.testing.assert_array_equal(read_V, V)
    np.testing.assert_array_equal(read_F, F)
    assert len(notes) == first


@pytest.mark.parametrize("suffix", ["npz", "mat"])
@pytest.mark.parametrize("first", [0, 1])
def test_fractional_indices_stay_to_be_refused(tmp_path, suffix, first):
    V, F = grid()
    path = tmp_path / f"a.{suffix}"
    for fraction in (0, 0.5):
        faces = (F + first).astype(float)
        faces[[3, 5], 1] += fraction
        save(path, V=V, F=faces)
        report = check(*read_mesh(path))
        found = [(defect.name, defect.indices.tolist()) for defect in report.defects]
        assert found == ([("fractional index", [3, 5])] if fraction else [])


def test_indices_are_shifted_only_when_unambiguous(tmp_path):
    V, F = grid()
    path = tmp_path / "a.npz"
    ambiguous = F[(F > 0).all(axis=1)]  # without vertex 0, but also without an index n
    save(path, V=V, F=ambiguous)
    assert_read(path, V, ambiguous)


@pytest.mark.filterwarnings("ignore:.*spmatrix:DeprecationWarning")  # of SciPy 1.18 and later
@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize(
    ("form", "kind"),
    [
        *(("5", kind) for kind in ("f8", "f4", "i2", "u1", "i8", "u4", ">f8")),
        *(("4", kind) for kind in ("f8", "f4", "i2", "u1", ">f8")),
    ],
)
def test_mat_files_are_read_as_scipy_reads_them(tmp_path, form, packed, kind):
    path = tmp_path / "a.mat"
    V, F = V5, np.array(TRIANGLES)
    arrays = {"name": "a text", "f": (F + 1).astype(kind), "v": V.astype(kind), "z": [[1j]]}
    if form == "5":
        arrays |= {"cells": np.array([[V, "x"]], object), "s": {"V": V}, "sparse": eye(3)}
    savemat(path, arrays, format=form, do_compression=packed)
    theirs = loadmat(path)
    assert_read(path, theirs["v"], theirs["f"] - (theirs["f"].max() == 5))


def test_doubles_that_matlab_stores_in_bytes(tmp_path):
    """MATLAB writes whole doubles in the smallest type, up to four bytes within their tag."""

    def element(kind, data):
        return struct.pack("<2I", kind, len(data)) + data + b"\0" * (-len(data) % 8)

    def matrix(name, array):
        shape = struct.pack("<2i", *array.shape)
        content = element(6, struct.pack("<2I", 6, 0)) + element(5, shape)
        content += struct.pack("<2H4s", 1, len(name), name)
        return element(14, content + element(2, array.astype("u1").tobytes("F")))

    path = tmp_path / "a.mat"
    header = b"MATLAB 5.0 MAT-file".ljust(124) + b"\0\1IM"
    path.write_bytes(header + matrix(b"V", V5) + matrix(b"F", np.array(TRIANGLES)))
    assert_read(path, V5, TRIANGLES)
    assert read_mesh(path)[0].dtype == np.float64


# -- writing ---------------------------------------------------------------------------


@pytest.fixture(scope="module")
def mapped():
    V, F = grid()
    return V, F, disk_map(V, F).uv


@pytest.mark.parametrize("suffix", ["obj", "ply", "npz"])
def test_round_trip_is_exact(tmp_path, suffix, mapped):
    V, F, uv = mapped
    path = tmp_path / f"größer als 1.{suffix}"
    write_map(path, V, F, uv, disk=True)
    assert_read(path, V, F)
    np.testing.assert_array_equal(stored_uv(path), uv)
    assert os.listdir(tmp_path) == [path.name]


def stored_uv(path):
    if path.suffix == ".npz":
        return np.load(path)["uv"]
    if path.suffix == ".ply":
        header, _, body = path.read_bytes().partition(b"end_header\n")
        assert b"property double s\nproperty double t\n" in header  # as Blender reads them
        n = int(header.split()[header.split().index(b"vertex") + 1])
        return np.frombuffer(body, "<f8", 5 * n).reshape(n, 5)[:, 3:]
    lines = path.read_text().splitlines()
    return np.array([line.split()[1:] for line in lines if line.startswith("vt ")], float)
