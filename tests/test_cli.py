import json
import os
import pty
import signal
import subprocess
import sys
import time
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from typer.testing import CliRunner

import cdcp_igl
from cdcp_igl import MapError, MeshError, SolverError, __version__, io, one_file
from cdcp_igl.command_line import arguments, comparing
from cdcp_igl.command_line.program import app
from cdcp_igl.errors import Defect
from cdcp_igl.io import read_mesh

ROOT = Path(__file__).parents[1]
COMMAND = [sys.executable, "-m", "cdcp_igl"]


@pytest.fixture
def cap(tmp_path):
    """A spherical cap in a file whose name has a space and an umlaut."""
    path = tmp_path / "Kugel-Käppchen 1.npz"
    np.savez(path, **dict(zip("VF", spherical_cap(12), strict=True)))
    return path


def spherical_cap(n):
    x, y = (c.ravel() for c in np.meshgrid(np.linspace(-1, 1, n), np.linspace(-1, 1, n)))
    V = np.column_stack([x, y, np.sqrt(3 - x**2 - y**2)])
    a = np.arange(n * n).reshape(n, n)[:-1, :-1].ravel()
    F = np.vstack([np.column_stack([a, a + 1, a + n + 1]), np.column_stack([a, a + n + 1, a + n])])
    return V, F


def invoke(*arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments])


def run(*arguments, **options):
    return subprocess.run(
        [*COMMAND, *map(str, arguments)],
        capture_output=True,
        text=True,
        **{"env": {**os.environ, "PYTHONPATH": str(ROOT)}, **options},
    )


# -- map -------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", ["obj", "ply", "npz"])
def test_map(cap, suffix):
    out = cap.with_suffix(f".out.{suffix}")
    result = invoke("map", cap, out)
    assert result.exit_code == 0
    assert "valid" in result.stdout
    assert result.stderr == ""
    V, F = spherical_cap(12)
    np.testing.assert_array_equal(read_mesh(out)[0], V)
    np.testing.assert_array_equal(read_mesh(out)[1], F)


def test_npz_holds_the_map(cap):
    out = cap.with_name("out.npz")
    assert invoke("map", cap, out).exit_code == 0
    assert abs(np.linalg.norm(np.load(out)["uv"], axis=1).max() - 1) < 1e-12


@pytest.mark.parametrize(("options", "lowest"), [((), 0), (("--disk",), -1)])
def test_texture_coordinates(cap, options, lowest):
    out = cap.with_name("out.obj")
    assert invoke("map", cap, out, *options).exit_code == 0
    lines = (line.split() for line in out.read_text().splitlines())
    texture = np.array([words[1:] for words in lines if words[0] == "vt"], float)
    np.testing.assert_allclose(texture.min(axis=0), lowest, atol=0.05)
    np.testing.assert_allclose(texture.max(axis=0), 1, atol=0.05)


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ((), {"center": "torsion", "mobius": "angle"}),
        (("--center", "heat", "--mobius", "area"), {"center": "heat", "mobius": "area"}),
        (("--center", "0", "--mobius", "none"), {"center": "given", "mobius": "none"}),
        (("--preset", "paper"), {"center": "heat", "mobius": "nelder-mead"}),
    ],
)
def test_report_and_options(cap, options, expected):
    report = cap.with_name("report.json")
    assert invoke("map", cap, cap.with_name("o.ply"), "--report", report, *options).exit_code == 0
    read = json.loads(report.read_text())
    assert read["valid"]
    assert {name: read[name]["method"] for name in expected} == expected
    if expected["mobius"] != "none":  # what is far from conformal is refined unasked
        assert read["refinement"] is None


def test_refinement(cap):
    report = cap.with_name("report.json")
    assert (
        invoke("map", cap, cap.with_name("o.ply"), "--report", report, "--refine", 2).exit_code == 0
    )
    assert json.loads(report.read_text())["refinement"]["steps"] == 2


def test_alignment_and_norm_of_the_refinement(cap):
    for option, value in (("align", 5), ("align", [0, 1, 0]), ("refine_norm", 1.0)):
        out = cap.with_name(f"{option}{value}.npz")
        text = ",".join(map(str, value)) if isinstance(value, list) else value
        option_given = f"--{option.replace('_', '-')}"
        assert invoke("map", cap, out, "--refine", 1, option_given, text).exit_code == 0
        expected = cdcp_igl.disk_map(*spherical_cap(12), refine=1, **{option: value}).uv
        np.testing.assert_array_equal(np.load(out)["uv"], expected)


