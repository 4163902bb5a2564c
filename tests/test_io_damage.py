"""Files that are damaged, hostile, or no files."""

import json
import os
import struct
import subprocess
import sys
import zipfile

import numpy as np
import pytest
from scipy.io import loadmat, savemat
from scipy.sparse import eye

from cdcp_igl import MeshError
from cdcp_igl.io import read_mesh

V = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
F = np.array([[0, 1, 2], [0, 2, 3]])
OBJ = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
PLY = "ply\nformat ascii 1.0\n{}element vertex 4\nproperty double x\nproperty double y\n" + (
    "property double z\nelement face {}\nproperty list {} {} vertex_indices\nend_header\n"
)
ROWS = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n"


def unreadable(path):
    with pytest.raises(MeshError) as caught:
        read_mesh(path)
    assert caught.value.defect == "unreadable file"
    assert path.name in str(caught.value)
    for python in ("Error", "could not convert", "invalid literal", "object", "b'"):
        assert python not in str(caught.value)
    return str(caught.value)


# -- text files of all systems ---------------------------------------------------------


@pytest.mark.parametrize(
    "text",
    [
        OBJ.replace("\n", " # a vertex\n") + "f 1 2 3 # a face\nf 1 3 4\t#another\n",
        OBJ + "f 1 \\\n2 3\nf 1 3\\\n 4\n",
        OBJ.replace("0 1 0\n", "0 \\\n1 \\\n0\n") + "f 1 2 3\nf 1 3 4\n",
        (OBJ + "f 1 2 3\nf 1 3 4\n").replace("\n", "\r"),
        (OBJ + "f 1 2 3\nf 1 3 4\n").replace("\n", "\r\n"),
        "\xef\xbb\xbf" + OBJ + "f 1 2 3\nf 1 3 4\n",
        OBJ + "g Stra\xdfe\nf 1 2 3\nf 1 3 4\n",
    ],
    ids=["comments", "continued", "continued vertex", "cr", "crlf", "byte order mark", "latin-1"],
)
def test_obj_of_all_systems(tmp_path, text):
    path = tmp_path / "a.obj"
    path.write_bytes(text.encode("latin-1"))
    read_V, read_F = read_mesh(path)
    np.testing.assert_array_equal(read_V, V)
    np.testing.assert_array_equal(read_F, F)


@pytest.mark.parametrize("newline", ["\n", "\r", "\r\n"])
def test_ply_headers_of_all_systems(tmp_path, newline):
    path = tmp_path / "a.ply"
    header = PLY.format("comment it ends with end_header\n", 2, "uchar", "int")
    text = (header + ROWS + "3 0 1 2\n3 0 2 3\n").replace("\n", newline)
    path.write_bytes(text.encode())
    np.testing.assert_array_equal(read_mesh(path)[1], F)


@pytest.mark.parametrize(
    "body",
    [
        ROWS + "\n3 0 1 2\n3 0 2 3\n",
        ROWS + "3 0 1 2\n \t\n\n3 0 2 3\n",
        "\n" + ROWS + "3 0 1 2\n\n3 0 2 3",
    ],
    ids=["between", "inside", "before"],
)
def test_blank_lines_in_a_ply_are_no_rows(tmp_path, body):
    path = tmp_path / "a.ply"
    path.write_text(PLY.format("", 2, "uchar", "int") + body)
    np.testing.assert_array_equal(read_mesh(path)[1], F)


