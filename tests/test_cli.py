"""What the commands say, and their exit codes."""

import json
import os
import re
import sys
import time
from concurrent.futures import BrokenExecutor
from pathlib import Path

import meshes
import numpy as np
import pytest
import typer
from commands import Terminal, invoke
from typer.testing import CliRunner

import cdcp_igl
from cdcp_igl import MapError, SolverError, __version__, io
from cdcp_igl.command_line import comparing, options, program
from cdcp_igl.command_line.messages import exit_codes
from cdcp_igl.command_line.screen import progress_bar

V, F = meshes.grid()
MAPS = cdcp_igl.disk_map, cdcp_igl.free_map


@pytest.fixture
def cap(tmp_path):
    """A surface in a file whose name has a space and an umlaut."""
    path = tmp_path / "Kugel-Käppchen 1.npz"
    np.savez(path, V=V, F=F)
    return path


# -- map -------------------------------------------------------------------------------


@pytest.mark.parametrize(("options", "lowest"), [((), 0), (("--disk",), -1)])
def test_texture_coordinates(cap, options, lowest):
    out = cap.with_name("out.obj")
    assert invoke("map", cap, out, *options).exit_code == 0
    lines = (line.split() for line in out.read_text().splitlines())
    texture = np.array([words[1:] for words in lines if words[0] == "vt"], float)
    np.testing.assert_allclose(texture.min(axis=0), lowest, atol=0.1)
    np.testing.assert_allclose(texture.max(axis=0), 1, atol=0.1)


@pytest.mark.parametrize(
    ("given", "options"),
    [
        ((), {}),
        (("--center", "heat", "--mobius", "area"), {"center": "heat", "mobius": "area"}),
        (("--center", "0", "--mobius", "none"), {"center": 0, "mobius": None}),
        (("--preset", "paper"), {"preset": "paper"}),
        (("--refine", 0), {"refine": 0}),
        (("--refine", 1, "--align", 5), {"refine": 1, "align": 5}),
        (("--refine", 1, "--align", "0,1,0"), {"refine": 1, "align": [0, 1, 0]}),
        (("--refine", 2, "--refine-norm", 1), {"refine": 2, "refine_norm": 1.0}),
        (("--refine", 9, "--refine-seconds", 0), {"refine": 9, "refine_seconds": 0}),
        (("--free",), {}),
        (("--free", "--refine", 1, "--align", "0,1,0"), {"refine": 1, "align": [0, 1, 0]}),
    ],
)
def test_options_are_those_of_the_library(cap, given, options):
    out, report = cap.with_name("out.npz"), cap.with_name("report.json")
    assert invoke("map", cap, out, "--report", report, *given).exit_code == 0
    expected = MAPS["--free" in given](V, F, **options)
    np.testing.assert_array_equal(np.load(out)["uv"], expected.uv)
    reports = [json.loads(report.read_text()), json.loads(json.dumps(expected.report()))]
    for read in reports:  # measured, and not the same twice
        del read["seconds"]
    assert reports[0] == reports[1]


@pytest.mark.parametrize(
    ("given", "named"),
    [
        ("map IN o.stl", "'o.stl' must end in"),
        ("map IN o", "'o' must end in"),
        ("map IN missing/o.obj", "there is no folder 'missing'"),
        ("map IN folder.obj", "'folder.obj' is a folder"),
        ("map IN o.obj --picture p.jpg", "must end in .png or .svg or .pdf"),
        ("map IN o.obj --center middle", "center must be"),
        ("map IN o.obj --center 0 --preset paper", "sets center and mobius itself"),
        ("map IN o.obj --mobius both", "mobius must be"),
        ("map IN o.obj --preset book", "preset must be"),
        ("map IN o.obj --align up", "align must be"),
        ("map IN o.obj --refine -1", "--refine"),
        ("map IN o.obj --refine-norm 3", "--refine-norm"),
        ("map IN second.obj third.obj", "--out-dir"),
        ("map IN --out-dir maps --cut --disk --center 3", 'must be "torsion"'),
        ("map IN --out-dir maps --report r.json", "are for one surface"),
        ("batch IN maps --shard 3/2", "must be I/N"),
        ("batch IN maps --report page.txt", "must end in .html"),
        ("batch IN maps --jobs 0", "jobs"),
        ("compare IN --csv r.json", "must end in .csv"),
        ("compare IN --methods cdcp,magic", "'magic' is not one of"),
    ],
)
def test_bad_arguments_are_found_before_anything_is_read(tmp_path, monkeypatch, given, named):
    monkeypatch.chdir(tmp_path)
    Path("folder.obj").mkdir()
    result = invoke(*given.replace("IN", "there_is_none.obj").split())
    assert result.exit_code == 2
    assert named in " ".join(result.stderr.split())
    assert "No such file" not in result.stderr
    assert os.listdir() == ["folder.obj"]


