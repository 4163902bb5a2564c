"""What `cdcp-igl map` replaces, and what it leaves alone."""

import json
import os
import stat
import subprocess
import sys
from pathlib import Path

import igl
import matplotlib
import meshes
import numpy as np
import pytest
from batches import ROOT
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from cdcp_igl.batching import mapped
from cdcp_igl.batching.stamps import Stamp, put_stamp, read_stamp
from cdcp_igl.command_line.program import app
from cdcp_igl.io import read_mesh, write_map


def invoke(*arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments])


@pytest.fixture
def scan(tmp_path):
    path = tmp_path / "scan.obj"
    write_obj(path, *meshes.grid())
    return path


def write_obj(path, V, F):
    with path.open("w") as file:
        np.savetxt(file, V, "v %.17g %.17g %.17g")
        np.savetxt(file, F + 1, "f %d %d %d")


@pytest.mark.parametrize("suffix", ["npz", "obj", "ply", "glb"])
def test_what_was_made_from_the_surface_is_made_again(scan, suffix):
    out = scan.with_name(f"out.{suffix}")
    assert invoke("map", scan, out).exit_code == 0
    first = out.read_bytes()
    assert invoke("map", scan, out, "--mobius", "area").exit_code == 0
    assert out.read_bytes() != first
    assert invoke("map", scan, out).exit_code == 0
    assert out.read_bytes() == first


@pytest.mark.parametrize("option", ["", "--report", "--picture"])
def test_what_was_made_from_something_else_is_kept(scan, monkeypatch, option):
    name = {"": "o.obj", "--report": "r.json", "--picture": "p.png"}[option]
    other = scan.with_name(name)
    other.write_text("v 0 0 0\n")
    arguments = ["map", scan, other] if not option else ["map", scan, "o.ply", option, other]
    monkeypatch.chdir(scan.parent)
    with monkeypatch.context() as patched:
        patched.setattr(mapped, "disk_map", lambda *args, **options: pytest.fail("computed"))
        result = invoke(*arguments)
    assert result.exit_code == 2
    assert (
        result.stderr == f"{other} is there, and was not made from scan.obj; --force replaces it.\n"
    )
    assert other.read_text() == "v 0 0 0\n"
    assert sorted(os.listdir()) == sorted([scan.name, name])
    assert invoke(*arguments, "--force").exit_code == 0
    assert invoke(*arguments).exit_code == 0
    write_obj(scan, *meshes.grid(7, 7))  # another surface of this name
    assert invoke(*arguments).exit_code == 2


@pytest.mark.parametrize("link", [None, os.symlink, os.link])
def test_the_surface_is_never_replaced(scan, link):
    before, out = scan.read_bytes(), scan
    if link:
        out = scan.with_name("link.obj")
        link(scan, out)
    for force in ((), ("--force",)):
        result = invoke("map", scan, out, *force)
        assert result.exit_code == 2
        assert "is the surface itself" in result.stderr
    assert scan.read_bytes() == before


def test_two_surfaces_are_no_surface_and_its_map(scan):
    other = scan.with_name("other.obj")
    write_obj(other, *meshes.grid(7, 7))
    before = other.read_bytes()
    assert invoke("map", scan, other).exit_code == 2
    assert other.read_bytes() == before
    result = invoke("map", scan, other, scan.with_name("third.obj"))
    assert result.exit_code == 2
    assert "--out-dir" in result.stderr


def test_many_surfaces(scan):
    folder = scan.parent
    (folder / "b").mkdir()
    V, F = meshes.grid()
    write_obj(folder / "b" / "scan.obj", *meshes.grid(7, 7))
    np.savez(folder / "torn.npz", V=V, F=F[1:-30])
    np.savez(folder / "Käppchen 1.npz", V=V, F=F)
    files = [folder / "torn.npz", scan, folder / "b" / "scan.obj", folder / "Käppchen 1.npz"]
    out = folder / "maps"
    result = invoke("map", *files, "--out-dir", out)
    assert result.exit_code == 4
    assert f"{files[0]}: several" in result.stderr
    assert "1 of 4 surfaces are not mapped" in result.stderr
    made = sorted(path.relative_to(out).as_posix() for path in out.rglob("*.*"))
    assert made == ["Käppchen 1.npz", "b/scan.obj", "scan.obj"]
    for name, surface in (("scan.obj", scan), ("b/scan.obj", files[2])):
        np.testing.assert_array_equal(read_mesh(out / name)[0], read_mesh(surface)[0])
    assert invoke("map", *files[1:], "--out-dir", out, "-q").output == ""
    result = invoke("map", *files, "--out-dir", out, "--report", folder / "r.json")
    assert result.exit_code == 2
    result = invoke("map", *files[1:2], "--out-dir", folder)
    assert result.exit_code == 4
    assert "is the surface itself" in result.stderr


