"""Batches of surfaces that are no disks, the page about them, and what is said meanwhile."""

import os
import re

import meshes
import numpy as np
import pytest
from batches import batch, contents, invoke, lines, write_surfaces
from commands import Terminal, app
from surfaces import sphere

import cdcp_igl
from cdcp_igl.command_line import batches, screen


@pytest.fixture
def kinds(tmp_path):
    """Two disks; a surface of two parts, one of them flipped; and a closed one."""
    folder = write_surfaces(tmp_path / "kinds", 2)
    V, F = meshes.grid()
    two = np.vstack([F, F[:, ::-1] + len(V)])
    np.savez(folder / "two.npz", V=np.vstack([V, V + np.array([20, 0, 0])]), F=two)
    _, V, F, _ = meshes.NASTY["closed"]
    np.savez(folder / "closed.npz", V=V, F=F)
    return folder


def test_surfaces_that_are_no_disks(kinds, tmp_path):
    assert len(batch([kinds], tmp_path / "disks").failed) == 2
    made = batch([kinds], tmp_path / "maps", cut=True, refine=1, solver="scipy")
    assert made.failed == ()
    records = {record.name: record for record in made.records}
    disks = {name: record.charts for name, record in records.items()}
    assert disks == {"surface_000": 1, "surface_001": 1, "two": 2, "closed": 1}
    assert all(np.isfinite(record.area_sd + record.texels) for record in made.records)
    assert any("cut open" in change for change in records["closed"].changes)
    for name in records:
        V, F = cdcp_igl.io.read_mesh(kinds / f"{name}.npz")
        result = cdcp_igl.surface_map(V, F, refine=1, solver="scipy")
        with np.load(tmp_path / "maps" / f"{name}.npz") as saved:
            np.testing.assert_array_equal(saved["uv"], result.uv)
            np.testing.assert_array_equal(saved["face_chart"], result.face_chart)
            np.testing.assert_array_equal(saved["F"][saved["face_index"]], F)


def test_a_page_about_the_batch(kinds, tmp_path):
    np.savez(kinds / "<b>torn & bad.npz", V=meshes.grid()[0], F=[[0, 1, 99]])
    page = tmp_path / "page.html"
    assert invoke(kinds, tmp_path / "maps", "--cut", "--report", page).exit_code == 4
    text = page.read_text()
    assert "4 of 5 surfaces mapped" in text
    assert "&lt;b&gt;torn &amp; bad" in text
    assert "<b>" not in text
    assert "index out of range" in text or "MeshError" in text
    assert not re.search(r"(src|href)=", text)
    assert text.count("<rect") == 30
    # The results are the same without it, and it can be had later.
    assert batch([kinds], tmp_path / "plain", cut=True).done
    assert contents(tmp_path / "plain") == contents(tmp_path / "maps")
    batch([kinds], tmp_path / "maps", cut=True, report=page)
    assert page.read_text() == text
    assert len(lines(tmp_path / "maps")) == 5


@pytest.mark.parametrize("name", ["summary.csv", "page.html"])
def test_summaries_and_reports_of_others_are_not_overwritten(kinds, tmp_path, name):
    (tmp_path / "maps").mkdir()
    other = tmp_path / "maps" / name
    other.write_text("thesis")
    done = invoke(kinds, tmp_path / "maps", "--report", tmp_path / "maps" / "page.html")
    assert done.exit_code == 1
    assert f"{other}: is no" in done.stderr
    assert [path.name for path in (tmp_path / "maps").iterdir()] == [name]
    assert other.read_text() == "thesis"


# -- while it runs ---------------------------------------------------------------------


def test_a_line_now_and_then_in_a_pipe(scans, tmp_path, monkeypatch):
    monkeypatch.setattr(batches, "NOW_AND_THEN", -1)
    result = invoke(scans, tmp_path / "maps")
    assert result.exit_code == 0
    assert [line.partition(" s: ")[2] for line in result.stderr.splitlines()] == [
        f"{done} of 3 mapped, 0 failed" for done in range(4)
    ]


def test_a_short_batch_says_nothing_meanwhile(scans, tmp_path):
    done = invoke(scans, tmp_path / "maps")
    assert done.stderr == ""
    assert "3 of 3 surfaces mapped" in done.stdout
    assert invoke(scans, tmp_path / "maps", "--quiet").output == ""
    # A quiet one still says what failed, and which command maps it.
    np.savez(scans / "closed.npz", **dict(zip("VF", sphere(), strict=True)))
    result = invoke(scans, tmp_path / "maps", "--quiet")
    assert (result.exit_code, result.stdout) == (4, "")
    assert "cdcp-igl batch --cut cuts it open" in result.stderr


def test_a_folder_that_is_not_there_makes_nothing(tmp_path):
    result = invoke(tmp_path / "scans", tmp_path / "maps")
    assert (result.exit_code, os.listdir(tmp_path)) == (2, [])
    assert "no such folder" in result.stderr


def test_long_tables_have_the_worst_and_the_failures(scans, tmp_path, monkeypatch):
    for i in range(3):
        (scans / f"text_{i}.obj").write_text("no surface")
    monkeypatch.setattr(batches, "LONG", 2)
    monkeypatch.setattr(batches, "WORST", 1)
    result = invoke(scans, tmp_path / "maps")
    assert result.exit_code == 4
    assert "the 1 with the largest mean" in result.stdout
    assert result.stdout.count("surface_") == 1
    assert result.stdout.count(": MeshError: ") == 2
    assert "and 1 more" in result.stdout
    assert "3 of 6 surfaces mapped" in result.stdout


def test_the_table_is_whole_on_a_narrow_terminal(scans, tmp_path, monkeypatch):
    (scans / "surface_000.npz").rename(scans / f"{'surface_' * 4}.npz")
    monkeypatch.setattr(screen, "PIPE", 30)
    rows = invoke(scans, tmp_path / "maps").stdout.splitlines()
    assert rows[0].split()[:3] == ["surface", "vertices", "mean"]
    first, second = (row.split() for row in rows[4:6])
    assert (first[0] + second[0], first[1]) == ("surface_" * 4, "30")
    assert "…" not in "".join(rows)


def test_a_bar_on_a_terminal(scans, tmp_path, monkeypatch):
    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    monkeypatch.setenv("TERM", "xterm")
    app(["batch", str(scans), str(tmp_path / "maps")], standalone_mode=False)
    assert "0/3" in terminal.getvalue()
    assert "0 failed" in terminal.getvalue()