@pytest.mark.parametrize("blank", ["\n", " \n", "\x1c\n", "\xa0\n"])
def test_blank_lines_do_not_complete_a_ply_that_is_cut_off(tmp_path, blank):
    path = tmp_path / "a.ply"
    path.write_bytes(
        (PLY.format("", 2, "uchar", "int") + ROWS + "3 0 1 2\n" + blank).encode("latin-1")
    )
    unreadable(path)


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_ply_of_mixed_polygons_with_other_columns(tmp_path, form):
    path = tmp_path / "a.ply"
    header = PLY.format("", 2, "uchar", "int").replace("ascii", form)
    header = header.replace("end_header", "property float quality\nend_header")
    if form == "ascii":
        body = (ROWS + "4 0 1 2 3 .5\n3 1 2 3 .25\n").encode()
    else:
        order = "<" if "little" in form else ">"
        body = V.astype(order + "f8").tobytes()
        body += struct.pack(order + "B4if", 4, 0, 1, 2, 3, 0.5)
        body += struct.pack(order + "B3if", 3, 1, 2, 3, 0.25)
    path.write_bytes(header.encode() + body)
    np.testing.assert_array_equal(read_mesh(path)[1], [[0, 1, 2], [0, 2, 3], [1, 2, 3]])


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("word.obj", OBJ + "f 1 2 x\n", "line 5: 'x' is no corner"),
        ("word.obj", "v 0 0 zero\n", "line 1: 'zero' is no number"),
        ("short.obj", "v 0 0\n", "line 1: it has too few numbers"),
        ("zero.obj", OBJ + "f 0 1 2\n", "count from 1"),
        ("before.obj", OBJ + "f -5 1 2\n", "before the first"),
        ("goes on.obj", OBJ + "f 1 2 \\\n", "goes on"),
        ("utf-16.obj", OBJ.encode("utf-16"), "no text in UTF-8"),
        ("word.off", "OFF\n1 0 0\n0 0 zero\n", "line 3: 'zero' is no number"),
        ("counts.off", "OFF\n1 one 0\n", "line 2: 'one' is no count"),
        ("index.off", "OFF\n1 1 0\n0 0 0\n3 0 0 0.5\n", "line 4: '0.5' is no index"),
        ("binary.off", "OFF BINARY\n", "first line"),
        ("index.ply", PLY.format("", 1, "uchar", "float") + ROWS + "3 0 1 1.5\n", "no integers"),
        (
            "long.ply",
            PLY.format("", 1, "uint", "int") + ROWS + "1000000000 0 1 2\n",
            "1,000,000,000 entries in face",
        ),
        (
            "list.ply",
            PLY.format("", 2, "uint", "int") + ROWS + "3 0 1 2\n-3\n",
            "-3 entries in face",
        ),
        (
            "word.ply",
            PLY.format("", 1, "uint", "int") + ROWS + "3 0 x 2\n",
            "line 5 after its header: 'x'",
        ),
        ("more.ply", PLY.format("", 1, "uint", "int") + ROWS + "3 0 1 2 3\n", "more numbers than"),
        ("half.ply", PLY.format("", 1, "float", "int") + ROWS + "3 0 1 2\n", "its header says"),
        ("facet.stl", "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nendloop\n", "three"),
    ],
)
def test_messages_are_about_the_file(tmp_path, name, text, says):
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    assert says in unreadable(path)


def test_a_list_of_a_thousand_million_in_a_binary_ply(tmp_path):
    path = tmp_path / "a.ply"
    header = PLY.format("", 1, "uint", "int").replace("ascii", "binary_little_endian")
    path.write_bytes(header.encode() + V.tobytes() + struct.pack("<I3i", 10**9, 0, 1, 2))
    assert "1,000,000,000 entries" in unreadable(path)


# -- archives --------------------------------------------------------------------------


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
    arrays = {"name": "a text", "f": (F + 1).astype(kind), "v": V.astype(kind), "z": [[1j]]}
    if form == "5":
        arrays |= {"cells": np.array([[V, "x"]], object), "s": {"V": V}, "sparse": eye(3)}
    savemat(path, arrays, format=form, do_compression=packed)
    read_V, read_F = read_mesh(path)
    theirs = loadmat(path)
    np.testing.assert_array_equal(read_V, theirs["v"])
    np.testing.assert_array_equal(read_F, theirs["f"] - 1)


