"""The program as the system sees it: its streams, its signals, what it imports."""

import os
import re
import shutil
import signal
import subprocess
import sys
from io import BytesIO, TextIOWrapper
from pathlib import Path

import matplotlib
import meshes
import numpy as np
import pytest
from commands import ROOT, start

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
@pytest.mark.parametrize("command", [("check", "in.npz"), ("--help",)])
def test_a_full_stdout_is_said_in_a_line(main, monkeypatch, command):
    with open("/dev/full", "w") as full:
        monkeypatch.setattr(sys, "stdout", full)
        assert main(*command) == FULL


@needs_full
@pytest.mark.parametrize("broken", ["full", "closed"])
def test_compare_writes_its_files_where_stdout_takes_no_more(main, monkeypatch, broken):
    shutil.copy("in.npz", "other.npz")
    if broken == "full":
        stdout = os.open("/dev/full", os.O_WRONLY)
    else:
        reader, stdout = os.pipe()
        os.close(reader)
    with open(stdout, "w") as stream:
        monkeypatch.setattr(sys, "stdout", stream)
        code = main(*COMPARE, "other.npz", "--json", "r.json")
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
    assert f"needs the extra: pip install 'cdcp_igl[{extra}]'" in said
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
