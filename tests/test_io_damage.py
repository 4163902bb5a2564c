"""Files that are damaged, hostile, or no files; and files that appear whole or not at all."""

import json
import os
import stat
import struct
import time
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from commands import start
from meshes import grid
from scipy.io import savemat
from scipy.sparse import eye

from cdcp_igl import MeshError
from cdcp_igl.io import read_mesh, read_texture, write_map
from cdcp_igl.io.contents import contents_of
from cdcp_igl.io.output import remove_stale, try_to_write, whole_file
from cdcp_igl.io.painted import images_of

V = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
F = np.array([[0, 1, 2], [0, 2, 3]])
OBJ = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
PLY = "ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty double y\n" + (
    "property double z\nelement face {}\nproperty list {} {} vertex_indices\nend_header\n"
)
ROWS = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n"
BINARY = PLY.replace("ascii", "binary_little_endian").format(1, "uint", "int").encode()
ONE = PLY.format(1, "uint", "int") + ROWS
FACETS = "".join(
    "facet normal 0 0 1\nouter loop\n"
    + "".join("vertex {} {} {}\n".format(*corner) for corner in triangle)
    + "endloop\nendfacet\n"
    for triangle in V[F]
)
SOLID = f"solid a\n{FACETS}endsolid a\n"
BINARY_STL = bytes(80) + struct.pack("<I", 2)
BINARY_STL += b"".join(struct.pack("<12fH", 0, 0, 1, *np.ravel(t), 0) for t in V[F])


def unreadable(path):
    with pytest.raises(MeshError) as caught:
        read_mesh(path)
    assert caught.value.defect == "unreadable file"
    assert path.name in str(caught.value)
    for python in ("Error", "could not convert", "invalid literal", "object", "b'"):
        assert python not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("unknown.xyz", "0 0 0\n", "no known type"),
        ("word.obj", OBJ + "f 1 2 x\n", "line 5: 'x' is no corner"),
        ("number.obj", "v 0 0 zero\n", "line 1: 'zero' is no number"),
        ("short.obj", "v 0 0\n", "line 1: it has too few numbers"),
        ("zero.obj", OBJ + "f 0 1 2\n", "count from 1"),
        ("before.obj", OBJ + "f -5 1 2\n", "before the first"),
        ("goes on.obj", OBJ + "f 1 2 \\\n", "goes on"),
        ("utf-16.obj", OBJ.encode("utf-16"), "no text in UTF-8"),
        ("binary.off", "OFF BINARY\n", "it is binary"),
        ("word.off", "OFF\n1 0 0\n0 0 zero\n", "line 3: 'zero' is no number"),
        ("counts.off", "OFF\n1 one 0\n", "line 2: 'one' is no count"),
        ("negative.off", "OFF\n-5 1 0\n0 0 0\n", "a count is negative"),
        ("huge.off", "OFF\n99999999999 0 0\n0 0 0\n", "1 vertices and 0 faces of 99,999,999,999"),
        ("index.off", "OFF\n1 1 0\n0 0 0\n3 0 0 0.5\n", "line 4: '0.5' is no index"),
        ("cut faces.off", f"OFF\n4 2 0\n{ROWS}3 0 1 2\n", "4 vertices and 1 faces of 4 and 2"),
        ("cut line.off", f"OFF\n4 1 0\n{ROWS}3 0 1", "line 7: a corner is missing"),
        ("pointer.obj", "version https://git-lfs.github.com/spec/v1\nsize 9\n", "git lfs pull"),
        ("empty.ply", "", "no vertices were found in"),
        ("header.ply", "ply\nformat ascii 1.0\nelement vertex 3\n", "no end of it"),
        ("type.ply", PLY.format(1, "uchar", "half"), "its header says 'property list uchar half"),
        ("half.ply", PLY.format(1, "float", "int"), "its header says 'property list float"),
        ("format.ply", "ply\nelement vertex 0\nend_header\n", "does not state the format"),
        ("axes.ply", PLY.format(1, "uchar", "int").replace(" z", " w") + ROWS + "0\n", "no x, y"),
        ("no list.ply", ONE.replace("list uint ", "") + "7\n", "its faces are no lists"),
        ("index.ply", PLY.format(1, "uchar", "float") + ROWS + "3 0 1 1.5\n", "no integers"),
        ("word.ply", ONE + "3 0 x 2\n", "line 5 after its header: 'x'"),
        ("long.ply", ONE + "1000000000 0 1 2\n", "1,000,000,000 entries in face"),
        ("list.ply", ONE + "-3\n", "-3 entries in face"),
        ("more.ply", ONE + "3 0 1 2 3\n", "more numbers than its header says"),
        ("cut rows.ply", ONE[:-8], "2 rows of 4 in vertex"),
        ("blank.ply", PLY.format(2, "uchar", "int") + ROWS + "3 0 1 2\n \n", "it is cut off"),
        ("cut faces.ply", BINARY + V.tobytes() + b"\3\0\0\0\0", "0 rows of 1 in face"),
        ("huge.ply", BINARY.replace(b"ex 4", b"ex 4000000000000") + V.tobytes(), "4 rows of 4,000"),
        ("cut.stl", BINARY_STL[:-20], "cut off, or no stl"),
        ("facet.stl", SOLID.replace("vertex 0.0 1.0 0.0\n", ""), "three"),
        ("end.stl", SOLID.replace("endsolid a", ""), "has no end"),
        ("cut.npz", b"PK\3\4", "no zip archive"),
        ("garbage.mat", bytes(range(256)), "cut off, or damaged"),
        ("unknown.mat", bytes(range(1, 200)), "no MATLAB header"),
        ("v73.mat", b"MATLAB 7.3 MAT-file".ljust(124) + b"\0\2IM", "version 7.3"),
    ],
)
def test_messages_are_about_the_file(tmp_path, name, text, says, capfd):
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    assert says in unreadable(path)
    assert capfd.readouterr() == ("", "")


