"""cdcp-igl, mostly as a process of its own."""

import json
import os
import pty
import signal
import subprocess
import sys
import time

import meshes
import numpy as np
import pytest

import cdcp_igl
from cdcp_igl import datasets
from cdcp_igl.io import read_mesh

V, F = meshes.grid()
COMMAND = [sys.executable, "-m", "cdcp_igl"]


def run(*arguments, **options):
    return subprocess.run(
        [*COMMAND, *map(str, arguments)], capture_output=True, text=True, timeout=120, **options
    )


def save(path, V=V, F=F):
    np.savez(path, V=V, F=F)
    return path


@pytest.fixture
def mesh(tmp_path):
    return save(tmp_path / "a mesh, größer.npz")


def test_map_writes_everything_and_is_quiet_in_a_pipe(tmp_path, mesh):
    done = run(
        *("map", mesh, tmp_path / "map.obj"),
        *("--report", tmp_path / "map.json", "--picture", tmp_path / "map.png"),
    )
    assert done.returncode == 0
    assert done.stderr == ""
    assert "valid" in done.stdout
    assert "\x1b" not in done.stdout
    report = json.loads((tmp_path / "map.json").read_text())
    assert report["valid"]
    assert report["vertices"] == len(V)
    assert (tmp_path / "map.png").read_bytes().startswith(b"\x89PNG")
    np.testing.assert_array_equal(read_mesh(tmp_path / "map.obj")[0], V)
    assert sorted(os.listdir(tmp_path)) == sorted([mesh.name, "map.obj", "map.json", "map.png"])


def test_output_is_the_librarys_map(tmp_path, mesh):
    assert run("map", mesh, tmp_path / "map.npz", "--mobius", "area").returncode == 0
    with np.load(tmp_path / "map.npz") as data:
        np.testing.assert_array_equal(data["uv"], cdcp_igl.cdcp(V, F, mobius="area"))


@pytest.mark.parametrize(
    ("options", "shown"),
    [
        (["--center", "centroid"], "centroid"),
        (["--center", "7"], "face 7"),
        (["--mobius", "none"], "none"),
        (["--preset", "paper"], "nelder-mead"),
    ],
)
def test_options_reach_the_algorithm(tmp_path, mesh, options, shown):
    done = run("map", mesh, tmp_path / "map.obj", *options)
    assert done.returncode == 0
    assert shown in done.stdout


def test_the_input_may_be_replaced(mesh):
    assert run("map", mesh, mesh).returncode == 0
    with np.load(mesh) as data:
        assert set(data) == {"V", "F", "uv"}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["map", "missing.obj", "map.obj"], "missing.obj"),
        (["map", "mesh.npz", "map.stl"], "must end in"),
        (["map", "mesh.npz", "nowhere/map.obj"], "no folder"),
        (["map", "mesh.npz", "map.obj", "--report", "map.txt"], "must end in .json"),
        (["map", "mesh.npz", "map.obj", "--center", "middle"], "torsion"),
        (["map", "mesh.npz", "map.obj", "--center", "70"], "70 faces"),
        (["map", "mesh.npz", "map.obj", "--preset", "paper", "--center", "heat"], "itself"),
        (["check", "missing.obj"], "missing.obj"),
    ],
)
def test_bad_usage_is_exit_2_without_traceback(tmp_path, arguments, message):
    save(tmp_path / "mesh.npz")
    done = run(*arguments, cwd=tmp_path, env={**os.environ, "COLUMNS": "200"})
    assert done.returncode == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr
    assert os.listdir(tmp_path) == ["mesh.npz"]


def test_a_mesh_that_is_no_disk_is_exit_2_and_named(tmp_path):
    hole = save(tmp_path / "hole.npz", F=np.delete(F, 18, axis=0))
    for arguments in (["check", hole], ["map", hole, tmp_path / "map.obj"]):
        done = run(*arguments)
        assert done.returncode == 2
        text = done.stdout + done.stderr
        assert "several boundary loops" in text
        assert "Fill the holes" in text
        assert str(F[18].min()) in text
        assert "Traceback" not in text
    assert os.listdir(tmp_path) == ["hole.npz"]


