"""The program as the system sees it: its streams, its signals, its imports, its files."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
from contextlib import suppress
from io import BytesIO, TextIOWrapper
from pathlib import Path

import igl
import matplotlib
import meshes
import numpy as np
import pytest
from commands import ROOT, invoke, start

from cdcp_igl.command_line import entry
from cdcp_igl.io import read_mesh

V, F = meshes.grid()
MAIN = "from cdcp_igl.command_line.entry import main; main()"
COMPARE = ("compare", "in.npz", "--methods", "lscm", "--time-limit", 0)  # makes no map
FULL = "Not printed: No space left on device"
needs_full = pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The working folder, with a surface."""
    monkeypatch.chdir(tmp_path)
    np.savez("in.npz", V=V, F=F)
    return tmp_path


@pytest.fixture
def main(folder, monkeypatch):
    """Run the program in this process; return what it exits with."""
    numbers = signal.SIGINT, signal.SIGTERM, signal.SIGHUP
    before = {number: signal.getsignal(number) for number in numbers}

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["cdcp-igl", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            entry.main()
        return ended.value.code

    yield run
    for number, handler in before.items():
        signal.signal(number, handler)


# -- streams ---------------------------------------------------------------------------


@needs_full
def test_a_full_stdout_is_said_in_a_line(main, monkeypatch):
    with open("/dev/full", "w") as full:
        monkeypatch.setattr(sys, "stdout", full)
        assert main("--help") == FULL


@needs_full
@pytest.mark.parametrize("broken", ["full", "closed"])
def test_compare_writes_its_files_where_stdout_takes_no_more(main, monkeypatch, broken):
    shutil.copy("in.npz", "other.npz")
    if broken == "full":
        stdout = os.open("/dev/full", os.O_WRONLY)
    else:
        reader, stdout = os.pipe()
        os.close(reader)
    stream = open(stdout, "w")  # noqa: SIM115 - closed below, with what it could not print
    monkeypatch.setattr(sys, "stdout", stream)
    code = main(*COMPARE, "other.npz", "--json", "r.json")
    with suppress(BrokenPipeError):
        stream.close()
    assert code == (FULL if broken == "full" else 1)
    assert re.findall('"mesh": "(.*)"', Path("r.json").read_text()) == ["in.npz", "other.npz"]


def test_a_closed_stdout(main, monkeypatch):
    monkeypatch.setattr(sys, "stdout", None)
    monkeypatch.setattr(sys, "stderr", None)
    assert main("map", "in.npz", "o.obj") == 0
    sys.stdout.close()
    sys.stderr.close()
    assert len(read_mesh("o.obj")[0]) == len(V)


@pytest.mark.parametrize("encoding", ["cp932", "ascii"])
@pytest.mark.parametrize("command", [("map", "in.npz", "ö.obj"), COMPARE])
def test_characters_that_the_terminal_lacks(main, monkeypatch, command, encoding):
    stdout = TextIOWrapper(BytesIO(), encoding=encoding)
    monkeypatch.setattr(sys, "stdout", stdout)
    assert main(*command) == 0
    stdout.flush()
    assert b"bius  " in stdout.buffer.getvalue() or b"lscm: " in stdout.buffer.getvalue()


def test_characters_that_the_font_lacks(main, recwarn):
    name = "日本語 हिंदी.npz"  # there is a warning for a character, and one for a script
    os.rename("in.npz", name)
    with matplotlib.rc_context({"figure.dpi": 30, "savefig.dpi": 30}):
        assert main("map", name, "o.obj", "--picture", "p.png") == 0
    assert recwarn.list == []


# -- signals ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("module", "number"),
    [
        ("typer", signal.SIGINT),
        ("scipy.sparse", signal.SIGTERM),  # by a compiled module
        ("matplotlib.backends.backend_svg", signal.SIGHUP),  # when the picture is begun
    ],
)
def test_a_stopped_program_leaves_what_was_there(folder, module, number):
    code = f"""
import os, sys
class Finder:
    def find_spec(self, name, path, target=None):
        if name == {module!r}:
            os.kill(os.getpid(), {int(number)})
sys.meta_path.insert(0, Finder())
{MAIN}
"""
    for name in ("o.obj", "p.svg"):
        Path(name).write_text("old")
    done = start("-c", code, "map", "in.npz", "o.obj", "--picture", "p.svg", "--force")
    said = "Interrupted\n" if number == signal.SIGINT else ""
    assert (done.returncode, done.stdout, done.stderr) == (128 + number, "", said)
    assert sorted(os.listdir()) == ["in.npz", "o.obj", "p.svg"]
    assert Path("o.obj").read_text() == Path("p.svg").read_text() == "old"


