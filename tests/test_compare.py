"""Cases in processes of their own, and the table of them."""

import csv
import json
import os
import re
import shutil
import subprocess
import sys

import meshes
import numpy as np
import pytest

import cdcp_igl
from cdcp_igl.command_line import tables
from cdcp_igl.command_line.cases import print_cases
from cdcp_igl.reference import METHODS
from cdcp_igl.reference.case import Case, run_case

V, F = meshes.grid(8, 9)
MUST = "failed: must return (n, 2) numbers, and returned "


def compare(*arguments, stdout=subprocess.PIPE, **options):
    return subprocess.run(
        [sys.executable, "-m", "cdcp_igl", "compare", *map(str, arguments)],
        stdout=stdout,
        stderr=subprocess.PIPE,
        text=True,
        timeout=300,
        **options,
    )


@pytest.fixture
def mesh(tmp_path):
    path = tmp_path / "grid.npz"
    np.savez(path, V=V, F=F)
    return path


def test_a_case_is_what_the_library_says():
    case, uv = run_case("cdcp", V, F, time_limit=60)
    result = cdcp_igl.disk_map(V, F)
    np.testing.assert_array_equal(uv, result.uv)
    assert case.outcome == "ok"
    assert (case.mean, case.sd, case.max) == pytest.approx(
        (result.distortion.mean, result.distortion.sd, result.distortion.max)
    )
    assert case.flips == 0
    assert case.boundary_error < 1e-12
    assert 0 < case.area < 5
    assert case.seconds > 0
    assert 20 < case.memory < 2000  # MiB


def test_time_limit():
    case, uv = run_case("cdcp", V, F, time_limit=0.01)
    assert uv is None
    assert case.outcome == "no result within 0.01 s"
    assert np.isnan(case.mean)


@pytest.mark.parametrize(
    ("method", "outcome"),
    [
        ("kills itself", "crashed: SIGSEGV"),
        ("raises", "failed: KeyError: 'what'"),
        ("raises two lines", "failed: RuntimeError: boom | pipe"),
        ("nothing", f"{MUST}NoneType"),
        ("list", f"{MUST}list"),
        ("complex", f"{MUST}complex128 of shape ({len(V)},)"),
        ("too short", f"{MUST}float64 of shape ({len(V) - 1}, 2)"),
        ("not finite", "not valid: not finite"),
        ("flipped", f"not valid: {len(F)} flipped faces"),
        ("free, not finite", "not valid: not finite"),
    ],
)
def test_a_failure_is_an_outcome(method, outcome):
    case, uv = run_case(method, V, F, time_limit=60, table="failing_methods:METHODS")
    assert case.outcome.startswith(outcome)
    assert uv is None
    assert np.isnan([case.mean, case.sd, case.max, case.area, case.flips, case.seconds]).all()


def test_a_method_that_changes_the_surface_is_judged_by_the_one_it_was_given():
    changed, uv = run_case(
        "flattens the surface", V, F, time_limit=60, table="failing_methods:METHODS"
    )
    expected = cdcp_igl.angle_distortion(V, F, uv).mean()
    assert changed.mean == pytest.approx(expected)
    assert expected > 1


def test_memory_limit():
    limits = {"time_limit": 60, "memory_limit": 400}
    case, uv = run_case("hog", V, F, **limits, table="failing_methods:METHODS")
    assert (case.outcome, uv) == ("more than 400 MiB of memory", None)
    case, _ = run_case("cdcp", V, F, **limits)
    assert case.outcome == "ok"


def test_memory_is_not_that_of_the_caller():
    hoard = np.ones(1 << 26)  # 512 MiB
    case, _ = run_case("lscm", V, F, time_limit=60)
    assert 20 < case.memory < hoard.nbytes / 2**20


def test_phases_of_a_disk_map_and_of_a_clock():
    case, uv = run_case("phases", V, F, time_limit=60, table="failing_methods:METHODS")
    assert case.details["valid"]
    assert uv.shape == (len(V), 2)
    assert 0 < sum(case.details["seconds"].values()) < case.seconds
    case, uv = run_case("clock", V, F, time_limit=60, table="failing_methods:METHODS")
    assert (case.outcome, case.seconds, uv) == ("ok", 42, None)
    assert case.details["seconds"] == {"half": 21}


def test_json_has_no_nan():
    row = Case("lscm", "free", "crashed").as_json()
    assert row["mean"] is None
    assert json.loads(json.dumps(row, allow_nan=False)) == row


