import os
import struct

import igl
import numpy as np
import pytest
from scipy.io import savemat

from cdcp_igl import MeshError, check, disk_map
from cdcp_igl.certificate import certify
from cdcp_igl.io import read_mesh, write_map
from cdcp_igl.io.stl import merge_duplicates
from cdcp_igl.surface.mesh import DiskMesh


def bumpy_grid(n=9):
    """A square grid with a bump, coordinates without a short decimal form."""
    x, y = (c.ravel() for c in np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, n)))
    V = np.column_stack([x, y, np.exp(-8 * ((x - 0.4) ** 2 + (y - 0.5) ** 2)) / 3])
    a = np.arange(n * n).reshape(n, n)[:-1, :-1].ravel()
    F = np.concatenate(
        [np.column_stack([a, a + 1, a + n + 1]), np.column_stack([a, a + n + 1, a + n])]
    )
    return V, F


POINTS = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\n"
ROWS = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n2 0 0\n"
V5 = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0]], float)


def ply_header(form, n, m, kind="float"):
    lines = [
        *("ply", f"format {form} 1.0", "comment made by hand", f"element vertex {n}"),
        *(f"property {kind} {axis}" for axis in "xyz"),
        *(f"element face {m}", "property list uchar int vertex_index", "end_header\n"),
    ]
    return "\n".join(lines)


def stl_facets(corners):
    facets = [b"\0" * 80, struct.pack("<I", len(corners))]
    facets += [struct.pack("<12fH", 0, 0, 1, *np.ravel(c), 0) for c in corners]
    return b"".join(facets)


# -- reading ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "faces"),
    [
        ("f 1 2 3\nf 1 3 4\n", [[0, 1, 2], [0, 2, 3]]),
        ("f 1 2 3 4\nf 2 5 3\n", [[0, 1, 2], [0, 2, 3], [1, 4, 2]]),
        ("f 1 2 5 3 4\n", [[0, 1, 4], [0, 4, 2], [0, 2, 3]]),
        ("f -5 -4 -3\nv 9 9 9\nf -6 -4 -3\n", [[0, 1, 2], [0, 2, 3]]),
        ("vt 0 0\nvn 0 0 1\nf 1/1/1 2/1/1 3/1/1\nf 1//1 3//1 4//1\n", [[0, 1, 2], [0, 2, 3]]),
        ("# a\no b\ng c\nusemtl d\nl 1 2\n  f 1 2 3 \r\n\nf\t1 3 4", [[0, 1, 2], [0, 2, 3]]),
        ("", np.empty((0, 3))),
    ],
)
def test_obj(tmp_path, text, faces):
    path = tmp_path / "a.OBJ"
    path.write_text(POINTS + text)
    V, F = read_mesh(path)
    np.testing.assert_array_equal(V[:5], V5)
    np.testing.assert_array_equal(F, faces)


def test_obj_with_colours(tmp_path):
    path = tmp_path / "a.obj"
    path.write_text("v 0 0 0 .1 .2 .3\nv 1 0 0 .1 .2 .3\nv 0 1 0 .1 .2 .3\nf 1 2 3\n")
    np.testing.assert_array_equal(read_mesh(path)[0], [[0, 0, 0], [1, 0, 0], [0, 1, 0]])


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
    V, F = read_mesh(path)
    np.testing.assert_array_equal(V, V5)
    np.testing.assert_array_equal(F, [[0, 1, 2], [0, 2, 3], [1, 4, 2], [0, 1, 4]])


@pytest.mark.parametrize("kind", ["float", "double"])
@pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_ply(tmp_path, form, kind):
    path = tmp_path / "a.ply"
    header = ply_header(form, 5, 2, kind).encode()
    if form == "ascii":
        body = (ROWS + "3 0 1 2\n3 0 2 3\n").encode()
    else:
        order = "<" if "little" in form else ">"
        body = V5.astype(order + {"float": "f4", "double": "f8"}[kind]).tobytes()
        body += struct.pack(order + "B3iB3i", 3, 0, 1, 2, 3, 0, 2, 3)
    path.write_bytes(header + body)
    V, F = read_mesh(path)
    np.testing.assert_array_equal(V, V5)
    np.testing.assert_array_equal(F, [[0, 1, 2], [0, 2, 3]])


