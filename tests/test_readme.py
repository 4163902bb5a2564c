"""The lines of README, run twice: what a reader types has to work, and to do no harm again."""

import re
import shlex
from pathlib import Path

import igl
import numpy as np
import pytest
from typer.testing import CliRunner

import cdcp_igl
from cdcp_igl.command_line.program import app

README = Path(__file__).parent.parent.joinpath("README.md").read_text(encoding="utf-8")


def blocks(language):
    return re.findall(rf"^```{language}\n(.*?)^```", README, re.MULTILINE | re.DOTALL)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with the files that README names."""
    V, F, _ = cdcp_igl.datasets.paraboloid(12)
    (tmp_path / "scans").mkdir()
    for name in ("face.obj", "scan.obj", "scans/first.obj", "scans/second.obj"):
        igl.writeOBJ(str(tmp_path / name), V, F)
    loop = igl.boundary_loop(F)
    V[:, 2] -= V[loop, 2].mean()
    V[loop, 2] = 0
    both, mirrored = np.vstack([V, V * [1, 1, -1]]), F[:, ::-1] + len(V)
    statue = cdcp_igl.clean(both, np.vstack([F, mirrored]))  # merged along the boundary: closed
    igl.writeOBJ(str(tmp_path / "statue.obj"), statue.V, statue.F)
    chart = cdcp_igl.cut(statue.V, statue.F)
    cdcp_igl.io.write_map(tmp_path / "statue.glb", chart.V, chart.F, chart.V[:, :2])  # with seams
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_python(folder):
    V, F = igl.read_triangle_mesh("face.obj")
    known = {
        **{"igl": igl, "cdcp_igl": cdcp_igl},
        **{"V": V, "F": F, "V_later": V * [1, 1, 1.1], "result": cdcp_igl.disk_map(V, F)},
        "corners": igl.boundary_loop(F)[[0, 20, 40, 60]],
    }
    code = [block for block in blocks("python") if not block.startswith(">>>")]
    assert len(code) >= 4
    for block in code + code:
        exec(block, dict(known))
    assert {"map.html", "map.obj"} <= {path.name for path in folder.iterdir()}


def test_the_shell(folder):
    (text,) = (block for block in blocks("sh") if "cdcp-igl map" in block)
    lines = [shlex.split(line, comments=True) for line in text.strip().splitlines()]
    assert {program for program, *_ in lines} == {"cdcp-igl"}
    for _, *arguments in lines:
        done = CliRunner().invoke(app, arguments)
        # `check` says that the statue is no disk.
        assert done.exit_code == (2 if arguments[0] == "check" else 0), done.output
    for _, *arguments in lines:
        if arguments[0] == "map":  # again, without --force
            assert CliRunner().invoke(app, arguments).exit_code == 2
    assert {"face_disk.obj", "statue_disk.obj", "scan_disk.obj", "face.html", "maps.html"} <= {
        path.name for path in folder.iterdir()
    }


def test_the_printed_result(real_mesh):
    (block,) = (block for block in blocks("python") if "print(result)" in block)
    expected = block.split("print(result)\n", 1)[1].splitlines()
    printed = str(cdcp_igl.disk_map(*real_mesh("chinese_lion_17334"))).splitlines()
    assert len(printed) == len(expected)
    for line, shown in zip(printed, expected, strict=True):
        label = line[:22]
        assert shown[:22] == label
        if label.strip() not in ("solver", "seconds"):  # of the machine
            assert shown == line