def test_every_defect_is_named_with_its_rows_and_a_remedy(cap):
    np.savez(cap, V=np.vstack([V, [[9, 9, 9]]]), F=np.vstack([F, F[7]]))
    out = cap.with_name("out.obj")
    out.write_text("old")
    result = invoke("map", cap, out, "--force")
    assert (result.exit_code, result.stdout) == (2, "")
    assert (
        f"duplicate face: 1 face repeats the corners of another (faces {len(F)})" in result.stderr
    )
    assert "cdcp-igl map --clean" in result.stderr
    assert f"unreferenced vertex: 1 vertex belongs to no face (vertices {len(V)})" in result.stderr
    assert out.read_text() == "old"


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [
        (MapError("7 flipped faces"), 3, "scan.obj: 7 flipped faces\n"),
        (SolverError("not definite"), 3, "scan.obj: not definite\n"),
        (ValueError("align is no direction"), 2, "scan.obj: align is no direction\n"),
        (FileNotFoundError(2, "No such file", "scan.obj"), 2, "scan.obj: No such file\n"),
        (BrokenExecutor("a worker has died"), 1, "scan.obj: a worker has died\n"),
    ],
)
def test_exit_codes_of_errors(capsys, error, code, said):
    with pytest.raises(typer.Exit) as ended, exit_codes(Path("scan.obj")):
        raise error
    assert (ended.value.exit_code, capsys.readouterr()) == (code, ("", said))
    with pytest.raises(ZeroDivisionError), exit_codes():  # what is unexpected is not swallowed
        raise ZeroDivisionError


# -- check -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("surface", "code", "said"),
    [
        ((V, F), 0, "A triangulated disk."),
        ((V, F + 1), 0, "from 1"),
        ((np.vstack([V, [[9, 9, 9]]]), F), 2, "unreferenced vertex"),
        (meshes.NASTY["closed"][1:3], 2, "genus 0, closed"),
    ],
)
def test_check(cap, surface, code, said):
    np.savez(cap, V=surface[0], F=surface[1])
    result = invoke("check", cap)
    assert (result.exit_code, result.stderr) == (code, "")
    assert said in result.stdout


@pytest.mark.parametrize("name", meshes.NASTY)
def test_the_next_step_is_a_command_that_works(tmp_path, name):
    """One step, wherever one command can map the surface."""
    defect, V, F, _ = meshes.NASTY[name]
    if defect in meshes.BAD_ARRAYS:
        return
    surface = tmp_path / "surface.npz"
    np.savez(surface, V=V, F=F)
    out = tmp_path / "out.npz"
    command = invoke("check", surface).stdout.partition("Next: cdcp-igl ")[2].partition(";")[0]
    said = invoke("map", surface, out).stderr.partition("Next: cdcp-igl ")[2]
    assert (command == "") == (defect == "degenerate face")
    for step in {command.replace(" surface_map.obj", f" {out}"), said.strip()} if command else ():
        assert invoke(*step.split(), "--force").exit_code == 0
        assert np.isfinite(np.load(out)["uv"]).all()


def test_checks_as_json(cap):
    torn, text, missing = (cap.with_name(name) for name in ("torn.npz", "text.off", "missing.obj"))
    np.savez(torn, V=np.vstack([V, [[9, 9, 9]]]), F=F)
    text.write_text("no surface")
    files = [cap, torn, text, missing]
    result = invoke("check", "--json", *files)
    assert (result.exit_code, result.stderr) == (2, "")
    rows = json.loads(result.stdout)
    assert [row["file"] for row in rows] == [str(file) for file in files]
    assert [row["disk"] for row in rows] == [True, False, False, False]
    assert (rows[0]["kind"], rows[0]["genus"], rows[0]["defects"]) == ("disk", 0, [])
    assert rows[1]["defects"][0]["indices"] == [len(V)]
    assert "clean" in rows[1]["next_step"]
    assert rows[2]["defects"][0]["name"] == "unreadable file"
    assert rows[3]["defects"][0]["what"] == f"{missing}: No such file or directory"


# -- help, version, completion ---------------------------------------------------------


@pytest.mark.parametrize(
    "command", [(), ("map",), ("check",), ("certify",), ("compare",), ("batch",)]
)
def test_help(command):
    result = invoke(*command, "-h")
    assert result.exit_code == 0
    assert invoke(*command, "--help").stdout == result.stdout
    assert ("Exit codes" in result.stdout) == bool(command)


def test_version_and_completion():
    assert invoke("--version").stdout == f"cdcp-igl {__version__}\n"
    environment = {"_CDCP_IGL_COMPLETE": "complete_bash"}
    environment |= {"COMP_WORDS": "cdcp-igl map --refine-", "COMP_CWORD": "2"}
    done = CliRunner().invoke(program.app, [], env=environment, prog_name="cdcp-igl")
    assert done.stdout.split() == ["--refine-norm", "--refine-seconds"]


def test_help_names_what_the_library_has():
    assert options.READABLE == io.READABLE
    assert options.WRITABLE == io.WRITABLE
    assert tuple(io.texture.TEXTURED) == options.TEXTURED
    assert tuple(cdcp_igl.reference.METHODS) == comparing.METHODS


# -- on a terminal and in a pipe -------------------------------------------------------


def test_a_pipe_gets_plain_text_or_nothing(cap, monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")
    np.savez(cap, V=V, F=F + 1)
    result = invoke("map", cap, cap.with_name("o.obj"))
    assert (result.exit_code, result.stderr) == (0, "")
    assert result.stdout.replace("\n", "").isprintable()  # no escape sequences
    assert "  note                The faces count vertices from 1" in result.stdout
    result = invoke("map", cap, cap.with_name("o.obj"), "--force", "--quiet")
    assert (result.exit_code, result.output) == (0, "")


def test_a_terminal_gets_a_bar_after_a_second(monkeypatch):
    monkeypatch.setattr(sys, "stderr", screen := Terminal())
    monkeypatch.setenv("TERM", "xterm")
    with progress_bar() as progress:
        progress("factor", 0.5)
    assert screen.getvalue() == ""  # nobody had to wait
    with progress_bar() as progress:
        progress("factor", 0.5)
        for _ in range(200):
            if "factor" in screen.getvalue():
                break
            time.sleep(0.05)
    assert re.search(r"factor .* 50%", screen.getvalue())