@pytest.mark.parametrize("rows", [["9 0 1 2 3 -1 4 3 2 2"], ["4 0 1 2 3", "4 4 3 2 2"]])
def test_ply_strips(tmp_path, rows):
    path = tmp_path / "a.ply"
    header = ply_header("ascii", 5, len(rows)).replace("element face", "element tristrips")
    path.write_text(header.replace("list uchar", "list int") + ROWS + "\n".join(rows) + "\n")
    np.testing.assert_array_equal(read_mesh(path)[1], [[0, 1, 2], [2, 1, 3], [4, 3, 2]])


def test_ply_quads_and_points(tmp_path):
    path = tmp_path / "a.ply"
    path.write_text(ply_header("ascii", 5, 1) + ROWS + "4 0 1 2 3\n")
    np.testing.assert_array_equal(read_mesh(path)[1], [[0, 1, 2], [0, 2, 3]])
    path.write_text(ply_header("ascii", 5, 0) + ROWS)
    assert read_mesh(path)[1].shape == (0, 3)


@pytest.mark.parametrize(
    "name", ["a", "vertex part", "endloop of a facet with a vertex", "endsolid"]
)
@pytest.mark.parametrize("binary", [False, True])
def test_stl_corners_are_merged_in_order_of_appearance(tmp_path, binary, name):
    path = tmp_path / "a.stl"
    corners = V5[[[2, 0, 1], [3, 0, 2]]]
    if binary:
        path.write_bytes(stl_facets(corners))
    else:
        loops = ("".join("vertex {} {} {}\n".format(*p) for p in c) for c in corners)
        facets = (f"facet normal 0 0 1\nouter loop\n{a}endloop\nendfacet\n" for a in loops)
        path.write_text(f"solid {name}\n{''.join(facets)}endsolid {name}\n")
    V, F = read_mesh(path)
    np.testing.assert_array_equal(V, V5[[2, 0, 1, 3]])
    np.testing.assert_array_equal(F, [[0, 1, 2], [3, 1, 0]])


def test_merging_keeps_the_surface():
    V, F = bumpy_grid()
    merged, faces = merge_duplicates(V[F].reshape(-1, 3), np.arange(F.size).reshape(-1, 3))
    assert len(merged) == len(V)
    np.testing.assert_array_equal(merged[faces], V[F])
    assert (np.diff([np.flatnonzero(faces.ravel() == i)[0] for i in range(len(V))]) > 0).all()


@pytest.mark.parametrize("suffix", ["obj", "off", "ply"])
def test_reads_what_libigl_reads(tmp_path, suffix):
    path = tmp_path / f"a.{suffix}"
    igl.write_triangle_mesh(str(path), *bumpy_grid())
    for ours, theirs in zip(read_mesh(path), igl.read_triangle_mesh(str(path)), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-15)


@pytest.mark.parametrize("suffix", ["npz", "mat"])
@pytest.mark.parametrize("names", ["VF", "vf"])
@pytest.mark.parametrize("first", [0, 1])
def test_archives(tmp_path, suffix, names, first):
    V, F = bumpy_grid()
    path = tmp_path / f"a.{suffix}"
    arrays = {names[0]: V, names[1]: (F + first).astype(np.uint16)}
    savemat(path, arrays) if suffix == "mat" else np.savez(path, **arrays)
    notes = []
    read_V, read_F = read_mesh(path, notes.append)
    np.testing.assert_array_equal(read_V, V)
    np.testing.assert_array_equal(read_F, F)
    assert len(notes) == first


@pytest.mark.parametrize("suffix", ["npz", "mat"])
@pytest.mark.parametrize("first", [0, 1])
def test_fractional_indices_stay_to_be_refused(tmp_path, suffix, first):
    V, F = bumpy_grid()
    path = tmp_path / f"a.{suffix}"
    for fraction in (0, 0.5):
        faces = (F + first).astype(float)
        faces[[3, 5], 1] += fraction
        savemat(path, {"V": V, "F": faces}) if suffix == "mat" else np.savez(path, V=V, F=faces)
        report = check(*read_mesh(path))
        found = [(defect.name, defect.indices.tolist()) for defect in report.defects]
        assert found == ([("fractional index", [3, 5])] if fraction else [])