# -- imports ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("module", "extra"), [("typer", "cli"), ("rich", "cli"), ("matplotlib", "plot")]
)
def test_missing_extras_are_named(main, monkeypatch, module, extra, capsys):
    monkeypatch.setitem(sys.modules, module, None)
    if extra == "cli":  # imported again
        monkeypatch.delitem(sys.modules, "cdcp_igl.command_line.program", raising=False)
    code = main("map", "in.npz", "o.obj", "--picture", "p.png")
    said = str(code) if extra == "cli" else capsys.readouterr().err
    assert f"needs the extra: pip install '.[{extra}]'" in said
    assert extra == "cli" or code == 1
    assert os.listdir() == ["in.npz"]


HELP = """
from cdcp_igl.command_line import entry
for command in [], ["map"], ["check"], ["compare"], ["batch"]:
    sys.argv[1:] = [*command, "--help"]
    try:
        entry.main()
    except SystemExit:
        pass
"""


@pytest.mark.parametrize(
    ("code", "heavy"),
    [
        (HELP, {"cdcp_igl.algorithm", "numpy", "scipy", "matplotlib", "igl"}),
        ("import cdcp_igl, cdcp_igl.io", {"typer", "rich", "matplotlib", "scipy.io"}),
        ("import cdcp_igl; dir(cdcp_igl)", {"numpy", "scipy", "igl", "sksparse", "matplotlib"}),
        ("import cdcp_igl; cdcp_igl.DiskMap, cdcp_igl.reference.fdcp", {"rich", "typer"}),
    ],
)
def test_nothing_heavy_is_imported_without_need(code, heavy):
    done = start("-c", f"import sys\n{code}\nprint({heavy} & sys.modules.keys())")
    assert done.stdout.endswith("set()\n")


# -- the demo --------------------------------------------------------------------------


@pytest.mark.skipif(sys.platform == "win32", reason="needs sh")
def test_the_demo_takes_any_file_name_and_says_which_is_missing(folder):
    program = folder / ".venv" / "bin" / "cdcp-igl"
    program.parent.mkdir(parents=True)
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m cdcp_igl "$@"\n')
    program.chmod(0o755)
    name = 'Käppchen\'s "first" $HOME.npz'
    os.rename("in.npz", name)
    np.savez("closed.npz", V=np.eye(4)[:, :3], F=[[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    for mesh, code in ((name, 0), ("closed.npz", 0), ("it's not there.obj", 2)):
        done = subprocess.run(
            ["sh", ROOT / ".ci" / "demo"],
            env={**os.environ, "PYTHONPATH": str(ROOT), "MESH": mesh},
            capture_output=True,
            text=True,
        )
        assert done.returncode == code, done.stderr
    assert done.stderr == "demo: there is no file it's not there.obj\n"
    stem = name.removesuffix(".npz")
    made = {f"{stem}_disk.obj", f"{stem}_disk.png", "closed_disk.obj", "closed_disk.png"}
    assert set(os.listdir("demo")) == made


# -- what is written and replaced, and what is left alone ------------------------------


# Letters stay letters in a drawing, and what is painted is small.
SMALL = {"svg.fonttype": "none", "figure.dpi": 30, "savefig.dpi": 30}


@pytest.fixture
def scan(tmp_path):
    path = tmp_path / "scan.obj"
    igl.writeOBJ(str(path), V, F)
    return path


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
    assert len(read_mesh("o.obj")[0]) == len(V)
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
    igl.writeOBJ(str(folder / "b" / "scan.obj"), *meshes.grid(7, 7))
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


@needs_full
def test_what_cannot_be_written_is_known_before_anything_is_read(scan):
    scan.write_text("no surface")
    result = invoke("map", scan, "/proc/out.obj")
    assert result.exit_code == 1
    assert result.stderr.startswith("Not written: /proc/out.obj: ")


def test_a_last_line_that_is_left_open_is_ended_first(scan):
    scan.write_bytes(scan.read_bytes().rstrip())
    out = scan.with_name("o.obj")
    assert invoke("map", scan, out).exit_code == 0
    assert len(igl.read_triangle_mesh(str(out))[1]) == len(F)


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
    igl.writeOBJ(str(scan), np.vstack([V, V + 30]), np.vstack([F, F + len(V)]))
    try:
        scan = scan.rename(scan.with_name(os.fsdecode(b"Stra\xdfe.obj")))  # Latin-1
        name = "Stra\\xdfe.obj"
    except OSError:  # a file system that takes UTF-8 only
        name = scan.name
    picture, page = scan.with_name("p.svg"), scan.with_name("v.html")
    options = ("--cut", "--picture", picture, "--view", page)
    with matplotlib.rc_context(SMALL):
        result = invoke("map", scan, scan.with_name("o.obj"), *options)
    assert (result.exit_code, result.stderr) == (0, "")
    for text in (picture.read_text(), page.read_text().replace("\\\\", "\\")):
        assert name in text
        assert f"{2 * len(V)} vertices" in text
        assert "2 charts" in text