@pytest.mark.parametrize(
    ("option", "row", "message"),
    [
        ("--align", 70, "align=70 is not a boundary vertex\n"),
        ("--center", 99999, "center is face 99999; the mesh has faces 0..241\n"),
    ],
)
def test_an_option_that_does_not_fit_the_mesh(cap, option, row, message):
    result = invoke("map", cap, cap.with_name("o.obj"), option, row)
    assert (result.exit_code, result.stderr) == (2, message)


def test_quiet(cap):
    result = invoke("map", cap, cap.with_name("o.obj"), "--quiet")
    assert (result.exit_code, result.output) == (0, "")


def test_picture(cap):
    picture = cap.with_name("p.png")
    assert invoke("map", cap, cap.with_name("o.ply"), "--picture", picture).exit_code == 0
    assert picture.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    "arguments",
    [
        ("o.stl",),
        ("o",),
        ("missing/o.obj",),
        ("o.obj", "--report", "r.txt"),
        ("o.obj", "--report", "missing/r.json"),
        ("o.obj", "--picture", "p.jpg"),
        ("o.obj", "--center", "middle"),
        ("o.obj", "--center", "0", "--preset", "paper"),
        ("o.obj", "--mobius", "both"),
        ("o.obj", "--align", "up"),
        ("o.obj", "--align", "1,2"),
        ("o.obj", "--refine-norm", "3"),
        ("folder.obj",),
    ],
)
def test_bad_arguments(cap, monkeypatch, arguments):
    monkeypatch.chdir(cap.parent)
    Path("folder.obj").mkdir()
    monkeypatch.setattr(one_file, "disk_map", lambda *args, **options: pytest.fail("computed"))
    result = invoke("map", cap, *arguments)
    assert result.exit_code == 2
    assert result.stderr
    assert sorted(os.listdir()) == sorted([cap.name, "folder.obj"])


def test_bad_mesh(cap):
    V, F = spherical_cap(12)
    np.savez(cap, V=V, F=np.vstack([F, F[7]]))
    out = cap.with_name("out.obj")
    out.write_text("old")
    result = run("map", cap, out, "--force")
    assert result.returncode == 2
    assert "duplicate face: 1 face repeats the corners of another (faces 242)" in result.stderr
    assert "Drop these faces" in result.stderr
    assert "Traceback" not in result.stderr
    assert result.stdout == ""
    assert out.read_text() == "old"


@pytest.mark.parametrize("name", ["missing.obj", "empty.off", "garbage.ply", "cut.obj", "a.xyz"])
@pytest.mark.parametrize("command", ["map", "check"])
def test_bad_files(tmp_path, name, command):
    path = tmp_path / name
    if "missing" not in name:
        contents = {"garbage.ply": bytes(range(256)), "cut.obj": b"v 0 0 0\nv 1 0 0\nf 1"}
        path.write_bytes(contents.get(name, b""))
    result = invoke(command, path, *([tmp_path / "o.obj"] if command == "map" else []))
    assert result.exit_code == 2
    assert result.stderr
    assert result.stdout == ""


@pytest.mark.parametrize("error", [MapError("7 flipped faces"), SolverError("not definite")])
def test_no_valid_map(cap, monkeypatch, error):
    def fail(*args, **options):
        raise error

    monkeypatch.setattr(one_file, "disk_map", fail)
    out = cap.with_name("out.obj")
    out.write_text("old")
    result = invoke("map", cap, out, "--force", "--report", cap.with_name("r.json"))
    assert result.exit_code == 3
    assert result.stderr == f"{error}\n"
    assert out.read_text() == "old"
    assert not cap.with_name("r.json").exists()


def test_unexpected_errors_are_not_swallowed(cap, monkeypatch):
    def fail(*args, **options):
        raise ZeroDivisionError

    monkeypatch.setattr(one_file, "disk_map", fail)
    assert isinstance(invoke("map", cap, cap.with_name("o.obj")).exception, ZeroDivisionError)


def test_unwritable_output(cap, monkeypatch):
    def fail(*args, **options):
        raise OSError(28, "No space left on device", "o.obj")

    monkeypatch.setattr(one_file, "write_map", fail)
    result = invoke("map", cap, cap.with_name("o.obj"))
    assert result.exit_code == 1
    assert result.stderr == "Not written: o.obj: No space left on device\n"


# -- check, help, version --------------------------------------------------------------


def test_check(cap):
    result = invoke("check", cap)
    assert result.exit_code == 0
    assert "A triangulated disk." in result.stdout