def test_indices_are_shifted_only_when_unambiguous(tmp_path):
    V, F = bumpy_grid()
    path = tmp_path / "a.npz"
    ambiguous = F[(F > 0).all(axis=1)]  # without vertex 0, but also without an index n
    np.savez(path, V=V, F=ambiguous)
    np.testing.assert_array_equal(read_mesh(path)[1], ambiguous)


# -- bad files -------------------------------------------------------------------------

LITTLE = ply_header("binary_little_endian", 5, 1).encode()
BAD = {
    "unknown.xyz": b"0 0 0\n",
    "nosuffix": b"",
    "word.obj": b"v 0 0 zero\n",
    "short.obj": b"v 0 0\n",
    "cut.obj": (POINTS + "f 1 2 3\nf 1").encode(),
    "empty.off": b"",
    "garbage.off": bytes(range(256)),
    "cut vertices.off": b"OFF\n5 1 0\n0 0 0\n",
    "cut faces.off": ("OFF\n5 2 0\n" + ROWS + "3 0 1 2\n").encode(),
    "cut line.off": ("OFF\n5 1 0\n" + ROWS + "3 0 1").encode(),
    "digon.off": ("OFF\n5 1 0\n" + ROWS + "2 0 1\n").encode(),
    "huge.off": b"OFF\n99999999999 1 0\n0 0 0\n",
    "negative.off": b"OFF\n-5 1 0\n0 0 0\n",
    "empty.ply": b"",
    "header.ply": b"ply\nformat ascii 1.0\nelement vertex 3\n",
    "type.ply": b"ply\nformat ascii 1.0\nelement vertex 1\nproperty half x\nend_header\n1\n",
    "format.ply": b"ply\nelement vertex 0\nend_header\n",
    "cut.ply": LITTLE + V5.astype("<f4").tobytes()[:-1],
    "cut faces.ply": LITTLE + V5.astype("<f4").tobytes() + b"\3\0\0",
    "cut rows.ply": (ply_header("ascii", 5, 1) + "0 0 0\n").encode(),
    "cut line.ply": (ply_header("ascii", 5, 1) + ROWS + "3 0 1\n").encode(),
    "huge.ply": ply_header("binary_little_endian", 10**12, 1).encode(),
    "axes.ply": b"ply\nformat ascii 1.0\nelement vertex 1\nproperty int a\nend_header\n1\n",
    "empty.stl": b"",
    "garbage.stl": bytes(range(256)) * 2,
    "cut.stl": stl_facets(V5[[[2, 0, 1], [3, 0, 2]]])[:-20],
    "empty.npz": b"",
    "garbage.npz": bytes(range(256)),
    "cut.npz": b"PK\3\4",
    "empty.mat": b"",
    "garbage.mat": bytes(range(256)),
    "v73.mat": b"MATLAB 7.3 MAT-file".ljust(124) + b"\0\2IM",
}


@pytest.mark.parametrize("name", BAD)
def test_bad_files_are_refused(tmp_path, name, capfd):
    path = tmp_path / name
    path.write_bytes(BAD[name])
    with pytest.raises(MeshError) as caught:
        read_mesh(path)
    assert caught.value.defect in ("unreadable file", "too few corners")
    assert capfd.readouterr() == ("", "")


def test_every_truncation_of_a_file_with_counts_is_noticed(tmp_path):
    V, F = bumpy_grid(4)
    write_map(tmp_path / "a.ply", V, F, V[:, :2])
    np.savez(tmp_path / "a.npz", V=V, F=F)
    savemat(tmp_path / "a.mat", {"v": V, "f": F})
    for path in [tmp_path / f"a.{suffix}" for suffix in ("ply", "npz", "mat")]:
        data = path.read_bytes()
        for length in range(0, len(data) - 8, 41):
            path.write_bytes(data[:length])
            with pytest.raises(MeshError):
                read_mesh(path)


def test_archives_without_a_mesh_are_refused(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, points=np.zeros((3, 3)))
    with pytest.raises(MeshError, match="points"):
        read_mesh(path)
    np.savez(path, V=np.array([{}]), F=np.zeros((1, 3)))
    with pytest.raises(MeshError, match="real numbers"):
        read_mesh(path)
    with path.open("wb") as file:
        np.save(file, np.zeros(3))
    with pytest.raises(MeshError, match="no zip archive"):
        read_mesh(path)