def test_doubles_that_matlab_stores_in_bytes(tmp_path):
    """MATLAB writes whole doubles in the smallest type, up to four bytes within their tag."""

    def element(kind, data):
        return struct.pack("<2I", kind, len(data)) + data + b"\0" * (-len(data) % 8)

    def matrix(name, array):
        content = element(6, struct.pack("<2I", 6, 0)) + element(
            5, struct.pack("<2i", *array.shape)
        )
        content += struct.pack("<2H4s", 1, len(name), name)
        return element(14, content + element(2, array.astype("u1").tobytes("F")))

    path = tmp_path / "a.mat"
    header = b"MATLAB 5.0 MAT-file".ljust(124) + b"\0\1IM"
    path.write_bytes(header + matrix(b"V", V) + matrix(b"F", F))
    read_V, read_F = read_mesh(path)
    np.testing.assert_array_equal(read_V, V)
    np.testing.assert_array_equal(read_F, F)
    assert read_V.dtype == np.float64


@pytest.mark.parametrize("V", [V + 1j, eye(4, format="csc"), np.array([[V]], object), "text"])
def test_what_is_no_matrix_of_real_numbers_in_mat(tmp_path, V):
    path = tmp_path / "a.mat"
    savemat(path, {"V": V, "F": F})
    assert "V is no full matrix of real numbers" in unreadable(path)


def test_wrong_tag_that_kills_the_reader_of_scipy(tmp_path):
    path = tmp_path / "a.mat"
    savemat(path, {"V": V, "F": F})
    data = bytearray(path.read_bytes())
    assert data[176] == 9  # the type of the numbers of V
    data[176] = 0x3F
    path.write_bytes(data)
    unreadable(path)


@pytest.mark.parametrize("V", [np.float64(3), np.zeros(3), np.array(["a"]), np.array([[1j]])])
def test_what_is_no_table_of_real_numbers_in_npz(tmp_path, V):
    path = tmp_path / "a.npz"
    np.savez(path, V=V, F=F)
    unreadable(path)


def zipped(path, method, V=V, change=lambda data: data):
    """Write V and F, with what is wrong with the bytes of each."""
    np.savez(path, V=V, F=F)
    with zipfile.ZipFile(path) as archive:
        members = {info.filename: archive.read(info) for info in archive.infolist()}
    with zipfile.ZipFile(path, "w", method) as archive:
        for name, data in members.items():
            archive.writestr(name, change(data))