def test_every_row_is_there(tmp_path, mesh):
    done = compare(
        *(mesh, "--json", tmp_path / "r.json", "--csv", tmp_path / "r.csv"),
        *("--picture", tmp_path / "p.png"),
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    for method in METHODS:
        assert method in done.stdout
    assert done.stdout.count(" *") == 2  # lscm and spectral
    assert "* no disk: a map with free boundary" in done.stdout
    rows = json.loads((tmp_path / "r.json").read_text())
    assert [row["method"] for row in rows] == list(METHODS)
    assert all(row["outcome"] == "ok" for row in rows)
    with (tmp_path / "r.csv").open(newline="") as file:
        assert [row["method"] for row in csv.DictReader(file)] == list(METHODS)
    assert (tmp_path / "p.png").read_bytes().startswith(b"\x89PNG")


def test_a_method_that_fails_has_a_row_and_a_line_that_says_why(tmp_path, real_mesh):
    positions, faces = real_mesh("face_1180_ears")
    np.savez(tmp_path / "ears.npz", V=positions, F=faces)
    done = compare(tmp_path / "ears.npz", "--methods", "cdcp,fdcp")
    assert done.returncode == 0
    assert "MapError" in done.stdout
    assert done.stdout.index("cdcp") < done.stdout.index("fdcp") < done.stdout.index("MapError")


@pytest.mark.parametrize("width", [40, 80, 120])
def test_the_table_is_whole_on_a_terminal_of_any_width(monkeypatch, capsys, width):
    numbers = [12.345, 23.456, 178.9, 5.678, 1234, 1e-16, 123.45, 12345]
    monkeypatch.setattr(tables, "PIPE", width)
    print_cases("[red]", [Case("double_cover", "disk", "ok", *numbers), Case("x", "free", "ok")])
    title, headings, _, first, second, _ = capsys.readouterr().out.splitlines()
    assert title.strip() == "[red]"  # no markup
    assert headings.split() == [
        *("method", "mean", "°", "SD", "°", "max", "°", "area", "flips", "boundary", "s", "MiB")
    ]
    row = "double_cover 12.345 23.456 178.9 5.678 1,234 1e-16 123.45 12,345"
    assert first.split() == row.split()
    assert second.startswith("x *")
    assert len(first) <= 80


def test_each_mesh_is_compared_once(mesh):
    done = compare(mesh, mesh, "--methods", "lscm")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.count("lscm") == 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [(["--methods", "cdcp,magic"], "'magic' is not one of"), (["--json", "r.txt"], "must end in")],
)
def test_bad_usage(mesh, arguments, message):
    done = compare(mesh, *arguments)
    assert done.returncode == 2
    assert message in " ".join(done.stderr.split())


def test_a_bad_mesh_is_named_and_the_others_go_on(tmp_path, mesh):
    np.savez(tmp_path / "hole.npz", V=V, F=F[1:-40])
    files = tmp_path / "hole.npz", tmp_path / "missing.obj", mesh
    report = tmp_path / "r.json"
    done = compare(*files, "--methods", "cdcp", "--json", report)
    assert done.returncode == 4
    assert f"{files[0]}: " in done.stderr
    assert f"{files[1]}: No such file" in done.stderr
    assert done.stdout.count("cdcp") == 1
    assert [row["mesh"] for row in json.loads(report.read_text())] == [str(mesh)]


def test_what_is_there_is_kept(tmp_path, mesh):
    (tmp_path / "r.json").write_text("thesis")
    done = compare(mesh, "--methods", "cdcp", "--json", tmp_path / "r.json")
    assert done.returncode == 2
    assert done.stdout == ""
    assert (tmp_path / "r.json").read_text() == "thesis"
    options = ("--methods", "cdcp", "--json", tmp_path / "r.json", "--force")
    assert compare(mesh, *options).returncode == 0


def test_bad_mesh_is_exit_2_before_anything_runs(tmp_path):
    np.savez(tmp_path / "hole.npz", V=V, F=F[1:-40])
    done = compare(tmp_path / "hole.npz")
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert done.stdout == ""


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")
@pytest.mark.parametrize("broken", ["full", "closed"])
def test_files_are_written_where_stdout_takes_no_more(tmp_path, mesh, broken):
    other = shutil.copy(mesh, tmp_path / "other.npz")
    if broken == "full":
        stdout = os.open("/dev/full", os.O_WRONLY)
    else:
        reader, stdout = os.pipe()
        os.close(reader)
    done = compare(
        *(mesh, other, "--methods", "lscm", "--json", tmp_path / "r.json"), stdout=stdout
    )
    os.close(stdout)
    said = "Not printed: No space left on device\n" if broken == "full" else ""
    assert (done.returncode, done.stderr) == (1, said)
    rows = json.loads((tmp_path / "r.json").read_text())
    assert [row["mesh"] for row in rows] == [str(mesh), str(other)]


def test_a_temporary_folder_that_is_full(mesh):
    resource = pytest.importorskip("resource")
    done = compare(
        *(mesh, "--methods", "lscm"),
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000)),
    )
    assert done.returncode == 1
    assert re.fullmatch(r"Not written: .*mesh\.npz: File too large\n", done.stderr)