def test_the_message_names_line_and_file(tmp_path):
    path = tmp_path / "a.obj"
    path.write_text(POINTS + "f 1 2 x\n")
    with pytest.raises(MeshError, match=r"'a\.obj'.* line 6.*'x'"):
        read_mesh(path)


@pytest.mark.parametrize("name", ["folder", "folder.obj"])
def test_a_folder_is_no_file(tmp_path, monkeypatch, name):
    (tmp_path / name).mkdir()
    with pytest.raises(MeshError, match=rf"{name}' is a folder\. .*cdcp_igl.batch"):
        read_mesh(tmp_path / name)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(MeshError, match=r"'\.' is a folder"):
        read_mesh(".")


@pytest.mark.parametrize("suffix", ["npz", "mat"])
def test_transposed_arrays_are_named_with_their_shapes(tmp_path, suffix):
    V, F = bumpy_grid()
    path = tmp_path / f"a.{suffix}"
    save = savemat if suffix == "mat" else lambda file, arrays: np.savez(file, **arrays)
    save(path, {"V": V.T, "F": F})
    with pytest.raises(MeshError, match=r"V has shape \(3, \d+\), .*: transpose") as caught:
        read_mesh(path)
    assert caught.value.defect == "shape of V"


@pytest.mark.parametrize("suffix", ["obj", "stl", "npz", "mat"])
def test_missing_files_are_os_errors(tmp_path, suffix):
    with pytest.raises(FileNotFoundError):
        read_mesh(tmp_path / f"a.{suffix}")


# -- writing ---------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", ["obj", "ply", "npz"])
def test_round_trip_is_exact(tmp_path, suffix):
    V, F = bumpy_grid()
    uv = disk_map(V, F).uv
    path = tmp_path / f"größer als 1.{suffix}"
    write_map(path, V, F, uv, disk=True)
    read_V, read_F = read_mesh(path)
    np.testing.assert_array_equal(read_V, V)
    np.testing.assert_array_equal(read_F, F)
    np.testing.assert_array_equal(stored_uv(path), uv)
    assert os.listdir(tmp_path) == [path.name]


def stored_uv(path):
    if path.suffix == ".npz":
        return np.load(path)["uv"]
    if path.suffix == ".ply":
        header, _, body = path.read_bytes().partition(b"end_header\n")
        n = int(header.split()[header.split().index(b"vertex") + 1])
        return np.frombuffer(body, "<f8", 5 * n).reshape(n, 5)[:, 3:]
    lines = path.read_text().splitlines()
    return np.array([line.split()[1:] for line in lines if line.startswith("vt ")], float)


@pytest.mark.parametrize("suffix", ["obj", "ply"])
def test_texture_coordinates_fill_the_unit_square_and_stay_valid(tmp_path, suffix):
    V, F = bumpy_grid()
    path = tmp_path / f"a.{suffix}"
    write_map(path, V, F, disk_map(V, F).uv)
    texture = stored_uv(path)
    assert texture.min() >= 0
    assert texture.max() <= 1
    assert certify(DiskMesh(V, F), 2 * texture - 1).valid


def test_libigl_reads_texture_coordinates(tmp_path):
    V, F = bumpy_grid()
    path = tmp_path / "a.obj"
    write_map(path, V, F, V[:, :2], disk=True)
    _, TC, _, _, FTC, _ = igl.readOBJ(str(path))
    np.testing.assert_array_equal(TC[:, :2], V[:, :2])
    np.testing.assert_array_equal(FTC, F)


def test_planar_meshes_get_a_third_coordinate(tmp_path):
    V, F = bumpy_grid()
    write_map(tmp_path / "a.obj", V[:, :2], F, V[:, :2])
    np.testing.assert_array_equal(read_mesh(tmp_path / "a.obj")[0], V * [1, 1, 0])


def test_unknown_output_type(tmp_path):
    with pytest.raises(ValueError, match=r"\.npz \.obj \.ply"):
        write_map(tmp_path / "a.stl", *bumpy_grid(), np.zeros((81, 2)))