@pytest.mark.parametrize("method", [zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_packed_archives_and_damaged_ones(tmp_path, method):
    path = tmp_path / "a.npz"
    zipped(path, method)
    np.testing.assert_array_equal(read_mesh(path)[0], V)
    data = bytearray(path.read_bytes())
    data[45:80] = bytes(35)  # in the first member
    path.write_bytes(data)
    unreadable(path)


def test_encrypted_archive(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, V=V, F=F)
    data = bytearray(path.read_bytes())
    for signature, flags in ((b"PK\3\4", 6), (b"PK\1\2", 8)):  # of the members, and their list
        at = data.find(signature)
        while at >= 0:
            data[at + flags] |= 1
            at = data.find(signature, at + 1)
    path.write_bytes(data)
    assert "encrypted" in unreadable(path)


@pytest.mark.parametrize(
    "shape", [b"(4000000000, 3), }", b"(5, 3), }         ", b"(3, 3), }         "]
)
def test_a_header_with_another_shape_than_the_array(tmp_path, shape):
    path = tmp_path / "a.npz"
    change = (b"(4, 3), }         ", shape)
    zipped(path, zipfile.ZIP_STORED, change=lambda data: data.replace(*change))
    unreadable(path)


def test_bombs_are_refused_before_they_go_off(tmp_path):
    """100 MB of zeros in 100 kB; the limit is on what unpacks, not on what is there."""
    zeros = np.zeros((1 << 22, 3))
    path = tmp_path / "a.npz"
    zipped(path, zipfile.ZIP_DEFLATED, zeros)
    assert "more than 100 times" in unreadable(path)
    zipped(path, zipfile.ZIP_BZIP2, zeros)
    assert "more than 100 times" in unreadable(path)
    savemat(tmp_path / "a.mat", {"V": zeros, "F": F}, do_compression=True)
    assert "more than 100 times" in unreadable(tmp_path / "a.mat")
    np.savez(path, V=zeros, F=F)  # stored as it is
    assert len(read_mesh(path)[0]) == len(zeros)
    np.savez_compressed(path, V=V, F=F, other=zeros)  # nobody unpacks it
    assert len(read_mesh(path)[0]) == len(V)


# -- what is no file -------------------------------------------------------------------


def test_a_zero_in_the_name():
    with pytest.raises(MeshError, match="no name of a file"):
        read_mesh("a\0b.obj")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no FIFOs on this system")
def test_fifos_and_devices_are_not_waited_for(tmp_path):
    fifo, device = tmp_path / "a.obj", tmp_path / "b.obj"
    os.mkfifo(fifo)
    device.symlink_to("/dev/zero")
    for path in (fifo, device):
        assert "device, a FIFO" in unreadable(path)


# -- every byte ------------------------------------------------------------------------

# In another process, as what is tested for is the end of the process.
DAMAGE = """
import json, sys
from pathlib import Path
import numpy as np
from cdcp_igl import MeshError
from cdcp_igl.io import read_mesh

path = Path(sys.argv[1])
data = path.read_bytes()
random = np.random.default_rng(7)
refused = 0
for at in range(len(data)):
    for wrong in (data[at] ^ 1 << random.integers(8), 0x3F, random.integers(256)):
        path.write_bytes(data[:at] + bytes([wrong]) + data[at + 1:])
        try:
            V, F = read_mesh(path)
            assert V.ndim == F.ndim == 2, (at, wrong)
        except MeshError as error:
            assert error.defect in ("unreadable file", "too few corners")
            refused += 1
path.write_bytes(data)
print(json.dumps([3 * len(data), refused]))
"""


@pytest.mark.parametrize(
    "name",
    [
        *("a.obj", "a.off", "ascii.ply", "binary.ply", "ascii.stl", "binary.stl"),
        *("a.npz", "packed.npz", "a.mat", "packed.mat", "old.mat"),
    ],
)
def test_any_wrong_byte_is_a_mesh_or_a_mesh_error(tmp_path, name):
    path = tmp_path / name
    form, _, suffix = name.partition(".")
    faces = "3 0 1 2\n3 0 2 3\n"
    binary = PLY.format("", 2, "uchar", "int").replace("ascii", "binary_little_endian")
    facets = "".join(
        "facet normal 0 0 1\nouter loop\n"
        + "".join("vertex {} {} {}\n".format(*corner) for corner in triangle)
        + "endloop\nendfacet\n"
        for triangle in V[F]
    )
    texts = {
        "a.obj": OBJ + "f 1/1 2/2/1 3//1\nf -4 -2 4\n",
        "a.off": "OFF\n4 2 0\n" + ROWS + faces,
        "ascii.ply": PLY.format("", 2, "uchar", "int") + ROWS + faces,
        "ascii.stl": f"solid a\n{facets}endsolid a\n",
    }
    if name in texts:
        path.write_text(texts[name])
    elif suffix == "ply":
        rows = struct.pack("<B3iB3i", 3, 0, 1, 2, 3, 0, 2, 3)
        path.write_bytes(binary.encode() + V.tobytes() + rows)
    elif suffix == "stl":
        rows = b"".join(struct.pack("<12fH", 0, 0, 1, *np.ravel(t), 0) for t in V[F])
        path.write_bytes(bytes(80) + struct.pack("<I", 2) + rows)
    elif suffix == "npz":
        (np.savez_compressed if form == "packed" else np.savez)(path, V=V, F=F)
    else:
        savemat(
            path,
            {"V": V, "F": F},
            format="4" if form == "old" else "5",
            do_compression=form == "packed",
        )
    run = subprocess.run(
        [sys.executable, "-c", DAMAGE, str(path)], capture_output=True, text=True, timeout=120
    )
    assert run.returncode == 0, run.stderr
    assert run.stderr == ""
    tried, refused = json.loads(run.stdout)
    assert 0 < refused < tried
