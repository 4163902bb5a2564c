"""What a batch says while it runs, and at the end."""

import os

import numpy as np
from batches import invoke
from commands import Terminal, app
from surfaces import sphere

from cdcp_igl.command_line import batches, screen


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


def test_a_quiet_batch_still_says_what_failed_and_which_command_maps_it(scans, tmp_path):
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