def test_every_truncation_of_a_file_with_counts_is_noticed(tmp_path):
    V, F = grid(3, 4)
    write_map(tmp_path / "a.ply", V, F, V[:, :2])
    np.savez(tmp_path / "a.npz", V=V, F=F)
    savemat(tmp_path / "a.mat", {"v": V, "f": F})
    for path in [tmp_path / f"a.{suffix}" for suffix in ("ply", "npz", "mat")]:
        data = path.read_bytes()
        for length in range(0, len(data) - 8, 41):
            path.write_bytes(data[:length])
            with pytest.raises(MeshError):
                read_mesh(path)


# -- archives --------------------------------------------------------------------------


@pytest.mark.filterwarnings("ignore:.*spmatrix:DeprecationWarning")  # of SciPy 1.18 and later
@pytest.mark.parametrize(
    ("form", "V"),
    [
        *[("4", eye(4, format="csc")), ("5", V + 1j), ("5", "text")],
    ],
)
def test_what_is_no_matrix_of_real_numbers_in_mat(tmp_path, form, V):
    path = tmp_path / "a.mat"
    savemat(path, {"V": V, "F": F}, format=form)
    assert "V is no array of real numbers" in unreadable(path)


@pytest.mark.parametrize(
    ("name", "V", "says"),
    [
        ("V", np.zeros(3), "V is no table, but has shape (3,)"),
        ("V", np.array([[1j]]), "V is no array of real numbers"),
        ("V", np.array([{}]), "V is no array of real numbers, or cut off"),  # no pickle
        ("points", V, "not F, points"),
    ],
)
def test_what_is_no_table_of_real_numbers_in_npz(tmp_path, name, V, says):
    path = tmp_path / "a.npz"
    np.savez(path, F=F, **{name: V})
    assert says in unreadable(path)


def zipped(path, method, change=lambda data: data):
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


@pytest.mark.parametrize("shape", [b"(4000000000, 3), }", b"(5, 3), }", b"(3, 3), }"])
def test_a_header_with_another_shape_than_the_array(tmp_path, shape):
    path = tmp_path / "a.npz"
    there = b"(4, 3), }         "
    wrong = shape.ljust(len(there))
    zipped(path, zipfile.ZIP_STORED, lambda data: data.replace(there, wrong))
    unreadable(path)


def test_bombs_are_refused_before_they_go_off(tmp_path):
    """75 MB of zeros in 75 kB; the limit is on what unpacks, not on what is there."""
    zeros = np.zeros((3 << 20, 3))
    path = tmp_path / "a.npz"
    np.savez_compressed(path, V=zeros, F=F)
    assert "more than 100 times" in unreadable(path)
    savemat(tmp_path / "a.mat", {"V": zeros, "F": F}, do_compression=True)
    assert "more than 100 times" in unreadable(tmp_path / "a.mat")
    np.savez(path, V=zeros, F=F)  # stored as it is
    assert len(read_mesh(path)[0]) == len(zeros)
    np.savez_compressed(path, V=V, F=F, other=zeros)  # nobody unpacks it
    assert len(read_mesh(path)[0]) == len(V)


# -- what is no file -------------------------------------------------------------------


