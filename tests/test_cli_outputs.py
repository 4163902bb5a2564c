"""What `cdcp-igl map` writes and replaces, and what it leaves alone."""

import json
import os
from pathlib import Path

import igl
import matplotlib
import meshes
import numpy as np
import pytest
from commands import invoke

from cdcp_igl.io import read_mesh

# Letters stay letters in a drawing, and what is painted is small.
SMALL = {"svg.fonttype": "none", "figure.dpi": 30, "savefig.dpi": 30}


@pytest.fixture
def scan(tmp_path):
    path = tmp_path / "scan.obj"
    write_obj(path, *meshes.grid())
    return path


def write_obj(path, V, F):
    with path.open("w") as file:
        np.savetxt(file, V, "v %.17g %.17g %.17g")
        np.savetxt(file, F + 1, "f %d %d %d")


def test_files_that_are_there_are_kept_and_replaced_if_asked_to(scan, monkeypatch):
    monkeypatch.chdir(scan.parent)
    command = ["map", scan, "o.obj"]
    options = {"--report": "r.json", "--picture": "p.png", "--view": "v.html"}
    command += [text for option in options.items() for text in option]
    names = ["o.obj", *options.values()]
    for name in names:
        Path(name).write_text("v 0 0 0\n")
        result = invoke(*command)
        assert (result.exit_code, result.stderr) == (2, f"{name} is there; --force replaces it.\n")
        assert Path(name).read_text() == "v 0 0 0\n"
        assert sorted(os.listdir()) == sorted([scan.name, name])
        Path(name).unlink()
    for name in names:
        Path(name).write_text("v 0 0 0\n")
    with matplotlib.rc_context(SMALL):
        assert invoke(*command, "--force").exit_code == 0
    assert len(read_mesh("o.obj")[0]) == len(meshes.grid()[0])
    assert json.loads(Path("r.json").read_text())["valid"]
    assert Path("p.png").read_bytes().startswith(b"\x89PNG")
    assert Path("v.html").read_text().startswith("<!doctype html>")
    assert sorted(os.listdir()) == sorted([scan.name, *names])


@pytest.mark.parametrize("link", [None, os.symlink, os.link])
@pytest.mark.parametrize("force", [(), ("--force",)])
def test_the_surface_is_never_replaced(scan, link, force):
    before, out = scan.read_bytes(), scan
    if link:
        out = scan.with_name("link.obj")
        link(scan, out)
    result = invoke("map", scan, out, *force)
    assert result.exit_code == 2
    assert "is the surface itself" in result.stderr
    assert scan.read_bytes() == before


def test_many_surfaces_are_a_batch_of_their_own_types(scan):
    folder, before = scan.parent, scan.read_bytes()
    (folder / "b").mkdir()
    V, F = meshes.grid()
    write_obj(folder / "b" / "scan.obj", *meshes.grid(7, 7))
    np.savez(folder / "torn.npz", V=V, F=F[1:-30])
    np.savez(folder / "Käppchen 1.npz", V=V, F=F)
    files = [folder / "torn.npz", scan, folder / "b" / "scan.obj", folder / "Käppchen 1.npz"]
    out = folder / "maps"
    result = invoke("map", *files, "--out-dir", out)
    assert result.exit_code == 4
    assert "torn: MeshError: " in result.stdout
    assert "3 of 4 surfaces mapped" in result.stdout
    made = sorted(path.relative_to(out).as_posix() for path in out.rglob("*can.*"))
    assert made == ["b/scan.obj", "scan.obj"]
    for name, surface in (("scan.obj", scan), ("b/scan.obj", files[2]), (files[3].name, files[3])):
        np.testing.assert_array_equal(read_mesh(out / name)[0], read_mesh(surface)[0])
    assert invoke("map", scan, "--out-dir", folder).exit_code == 4
    assert scan.read_bytes() == before


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_what_cannot_be_written_is_known_before_anything_is_read(scan):
    scan.write_text("no surface")
    result = invoke("map", scan, "/proc/out.obj")
    assert result.exit_code == 1
    assert result.stderr.startswith("Not written: /proc/out.obj: ")


def test_a_last_line_that_is_left_open_is_ended_first(scan):
    scan.write_bytes(scan.read_bytes().rstrip())
    out = scan.with_name("o.obj")
    assert invoke("map", scan, out).exit_code == 0
    assert len(igl.read_triangle_mesh(str(out))[1]) == len(meshes.grid()[1])


def test_what_clean_leaves_alone_comes_back_as_it_was(scan):
    whole = f"g skin\n{scan.read_text()}"
    for name, text, kept in (("whole", whole, True), ("folded", f"{whole}f 1 2 1\n", False)):
        scan.write_text(text)
        out = scan.with_name(f"{name}.obj")
        result = invoke("map", scan, out, "--clean")
        assert result.exit_code == 0, result.output
        assert ("g skin" in out.read_text()) == kept
        assert ("  note                dropped 1 face" in result.stdout) != kept


def test_with_cut_picture_and_page_show_all_parts_and_any_name(scan):
    V, F = meshes.grid()
    V, F = np.vstack([V, V + 30]), np.vstack([F, F + len(V)])
    try:
        scan = scan.rename(scan.with_name(os.fsdecode(b"Stra\xdfe.obj")))  # Latin-1
        name = "Stra\\xdfe.obj"
    except OSError:  # a file system that takes UTF-8 only
        name = scan.name
    write_obj(scan, V, F)
    picture, page = scan.with_name("p.svg"), scan.with_name("v.html")
    options = ("--cut", "--picture", picture, "--view", page)
    with matplotlib.rc_context(SMALL):
        result = invoke("map", scan, scan.with_name("o.obj"), *options)
    assert (result.exit_code, result.stderr) == (0, "")
    for text in (picture.read_text(), page.read_text().replace("\\\\", "\\")):
        assert name in text
        assert f"{len(V)} vertices" in text
        assert "2 disks" in text
