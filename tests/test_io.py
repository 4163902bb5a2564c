"""Meshes from files, maps to files, and what damaged files do."""

import os
import struct

import igl
import meshes
import numpy as np
import pytest
from scipy.io import savemat

import cdcp_igl
from cdcp_igl.io import WRITABLE, read_mesh, whole_file, write_map

V, F = meshes.grid()
UV = cdcp_igl.cdcp(V, F)


@pytest.mark.parametrize("suffix", [".obj", ".off", ".ply"])
def test_reads_what_libigl_writes(tmp_path, suffix):
    path = tmp_path / f"mesh{suffix}"
    igl.write_triangle_mesh(str(path), V, F.astype(np.int64))
    positions, faces = read_mesh(path)
    np.testing.assert_allclose(positions, V, atol=1e-5)  # libigl writes six digits
    np.testing.assert_array_equal(faces, F)


@pytest.mark.parametrize("encoding", [igl.FileEncoding.Ascii, igl.FileEncoding.Binary])
def test_split_vertices_of_stl_are_merged_in_order(tmp_path, encoding):
    path = tmp_path / "mesh.stl"
    exact = V.astype(np.float32).round(3).astype(float)
    igl.write_triangle_mesh(str(path), exact, F.astype(np.int64), encoding)
    positions, faces = read_mesh(path)
    assert cdcp_igl.check(positions, faces).is_disk
    np.testing.assert_allclose(positions[faces], exact[F], atol=1e-6)
    first_seen = np.unique(faces.ravel(), return_index=True)[1]
    assert (np.diff(first_seen) > 0).all()


@pytest.mark.parametrize("suffix", WRITABLE)
def test_round_trip_is_exact(tmp_path, suffix):
    path = tmp_path / f"map{suffix}"
    write_map(path, V, F, UV)
    positions, faces = read_mesh(path)
    np.testing.assert_array_equal(positions, V)
    np.testing.assert_array_equal(faces, F)


def test_texture_coordinates_in_square_and_disk(tmp_path):
    def written(**options):
        write_map(tmp_path / "map.obj", V, F, UV, **options)
        lines = (tmp_path / "map.obj").read_text().splitlines()
        return np.array([line.split()[1:] for line in lines if line.startswith("vt ")], float)

    np.testing.assert_array_equal(written(), (UV + 1) / 2)
    np.testing.assert_array_equal(written(disk=True), UV)


def test_libigl_reads_the_texture_coordinates(tmp_path):
    write_map(tmp_path / "map.obj", V, F, UV)
    positions, texture, _, faces, corners, _ = igl.readOBJ(str(tmp_path / "map.obj"))
    np.testing.assert_allclose(positions, V)
    np.testing.assert_allclose(texture[:, :2], (UV + 1) / 2)
    np.testing.assert_array_equal(faces, F)
    np.testing.assert_array_equal(corners, F)


def test_npz_holds_the_map_and_planar_meshes_get_a_third_column(tmp_path):
    flat = V[:, :2]
    write_map(tmp_path / "map.npz", flat, F, UV)
    with np.load(tmp_path / "map.npz") as data:
        np.testing.assert_array_equal(data["uv"], UV)
        np.testing.assert_array_equal(data["V"], flat)
    write_map(tmp_path / "map.obj", flat, F, UV)
    np.testing.assert_array_equal(read_mesh(tmp_path / "map.obj")[0], np.c_[flat, 0 * flat[:, 0]])


def test_obj_dialects(tmp_path):
    path = tmp_path / "dialect.OBJ"
    path.write_text(
        "# a comment\nmtllib x.mtl\nv 0 0 0 1\nv 1 0 0 0.5 0.5 0.5\nv 1 1 0\nv 0 1 0\n"
        "vn 0 0 1\nvt 0 0\ng group\nf 1/1/1 2//1 3 4/1\nv 2 0 0\nf -1 -3 2\n"
    )
    positions, faces = read_mesh(path)
    assert positions.shape == (5, 3)
    assert faces.tolist() == [[0, 1, 2], [0, 2, 3], [4, 2, 1]]