def test_check_of_a_disk(mesh):
    done = run("check", mesh)
    assert (done.returncode, done.stderr) == (0, "")
    assert "A triangulated disk." in done.stdout


def test_no_valid_map_is_exit_3_and_leaves_the_old_output(tmp_path):
    x, y = np.meshgrid(np.arange(241) / 4, np.arange(5) / 4)
    corner = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (
        corner[i : i + 4, j : j + 240].ravel() for i, j in ((0, 0), (0, 1), (1, 1), (1, 0))
    )
    corridor = save(
        tmp_path / "corridor.npz",
        np.column_stack([x.ravel(), y.ravel()]),
        np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])]),
    )
    (tmp_path / "map.obj").write_text("old")
    done = run("map", corridor, tmp_path / "map.obj", "--report", tmp_path / "map.json")
    assert done.returncode == 3
    assert "Crowding" in done.stderr
    assert "Traceback" not in done.stderr
    assert (tmp_path / "map.obj").read_text() == "old"
    assert not (tmp_path / "map.json").exists()


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
@pytest.mark.parametrize("delay", [0.3, 0.9, 1.3])
def test_killed_at_any_moment_there_is_the_old_output_or_the_new(tmp_path, number, delay):
    V, F, _ = datasets.paraboloid(120)
    mesh = save(tmp_path / "mesh.npz", V, F)
    output = tmp_path / "map.obj"
    output.write_text("old")
    process = subprocess.Popen(
        [*COMMAND, "map", mesh, output], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    time.sleep(delay)
    process.send_signal(number)
    process.wait(timeout=60)
    text = output.read_text()
    if text != "old":
        assert len(text.splitlines()) == 2 * len(V) + len(F)
        np.testing.assert_array_equal(read_mesh(output)[1], F)
    if number != signal.SIGKILL:
        assert sorted(os.listdir(tmp_path)) == ["map.obj", "mesh.npz"]


def test_progress_on_a_terminal_only_for_long_work(tmp_path, mesh):
    def on_a_terminal(source):
        controller, terminal = pty.openpty()
        process = subprocess.Popen(
            [*COMMAND, "map", source, tmp_path / "map.npz"],
            stdout=subprocess.DEVNULL,
            stderr=terminal,
            env={**os.environ, "TERM": "xterm-256color", "COLUMNS": "100"},
        )
        os.close(terminal)
        seen = b""
        while True:
            try:
                chunk = os.read(controller, 4096)
            except OSError:  # how Linux reports the end
                break
            if not chunk:
                break
            seen += chunk
        os.close(controller)
        assert process.wait(timeout=60) == 0
        return seen.decode()

    assert on_a_terminal(mesh) == ""
    V, F = datasets.load("jacksboro_fault")
    assert "%" in on_a_terminal(save(tmp_path / "terrain.npz", V, F))


def test_version_and_help():
    assert run("--version").stdout == f"cdcp-igl {cdcp_igl.__version__}\n"
    for command in ([], ["map"], ["check"]):
        assert "Exit codes" in run(*command, "-h").stdout or not command


def test_missing_extras_are_named(tmp_path, mesh):
    def without(package, *arguments):
        code = (
            f"import sys; sys.modules[{package!r}] = None\n"
            f"sys.argv = ['cdcp-igl', *{list(map(str, arguments))!r}]\n"
            "from cdcp_igl.cli import main; main()"
        )
        return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)

    done = without("typer", "check", mesh)
    assert done.returncode == 1
    assert "pip install 'cdcp_igl[cli]'" in done.stderr
    done = without("matplotlib", "map", mesh, tmp_path / "m.obj", "--picture", tmp_path / "m.png")
    assert done.returncode == 1
    assert "pip install 'cdcp_igl[plot]'" in done.stderr
    assert "Traceback" not in done.stderr
    assert os.listdir(tmp_path) == [mesh.name]


def test_import_is_light():
    code = (
        "import sys, cdcp_igl\n"
        "heavy = {'typer', 'rich', 'matplotlib', 'pooch', 'scipy.io', 'scipy.optimize'}\n"
        "sys.exit(str(heavy & set(sys.modules)) if heavy & set(sys.modules) else 0)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