def test_check_reports_every_defect(cap):
    V, F = spherical_cap(12)
    V = np.vstack([V, [[9, 9, 9]]])
    np.savez(cap, V=V, F=F[1:] + 1)
    result = invoke("check", cap)
    assert result.exit_code == 2
    assert "unreferenced vertex" in result.stdout
    np.savez(cap, V=V, F=F[1:, [0, 0, 1]])
    assert "repeated corner" in invoke("check", cap).stdout


def test_several_files_are_checked(cap):
    V, F = spherical_cap(12)
    torn, missing = cap.with_name("torn.npz"), cap.with_name("missing.obj")
    np.savez(torn, V=V, F=F[:-50])
    np.savez(cap.with_name("closed.npz"), V=V[:4], F=[[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    result = invoke("check", torn, missing, cap)
    assert result.exit_code == 2
    assert f"{torn}: 144 vertices" in result.stdout
    assert f"{cap}: 144 vertices" in result.stdout
    assert result.stderr == f"{missing}: No such file or directory\n"
    assert invoke("check", cap, cap).exit_code == 0
    result = invoke("check", cap.with_name("closed.npz"))
    assert "genus 0, closed" in result.stdout
    assert "map --cut" in result.stdout


def test_checks_as_json(cap):
    V, F = spherical_cap(12)
    torn, text = cap.with_name("torn.npz"), cap.with_name("text.off")
    np.savez(torn, V=np.vstack([V, [[9, 9, 9]]]), F=F)
    text.write_text("no surface")
    result = invoke("check", "--json", cap, torn, text)
    assert result.exit_code == 2
    rows = json.loads(result.stdout)
    assert [(row["file"], row["disk"]) for row in rows] == [
        (str(cap), True),
        (str(torn), False),
        (str(text), False),
    ]
    assert (rows[0]["kind"], rows[0]["genus"], rows[0]["defects"]) == ("disk", 0, [])
    assert rows[1]["defects"][0]["indices"] == [144]
    assert "clean" in rows[1]["next_step"]
    assert rows[2]["defects"][0]["name"] == "unreadable file"


def test_indices_from_one_are_announced(cap):
    V, F = spherical_cap(12)
    np.savez(cap, V=V, F=F + 1)
    for command in (("check", cap), ("map", cap, cap.with_name("o.obj"))):
        result = invoke(*command)
        assert result.exit_code == 0
        assert "from 1" in result.stdout


def test_a_missing_file_is_an_object_as_well(cap):
    missing = cap.with_name("missing.obj")
    result = invoke("check", "--json", missing, cap)
    assert (result.exit_code, result.stderr) == (2, "")
    rows = json.loads(result.stdout)
    assert [(row["file"], row["disk"]) for row in rows] == [(str(missing), False), (str(cap), True)]
    assert rows[0]["defects"][0]["what"] == f"{missing}: No such file or directory"


def test_every_defect_is_named(cap, monkeypatch):
    defects = Defect("one", "First", "Mend."), Defect("two", "Second", "Mend.")

    def fail(*args, **options):
        raise MeshError(*defects)

    monkeypatch.setattr(one_file, "disk_map", fail)
    assert invoke("map", cap, cap.with_name("o.obj")).stderr.splitlines() == [
        "one: First. Mend.",
        "two: Second. Mend.",
    ]


@pytest.mark.parametrize("option", ["-h", "--help"])
@pytest.mark.parametrize("command", [(), ("map",), ("check",)])
def test_help(command, option):
    result = invoke(*command, option)
    assert result.exit_code == 0
    if command:
        assert "Exit codes" in result.stdout


def test_version():
    assert invoke("--version").stdout == f"cdcp-igl {__version__}\n"


def test_help_names_what_the_library_has():
    assert arguments.READABLE == io.READABLE
    assert arguments.WRITABLE == io.WRITABLE
    assert tuple(cdcp_igl.reference.METHODS) == comparing.METHODS


@pytest.mark.parametrize("command", [(), ("map",), ("check",), ("compare",)])
def test_help_waits_for_no_heavy_import(command):
    heavy = {"cdcp_igl.algorithm", "numpy", "scipy", "matplotlib", "igl"}
    code = f"""
import sys
from cdcp_igl.command_line import entry
sys.argv[1:] = {[*command, "--help"]}
try:
    entry.main()
finally:
    print({heavy} & sys.modules.keys())
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.endswith("set()\n")


@pytest.mark.skipif(sys.platform == "win32", reason="needs sh")
def test_the_demo_takes_any_file_name_and_says_which_is_missing(cap):
    folder = cap.parent
    program = folder / ".venv" / "bin" / "cdcp-igl"
    program.parent.mkdir(parents=True)
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m cdcp_igl "$@"\n')
    program.chmod(0o755)
    name = 'Käppchen\'s "first" $HOME.npz'
    cap.rename(folder / name)
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    for mesh, code in ((name, 0), ("it's not there.obj", 2)):
        done = subprocess.run(
            ["sh", ROOT / ".ci" / "demo"],
            cwd=folder,
            env=environment | {"MESH": mesh},
            capture_output=True,
            text=True,
        )
        assert done.returncode == code, done.stderr
    assert done.stderr == "demo: there is no file it's not there.obj\n"
    made = sorted(path.name for path in (folder / "demo").iterdir())
    stem = name.removesuffix(".npz")
    assert made == [f"{stem}_disk.obj", f"{stem}_disk.png"]


def test_completion(cap):
    environment = {**os.environ, "_CDCP_IGL_COMPLETE": "complete_bash"}
    environment |= {"COMP_WORDS": "cdcp-igl map --refine-", "COMP_CWORD": "2"}
    code = "from cdcp_igl.command_line.entry import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=environment
    )
    assert done.stdout.split() == ["--refine-norm", "--refine-seconds"]


# -- as a process ----------------------------------------------------------------------


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.parametrize("unbuffered", ["1", ""])
@pytest.mark.parametrize("command", [("map", "in.npz", "o.obj"), ("check", "in.npz"), ("--help",)])
def test_a_full_stdout_is_said_in_a_line(cap, command, unbuffered):
    cap.rename(cap.with_name("in.npz"))
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": unbuffered}
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [*COMMAND, *command],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            cwd=cap.parent,
            env=environment,
        )
    assert (done.returncode, done.stderr) == (1, "Not printed: No space left on device\n")
    assert cap.with_name("o.obj").exists() == (command[0] == "map")


@pytest.mark.skipif(sys.platform == "win32", reason="needs sh")
@pytest.mark.parametrize("closed", [">&-", ">&- 2>&-"])
def test_a_closed_stdout(cap, closed):
    out = cap.with_name("o.obj")
    done = subprocess.run(
        ["sh", "-c", f'"$@" {closed}', "sh", *COMMAND, "map", cap, out],
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert read_mesh(out)[0].shape == (144, 3)


@pytest.mark.parametrize(
    "terminal",
    [
        {"PYTHONIOENCODING": "cp932"},
        {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
    ],
    ids=["cp932", "C"],
)
@pytest.mark.parametrize("command", ["map", "compare"])
def test_characters_that_the_terminal_lacks(cap, command, terminal):
    arguments = {
        "map": [cap, cap.with_name("o.obj")],
        "compare": [cap, "--methods", "lscm", "--json", cap.with_name("o.json")],
    }[command]
    done = subprocess.run(
        [*COMMAND, command, *arguments], capture_output=True, env={**os.environ, **terminal}
    )
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"bius  " in done.stdout or b"lscm *" in done.stdout
    assert arguments[-1].exists()


@pytest.fixture
def no_text(cap, monkeypatch):
    """The cap in a file whose name is no UTF-8, in the working directory."""
    monkeypatch.chdir(cap.parent)
    monkeypatch.setattr("cdcp_igl.plot.pictures.PIXELS", 60)
    try:
        return cap.rename(os.fsdecode(b"Stra\xdfe.npz"))  # Latin-1
    except OSError:  # a file system that takes UTF-8 only
        pytest.skip("no such names here")


@pytest.mark.parametrize(
    ("command", "option", "file"),
    [
        ("map", "--view", "v.html"),
        ("map", "--picture", "p.svg"),
        ("compare", "--json", "r.json"),
        ("compare", "--csv", "r.csv"),
        ("compare", "--picture", "p.svg"),
    ],
)
def test_names_that_are_no_text_in_files(no_text, command, option, file):
    more = ("o.obj",) if command == "map" else ("--methods", "lscm")
    with matplotlib.rc_context({"svg.fonttype": "none"}):  # text stays text
        result = invoke(command, no_text, *more, option, file)
    assert (result.exit_code, result.stderr) == (0, "")
    written = Path(file).read_text().replace("\\\\", "\\")  # which JSON doubles
    assert "Stra\\xdfe.npz" in written


@pytest.mark.parametrize("command", [("check",), ("compare", "--methods", "lscm")])
def test_names_that_are_no_text_on_the_screen(no_text, command):
    missing = no_text.with_name(f"no {no_text.name}")
    result = invoke(*command, no_text, missing)
    assert "Stra\\xdfe.npz: 144 vertices" in result.stdout
    assert result.stderr == "no Stra\\xdfe.npz: No such file or directory\n"


def test_characters_that_the_font_lacks(cap):
    name = "日本語 हिंदी.npz"  # there is a warning for a character, and one for a script
    cap.rename(cap.with_name(name))
    done = run("compare", name, "--methods", "lscm", "--picture", "p.png", cwd=cap.parent)
    assert (done.returncode, done.stderr) == (0, "")


def test_quiet_in_a_pipe(cap):
    result = run("map", cap, cap.with_name("o.obj"), env={**os.environ, "FORCE_COLOR": "1"})
    assert result.returncode == 0
    assert result.stderr == ""
    assert result.stdout.replace("\n", "").isprintable()  # no escape sequences


def test_progress_and_panel_on_a_terminal(tmp_path):
    path = tmp_path / "cap.npz"
    V, F = spherical_cap(12)
    np.savez(path, V=V, F=F)
    code = """
import time
from cdcp_igl import one_file
from cdcp_igl.command_line import entry as cli
real = one_file.disk_map
def slow(V, F, progress):
    progress("factor", 0.5)
    time.sleep(1.6)
    return real(V, F, progress=progress)
one_file.disk_map = slow
cli.main()
"""
    try:
        lead, follow = pty.openpty()
    except OSError:  # a bare system without /dev/pts
        pytest.skip("no pseudo-terminals here")
    with subprocess.Popen(
        [sys.executable, "-c", code, "map", path, tmp_path / "o.obj"],
        stdout=follow,
        stderr=follow,
        env={**os.environ, "TERM": "xterm", "COLUMNS": "100"},
    ) as process:
        os.close(follow)
        shown = b""
        while chunk := _read(lead):
            shown += chunk
    os.close(lead)
    assert process.returncode == 0
    assert b"factor" in shown
    assert "╭".encode() in shown


def _read(terminal):
    try:
        return os.read(terminal, 4096)
    except OSError:  # how Linux reports that the other end was closed
        return b""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("module", ["typer", "numpy", "scipy.sparse", "cdcp_igl.algorithm"])
def test_stopped_while_a_module_is_imported(cap, module, number):
    code = f"""
import os, signal, sys
class Finder:
    def find_spec(self, name, path, target=None):
        if name == {module!r}:
            os.kill(os.getpid(), {int(number)})
sys.meta_path.insert(0, Finder())
from cdcp_igl.command_line.entry import main
main()
"""
    done = subprocess.run(
        [sys.executable, "-c", code, "map", cap, cap.with_name("o.obj")],
        capture_output=True,
        text=True,
    )
    said = "Interrupted\n" if number == signal.SIGINT else ""
    assert (done.returncode, done.stdout, done.stderr) == (128 + number, "", said)
    assert os.listdir(cap.parent) == [cap.name]


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_a_killed_process_leaves_the_old_output(cap, number):
    out = cap.with_name("out.obj")
    out.write_text("old")
    code = """
import time
from cdcp_igl.command_line import entry as cli
from cdcp_igl.io import writing as io
def stall(path, *args):
    path.write_text("half")
    time.sleep(60)
io.write_obj = stall
cli.main()
"""
    with subprocess.Popen([sys.executable, "-c", code, "map", cap, out, "--force"]) as process:
        deadline = time.monotonic() + 20
        while not any(path.stat().st_size for path in cap.parent.glob(".*")) and (
            time.monotonic() < deadline
        ):
            time.sleep(0.02)
        process.send_signal(number)
    assert process.returncode == (-9 if number == signal.SIGKILL else 128 + number)
    assert out.read_text() == "old"
    if number != signal.SIGKILL:
        assert sorted(os.listdir(cap.parent)) == sorted([cap.name, out.name])


@pytest.mark.parametrize(
    ("module", "extra"), [("typer", "cli"), ("rich", "cli"), ("matplotlib", "plot")]
)
def test_missing_extras_are_named(cap, module, extra):
    program = "from cdcp_igl.command_line.entry import main; main()"
    code = f"import sys; sys.modules[{module!r}] = None; {program}"
    arguments = ["map", cap, cap.with_name("o.obj"), "--picture", cap.with_name("p.png")]
    result = subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True
    )
    assert result.returncode == 1
    assert f"needs the extra: pip install 'cdcp_igl[{extra}]'" in result.stderr
    assert "Traceback" not in result.stderr
    assert os.listdir(cap.parent) == [cap.name]


def test_importing_the_package_imports_no_extra():
    extras = {"typer", "rich", "matplotlib", "scipy.io"}
    code = f"import sys, cdcp_igl, cdcp_igl.io; print({extras} & sys.modules.keys())"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert result.stdout == "set()\n"