def test_a_folder_is_no_file_and_a_missing_file_an_os_error(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("folder.obj").mkdir()
    for name in ("folder.obj", "."):
        with pytest.raises(MeshError, match=rf"'{name}' is a folder\. .*cdcp_igl.batch"):
            read_mesh(name)
    with pytest.raises(FileNotFoundError):
        read_mesh("a.obj")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no FIFOs on this system")
def test_fifos_and_devices_are_not_waited_for(tmp_path):
    fifo, device = tmp_path / "a.obj", tmp_path / "b.obj"
    os.mkfifo(fifo)
    device.symlink_to("/dev/zero")
    for path in (fifo, device):
        assert "device, a FIFO" in unreadable(path)


# -- every byte ------------------------------------------------------------------------

# In another process, as what is tested for is the end of the process. The byte 0x3F, as the type
# of an array in a mat file, ends that of SciPy's reader.
DAMAGE = """
import json, sys
from pathlib import Path
import numpy as np
from cdcp_igl import MeshError
from cdcp_igl.io import read_mesh

random = np.random.default_rng(7)
counts = {}
for path in sorted(Path(sys.argv[1]).iterdir()):
    data = path.read_bytes()
    refused = 0
    for at in range(min(len(data), 2000)):
        wrong = [data[at] ^ 1 << random.integers(8), 0x3F, random.integers(256)]
        for byte in wrong if path.name == "a.mat" else wrong[:1]:
            path.write_bytes(data[:at] + bytes([byte]) + data[at + 1:])
            try:
                V, F = read_mesh(path)
                assert V.ndim == F.ndim == 2, (path, at, byte)
            except MeshError as error:
                assert error.defect in ("unreadable file", "too few corners")
                refused += 1
    counts[path.name] = [refused, len(data)]
print(json.dumps(counts))
"""


def test_any_wrong_byte_is_a_mesh_or_a_mesh_error(tmp_path):
    faces = "3 0 1 2\n3 0 2 3\n"
    header = PLY.replace("ascii", "binary_little_endian").format(2, "uchar", "int")
    rows = struct.pack("<B3iB3i", 3, 0, 1, 2, 3, 0, 2, 3)
    files = {
        "a.obj": (OBJ + "f 1/1 2/2/1 3//1\nf -4 -2 4\n").encode(),
        "a.off": f"OFF\n4 2 0\n{ROWS}{faces}".encode(),
        "ascii.ply": (PLY.format(2, "uchar", "int") + ROWS + faces).encode(),
        "binary.ply": header.encode() + V.tobytes() + rows,
        "ascii.stl": SOLID.encode(),
        "binary.stl": BINARY_STL,
    }
    for name, data in files.items():
        (tmp_path / name).write_bytes(data)
    write_map(tmp_path / "a.glb", V, F, V[:, :2])
    np.savez(tmp_path / "a.npz", V=V, F=F)
    np.savez_compressed(tmp_path / "packed.npz", V=V, F=F)
    for name, form, packed in (("a", "5", False), ("packed", "5", True), ("old", "4", False)):
        savemat(tmp_path / f"{name}.mat", {"V": V, "F": F}, format=form, do_compression=packed)
    run = start("-c", DAMAGE, tmp_path, timeout=300)
    assert (run.returncode, run.stderr) == (0, "")
    counts = json.loads(run.stdout)
    assert len(counts) == 12
    assert all(refused > 0 for refused, _ in counts.values())


def test_damaged_scenes_are_read_or_refused(tmp_path):
    """Cut off, or with wrong bytes in a row, in the text or behind it: 60 of them."""
    random, path = np.random.default_rng(4), tmp_path / "a.glb"
    write_map(path, V, F, V[:, :2])
    data, refused = path.read_bytes(), 0
    for k in range(60):
        at = int(random.integers(1, len(data) if k % 2 else 1500))
        wrong = random.bytes(int(random.integers(1, 9)))
        path.write_bytes(data[:at] if k < 20 else data[:at] + wrong + data[at + len(wrong) :])
        for read in (read_mesh, read_texture, images_of, contents_of):
            try:
                read(path)
            except (MeshError, ValueError):
                refused += 1
    assert 60 < refused < 240


# -- files that appear whole or not at all ---------------------------------------------


posix = pytest.mark.skipif(os.name != "posix", reason="not on this system")


def write(path, text="new"):
    with whole_file(path) as unfinished:
        unfinished.write_text(text)


def mode(path):
    return stat.S_IMODE(path.stat().st_mode)


@pytest.mark.parametrize("error", [OSError, KeyboardInterrupt])
def test_a_failed_body_leaves_the_old_file_alone(tmp_path, error):
    path = tmp_path / "a.json"
    path.write_text("old")

    def write_and_fail():
        with whole_file(path) as unfinished:
            assert unfinished.parent == tmp_path
            assert unfinished.suffix == ".json"
            unfinished.write_text("ne")
            raise error

    with pytest.raises(error):
        write_and_fail()
    try_to_write(path)
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["a.json"]


def test_a_full_disk_is_noticed(tmp_path):
    """The old files stay; in a process of its own, whose files have a largest size."""
    paths = [tmp_path / f"a.{suffix}" for suffix in ("glb", "npz", "obj", "ply")]
    for path in paths:
        path.write_text("old")
    code = f"""
import numpy as np, resource
from cdcp_igl.io import write_map
resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))
V = np.random.default_rng(0).random((999, 3))
for path in {[str(path) for path in paths]}:
    try:
        write_map(path, V, np.arange(999).reshape(-1, 3), V[:, :2])
    except OSError as error:
        print(error.filename)
"""
    run = start("-c", code)
    assert run.stdout.split() == [str(path) for path in paths]
    assert [path.read_text() for path in paths] == ["old"] * len(paths)
    assert sorted(tmp_path.iterdir()) == paths


def test_symbolic_links_and_permissions(tmp_path):
    (tmp_path / "link").symlink_to("target")
    write(tmp_path / "link")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "target").read_text() == "new"
    (tmp_path / "usual").touch()
    assert mode(tmp_path / "target") == mode(tmp_path / "usual")