def test_matlab_files_count_from_one(tmp_path):
    savemat(tmp_path / "mesh.mat", {"v": V, "f": (F + 1).astype(np.uint16)})
    notes = []
    positions, faces = read_mesh(tmp_path / "mesh.mat", notes.append)
    np.testing.assert_array_equal(positions, V)
    np.testing.assert_array_equal(faces, F)
    assert "1 was subtracted" in notes[0]

    np.savez(tmp_path / "mesh.npz", V=V, F=F)
    notes.clear()
    np.testing.assert_array_equal(read_mesh(tmp_path / "mesh.npz", notes.append)[1], F)
    assert not notes


HEADER = (
    b"ply\nformat binary_little_endian 1.0\nelement vertex %d\nproperty float x\nproperty "
    b"float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\n"
    b"end_header\n"
)

# libigl's readers abort, hang or exhaust the memory on some of these.
DAMAGED = {
    "noise.obj": bytes(range(256)) * 4 + b"\nv 1 2\n",
    "words.obj": b"v a b c\nf 1 2 3\n",
    "two corners.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\n",
    "noise.off": bytes(range(256)),
    "empty.off": b"",
    "huge.off": b"OFF\n1000000000 1000000000 0\n0 0 0\n",
    "cut off.off": b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1\n",
    "noise.ply": bytes(range(256)),
    "empty.ply": b"",
    "cut off.ply": HEADER % 3 + struct.pack("<9f", *range(9)),
    "huge.ply": HEADER % 2_000_000_000 + b"0" * 99,
    "unknown.ply": b"ply\nformat ebcdic 1.0\nend_header\n",
    "noise.stl": bytes(range(256)),
    "empty.stl": b"",
    "cut off.stl": b"\0" * 80 + struct.pack("<I", 1000) + b"\0" * 60,
    "noise.npz": bytes(range(256)),
    "empty.npz": b"",
    "noise.mat": bytes(range(256)) * 2,
    "empty.mat": b"",
    "mesh.docx": b"v 0 0 0\n",
    "no suffix": b"v 0 0 0\n",
}


@pytest.mark.parametrize(("name", "content"), DAMAGED.items(), ids=DAMAGED.keys())
def test_damaged_files_are_refused(tmp_path, name, content):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(cdcp_igl.MeshError) as raised:
        read_mesh(path)
    assert raised.value.remedy
    if raised.value.defect == "unreadable file":
        assert name in str(raised.value)


def test_archives_without_a_mesh(tmp_path):
    np.savez(tmp_path / "other.npz", x=V)
    np.savez(tmp_path / "pickled.npz", V=np.array([{}], dtype=object), F=F)
    for name in ("other.npz", "pickled.npz"):
        with pytest.raises(cdcp_igl.MeshError, match=name):
            read_mesh(tmp_path / name)


def test_missing_file_and_folder(tmp_path):
    with pytest.raises(FileNotFoundError):
        read_mesh(tmp_path / "missing.obj")
    (tmp_path / "folder.obj").mkdir()
    with pytest.raises(IsADirectoryError):
        read_mesh(tmp_path / "folder.obj")
    with pytest.raises(FileNotFoundError):
        write_map(tmp_path / "missing" / "map.obj", V, F, UV)
    with pytest.raises(ValueError, match="Writable"):
        write_map(tmp_path / "map.stl", V, F, UV)


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path):
    target = tmp_path / "map.obj"
    target.write_text("old")

    def fail():
        with whole_file(target) as unfinished:
            unfinished.write_text("half")
            assert target.read_text() == "old"
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail()
    assert target.read_text() == "old"
    assert os.listdir(tmp_path) == ["map.obj"]


def test_a_finished_write_replaces_through_a_link(tmp_path):
    (tmp_path / "real.npz").write_text("old")
    (tmp_path / "link.npz").symlink_to(tmp_path / "real.npz")
    write_map(tmp_path / "link.npz", V, F, UV)
    assert (tmp_path / "link.npz").is_symlink()
    np.testing.assert_array_equal(read_mesh(tmp_path / "real.npz")[0], V)