@pytest.mark.parametrize(
    ("options", "message"),
    [(("--clean",), "leave out clean"), (("--center", 3), "must be a method")],
)
def test_options_that_do_not_go_together_are_no_fault_of_a_surface(scan, options, message):
    out = scan.with_name("maps")
    result = invoke("map", scan, "--out-dir", out, "--cut", *options)
    assert result.exit_code == 2
    assert message in result.stderr
    assert not out.exists()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_what_cannot_be_written_is_known_before_the_map(scan, monkeypatch):
    with monkeypatch.context() as patched:
        patched.setattr(mapped, "disk_map", lambda *args, **options: pytest.fail("computed"))
        result = invoke("map", scan, "/proc/out.obj")
    assert result.exit_code == 1
    assert result.stderr.startswith("Not written: /proc/out.obj: ")


def test_devices_and_pipes_are_written_to_and_not_replaced(scan):
    for name in ("null.obj", "full.obj"):
        scan.with_name(name).symlink_to(f"/dev/{Path(name).stem}")
    assert invoke("map", scan, scan.with_name("null.obj")).exit_code == 0
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)
    result = invoke("map", scan, scan.with_name("full.obj"))
    assert result.exit_code == 1
    assert "full.obj: No space left on device" in result.stderr
    pipe = scan.with_name("pipe.obj")
    os.mkfifo(pipe)
    with subprocess.Popen(
        [sys.executable, "-m", "cdcp_igl", "map", scan, pipe], stdout=subprocess.DEVNULL, cwd=ROOT
    ) as process:
        text = pipe.read_text()
    assert process.returncode == 0
    assert text.count("\nvt ") == len(meshes.grid()[0])


def test_a_last_line_that_is_left_open_is_ended_first(scan):
    scan.write_bytes(scan.read_bytes().rstrip())
    out = scan.with_name("o.obj")
    assert invoke("map", scan, out).exit_code == 0
    igl.read_triangle_mesh(str(out))
    last, mark = out.read_bytes().splitlines()[-2:]
    assert last.startswith(b"f ")
    assert mark.startswith(b"# cdcp_igl")
    assert invoke("map", scan, out).exit_code == 0


def test_what_clean_leaves_alone_comes_back_as_it_was(scan):
    whole = f"g skin\n{scan.read_text()}"
    for name, text, kept in (("whole", whole, True), ("folded", f"{whole}f 1 2 1\n", False)):
        scan.write_text(text)
        out = scan.with_name(f"{name}.obj")
        result = invoke("map", scan, out, "--clean")
        assert result.exit_code == 0, result.output
        assert ("g skin" in out.read_text()) == kept


def test_a_report_says_what_it_was_made_from(scan):
    report = scan.with_name("r.json")
    assert invoke("map", scan, scan.with_name("o.obj"), "--report", report).exit_code == 0
    assert json.loads(report.read_text())["made"].startswith("cdcp_igl: input ")
    assert read_stamp(report) == read_stamp(scan.with_name("o.obj"))


@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf"])
def test_pictures_carry_the_mark(scan, suffix):
    from matplotlib import image as mpimg

    picture = scan.with_suffix(suffix)
    assert invoke("map", scan, scan.with_name("o.npz"), "--picture", picture).exit_code == 0
    assert read_stamp(picture) == read_stamp(scan.with_name("o.npz"))
    if suffix == ".png":
        assert mpimg.imread(picture).ndim == 3


def test_with_cut_picture_and_page_show_all_parts(scan):
    V, F = meshes.grid()
    V, F = np.vstack([V, V + 30]), np.vstack([F, F + len(V)])
    write_obj(scan, V, F)
    picture, page = scan.with_name("p.svg"), scan.with_name("v.html")
    options = ("--cut", "--picture", picture, "--view", page)
    with matplotlib.rc_context({"svg.fonttype": "none"}):  # text stays text
        assert invoke("map", scan, scan.with_name("o.obj"), *options).exit_code == 0
    for text in (picture.read_text(), page.read_text()):
        assert f"{len(V)} vertices" in text
        assert "2 disks" in text


@given(digits=st.text("0123456789abcdef", min_size=80, max_size=80))
def test_the_mark_is_read_as_it_was_put(tmp_path_factory, digits):
    stamp = Stamp(digits[:64], digits[64:])
    V, F = meshes.grid()
    uv = V[:, :2] / 10
    folder = tmp_path_factory.mktemp("marks")
    for suffix in (".npz", ".obj", ".ply", ".glb"):
        path = folder / f"map{suffix}"
        write_map(path, V, F, uv)
        assert read_stamp(path) is None
        put_stamp(path, stamp)
        assert read_stamp(path) == stamp
        if suffix != ".glb":
            np.testing.assert_array_equal(read_mesh(path)[0], V)
            np.testing.assert_array_equal(read_mesh(path)[1], F)


def test_a_mark_that_was_kept_among_comments(scan):
    """An obj file that was made from one of ours keeps its comments."""
    first, second = scan.with_name("first.obj"), scan.with_name("second.obj")
    assert invoke("map", scan, first).exit_code == 0
    assert invoke("map", first, second).exit_code == 0
    assert read_stamp(second) != read_stamp(first)
    assert invoke("map", first, second).exit_code == 0