@posix
@pytest.mark.parametrize("before", [0o600, 0o640, 0o755])
def test_modes_are_kept(tmp_path, before):
    path = tmp_path / "a"
    path.touch()
    path.chmod(before)
    with whole_file(path) as unfinished:
        assert mode(unfinished) == before  # nobody else reads it meanwhile
        unfinished.write_text("new")
    assert mode(path) == before
    assert path.read_text() == "new"


@posix
def test_devices_are_written_to_and_not_replaced(tmp_path):
    link = tmp_path / "a"
    link.symlink_to("/dev/null")
    try_to_write(link)
    write(link)
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)
    assert os.listdir(tmp_path) == ["a"]


@posix
def test_a_pipe_gets_the_text_and_stays(tmp_path):
    pipe = tmp_path / "a"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    try_to_write(pipe)
    write(pipe)
    assert os.read(reader, 9) == b"new"
    os.close(reader)
    assert stat.S_ISFIFO(pipe.stat().st_mode)


def test_names_as_long_as_they_can_be(tmp_path):
    path = tmp_path / ("ü" * 125 + ".json")
    write(path)
    assert path.read_text() == "new"


@pytest.mark.parametrize("function", [write, try_to_write])
@pytest.mark.parametrize("make", ["loop", "folder", "missing/a", "file/a"])
def test_errors_are_os_errors_and_name_what_was_asked_for(tmp_path, make, function):
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").touch()
    with pytest.raises(OSError, match=str(tmp_path / make)):
        function(tmp_path / make)
    assert sorted(os.listdir(tmp_path)) == ["file", "folder", "loop"]


def test_errors_of_the_body_name_what_was_asked_for(tmp_path):
    def fail():
        with whole_file(tmp_path / "a.b") as unfinished:
            os.listdir(unfinished)

    with pytest.raises(OSError, match=r"a\.b'$") as caught:
        fail()
    assert caught.value.filename == str(tmp_path / "a.b")
    assert os.listdir(tmp_path) == []


@pytest.mark.skipif(os.name != "posix" or os.getuid() == 0, reason="root may write everywhere")
def test_write_protected_files_are_not_replaced(tmp_path):
    path = tmp_path / "a"
    path.touch(0o444)
    with pytest.raises(PermissionError):
        write(path)


def test_threads_that_write_one_file_do_not_meet(tmp_path):
    """Whoever reads meanwhile sees what one of them wrote, and never a part of it."""
    path = tmp_path / "a.npz"
    V, F = np.random.default_rng(0).random((300, 3)), np.arange(300).reshape(-1, 3)
    write_map(path, V, F, V[:, :2])
    with ThreadPoolExecutor(4) as threads:
        written = [threads.submit(write_map, path, V, F, V[:, :2]) for _ in range(120)]
        while not all(one.done() for one in written):
            with np.load(path) as saved:
                assert saved["uv"].shape == (300, 2)
    assert [one.result() for one in written] == [None] * 120
    assert os.listdir(tmp_path) == ["a.npz"]


# -- what killed processes left -----------------------------------------------------------


def test_what_a_killed_process_left_is_removed_a_day_later(tmp_path):
    old, new = (tmp_path / f".cdcp_igl-{name}.json" for name in ("old", "new"))
    for left, hours in ((old, 25), (new, 23)):
        left.touch()
        os.utime(left, (time.time() - 3600 * hours,) * 2)
    write(tmp_path / "a.json")  # the first time in this folder
    assert sorted(os.listdir(tmp_path)) == [new.name, "a.json"]
    remove_stale(tmp_path, 0)
    assert os.listdir(tmp_path) == ["a.json"]
