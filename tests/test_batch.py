"""Many surfaces: nothing lost, nothing overwritten, nothing done twice."""

import csv
import json
import os
from functools import partial
from pathlib import Path

import igl
import meshes
import numpy as np
import pytest
from batches import batch, contents, lines, write_surfaces, write_torn

import cdcp_igl
from cdcp_igl.batching import Record, journal
from cdcp_igl.io import write_map


@pytest.fixture
def scans(tmp_path):
    return write_surfaces(tmp_path / "scans", 5)


# -- what is made ----------------------------------------------------------------------


def test_the_results_are_those_of_a_loop(scans, tmp_path):
    made = batch([scans], tmp_path / "maps", refine=1, mobius="area")
    assert [record.status for record in made.records] == ["done"] * 5
    for record in made.records:
        V, F = cdcp_igl.io.read_mesh(record.input)
        expected = cdcp_igl.disk_map(V, F, refine=1, mobius="area")
        with np.load(tmp_path / "maps" / f"{record.name}.npz") as saved:
            np.testing.assert_array_equal(saved["uv"], expected.uv)
        assert (record.mean, record.sd) == (expected.distortion.mean, expected.distortion.sd)
        assert (record.vertices, record.faces, record.disks) == (len(V), len(F), 1)
        assert (record.flips, record.conformal) == (0, expected.conformal)
        assert record.boundary == expected.boundary.name
        assert 20 < record.memory < 2000
    names = sorted(path.name for path in (tmp_path / "maps").iterdir())
    assert names == ["results.jsonl", "summary.csv", *(f"surface_{i:03}.npz" for i in range(5))]


def test_every_surface_has_a_line(scans, tmp_path):
    write_torn(scans / "torn.npz")
    (scans / "text.obj").write_text("no surface")
    made = batch([scans, tmp_path / "missing.ply"], tmp_path / "maps")
    rows = {row["name"]: row for row in lines(tmp_path / "maps")}
    assert set(rows) == {record.name for record in made.records}
    assert len(rows) == 8
    assert {name: row["error"] for name, row in rows.items() if row["status"] != "done"} == {
        "torn": "MeshError",
        "text": "MeshError",
        "missing": "FileNotFoundError",
    }
    with (tmp_path / "maps" / "summary.csv").open(newline="") as file:
        assert [row["name"] for row in csv.DictReader(file)] == sorted(rows)
    assert len(made.done) == 5
    assert "5 of 8 surfaces mapped" in str(made)
    assert "2 MeshError" in str(made)


def test_mended_surfaces(tmp_path):
    V, F = meshes.grid(8, 8)
    torn = np.vstack([np.delete(F, [30], axis=0), F[:1]])
    np.savez(tmp_path / "torn.npz", V=V, F=torn)
    made = batch([tmp_path / "torn.npz"], tmp_path / "maps", clean=True)
    (record,) = made.records
    assert record.status == "done"
    assert any("duplicate" in change or "hole" in change for change in record.changes)
    with np.load(tmp_path / "maps" / "torn.npz") as saved:
        assert len(saved["uv"]) == len(V)


def test_rows_are_those_of_the_file_where_surfaces_are_mended(tmp_path):
    """Mending drops the first two vertices and faces, and all rows move up."""
    V, F = meshes.grid(8, 8)
    folded = np.vstack([[[0, 0, 1], [1, 1, 0]], F + 2])
    np.savez(tmp_path / "folded.npz", V=np.vstack([V[:2] + 9, V]), F=folded)
    for option, row in (("align", 7), ("center", 30)):
        out = tmp_path / option
        assert batch([tmp_path / "folded.npz"], out, clean=True, **{option: row + 2}).failed == ()
        with np.load(out / "folded.npz") as saved:
            expected = cdcp_igl.disk_map(V, F, **{option: row}).uv
            np.testing.assert_array_equal(saved["uv"], expected)
        [failed] = batch([tmp_path / "folded.npz"], out / "1", clean=True, **{option: 1}).failed
        assert failed.error == "ValueError"
        assert failed.message.endswith(" 1, which is not in the cleaned surface")


@pytest.mark.parametrize("format", ["obj", "ply"])
def test_formats(scans, tmp_path, format):
    made = batch([scans], tmp_path / "maps", format=format, disk=True)
    for record in made.records:
        V, F = cdcp_igl.io.read_mesh(record.input)
        read = cdcp_igl.io.read_mesh(tmp_path / "maps" / f"{record.name}.{format}")
        np.testing.assert_array_equal(read[0], V)
        np.testing.assert_array_equal(read[1], F)
    assert batch([scans], tmp_path / "maps", format=format, disk=True).done == made.done


@pytest.mark.parametrize(
    "options",
    [
        {"format": "stl"},
        {"center": "middle"},
        {"mobius": "both"},
        {"jobs": 0},
        {"shard": (3, 2)},
        {"executor": object(), "jobs": 2},
        {"executor": object(), "time_limit": 1},
        {"nonsense": 1},
    ],
)
def test_bad_options(scans, tmp_path, options):
    with pytest.raises((ValueError, TypeError)):
        cdcp_igl.batch([scans], tmp_path / "maps", **options)
    assert not (tmp_path / "maps").exists()


# -- going on --------------------------------------------------------------------------


def test_what_is_done_is_not_done_again(scans, tmp_path):
    out = tmp_path / "maps"
    write_torn(scans / "torn.npz")
    first = batch([scans], out)
    before = {path: path.stat().st_mtime_ns for path in out.glob("*.npz")}
    seen = []
    again = batch([scans], out, progress=lambda *counts: seen.append(counts))
    assert seen == [(5, 1, 6)]
    assert [record.line() for record in again.records] == [r.line() for r in first.records]
    assert len(lines(out)) == 6
    assert {path: path.stat().st_mtime_ns for path in out.glob("*.npz")} == before
    assert len(batch([scans], out, retry=True).failed) == 1
    assert len(lines(out)) == 7


def test_what_failed_is_done_once_it_has_been_mended(scans, tmp_path):
    write_torn(scans / "torn.npz")
    assert len(batch([scans], tmp_path / "maps").failed) == 1
    V, F = meshes.grid()
    np.savez(scans / "torn.npz", V=V, F=F)
    assert batch([scans], tmp_path / "maps").failed == ()


@pytest.mark.parametrize("lose", [Path.unlink, partial(Path.write_bytes, data=b"")])
def test_a_result_that_was_lost_is_made_again(scans, tmp_path, lose):
    out = tmp_path / "maps"
    batch([scans], out)
    before = contents(out)
    lose(out / "surface_002.npz")
    batch([scans], out)
    assert contents(out) == before
    assert len(lines(out)) == 6


def test_a_surface_that_was_written_again_is_mapped_again(scans, tmp_path):
    """Its bytes are the same, so that its result is still one of this batch."""
    out = tmp_path / "maps"
    batch([scans], out)
    before = contents(out)
    os.utime(scans / "surface_002.npz", ns=(0, 0))
    assert batch([scans], out).failed == ()
    assert len(lines(out)) == 6
    assert contents(out) == before


def test_each_surface_in_its_own_format(tmp_path):
    V, F = meshes.grid()
    (tmp_path / "scans").mkdir()
    for name in ("a.npz", "b.PLY"):
        write_map(tmp_path / "scans" / name, V, F, V[:, :2])
    igl.writeOFF(str(tmp_path / "scans" / "c.off"), V, F)
    made = batch([tmp_path / "scans"], tmp_path / "maps", format="same")
    assert made.failed == ()
    assert {path.name for path in (tmp_path / "maps").glob("[abc].*")} == {
        "a.npz",
        "b.PLY",
        "c.obj",
    }


def test_every_solver_maps_surfaces_that_are_cut(scans, tmp_path):
    made = batch([scans], tmp_path / "maps", cut=True, solver="scipy")
    assert [record.status for record in made.records] == ["done"] * 5


def test_a_result_that_was_replaced_is_no_result(scans, tmp_path):
    out = tmp_path / "maps"
    batch([scans], out)
    (out / "surface_002.npz").write_bytes(b"thesis")
    [failed] = batch([scans], out).failed
    assert failed.error == "FileExistsError"
    assert (out / "surface_002.npz").read_bytes() == b"thesis"


def test_half_a_line_is_ended_and_does_not_count(scans, tmp_path):
    """As a full disk leaves it: the result is not in its place then."""
    out = tmp_path / "maps"
    batch([scans], out)
    before = contents(out)
    last = lines(out)[-1]["name"]
    (out / "results.jsonl").write_bytes((out / "results.jsonl").read_bytes()[:-40])
    (out / f"{last}.npz").unlink()
    made = batch([scans], out)
    assert len(made.done) == 5
    assert contents(out) == before
    *kept, cut, added = (out / "results.jsonl").read_text().splitlines()
    with pytest.raises(ValueError, match=r"Unterminated|Expecting"):
        json.loads(cut)
    assert [json.loads(line)["status"] for line in (*kept, added)] == ["done"] * 5


def test_files_of_others_are_not_overwritten(scans, tmp_path):
    out = tmp_path / "maps"
    out.mkdir()
    (out / "surface_001.npz").write_bytes(b"thesis")
    made = batch([scans], out)
    assert [(record.name, record.error) for record in made.failed] == [
        ("surface_001", "FileExistsError")
    ]
    assert "is there" in made.failed[0].message
    assert (out / "surface_001.npz").read_bytes() == b"thesis"
    (out / "surface_001.npz").unlink()
    assert batch([scans], out).failed == ()  # without `retry`: it is not the surface's fault


def test_results_of_other_options_or_surfaces_are_not_overwritten(scans, tmp_path):
    out = tmp_path / "maps"
    batch([scans], out)
    before = contents(out)
    made = batch([scans], out, mobius="area")
    assert {record.status for record in made.records} == {"refused"}
    V, F = meshes.grid(9, 9)
    np.savez(scans / "surface_000.npz", V=V, F=F)
    assert [record.name for record in batch([scans], out).failed] == ["surface_000"]
    assert contents(out) == before


def test_the_surface_is_never_replaced(scans):
    before = contents(scans)
    made = batch(sorted(scans.glob("*.npz")), scans)
    assert {record.status for record in made.records} == {"refused"}
    assert "is the surface itself" in made.records[0].message
    assert contents(scans) == before


def test_shards_share_the_work(scans, tmp_path):
    out = tmp_path / "maps"
    whole = batch([scans], tmp_path / "whole")
    parts = [batch([scans], out, shard=(i, 3)) for i in (1, 2, 3)]
    assert sorted(record.name for part in parts for record in part.records) == [
        record.name for record in whole.records
    ]
    assert contents(out) == contents(tmp_path / "whole")
    with (out / "summary.csv").open(newline="") as file:
        assert len(list(csv.DictReader(file))) == 5
    seen = []
    batch([scans], out, progress=lambda *counts: seen.append(counts))
    assert seen == [(5, 0, 5)]


def test_two_batches_in_one_folder(scans, tmp_path):
    out = tmp_path / "maps"
    out.mkdir()
    with (
        journal.Journal(out),
        pytest.raises(OSError, match="another batch is writing there"),
    ):
        batch([scans], out)
    assert len(batch([scans], out).done) == 5


# -- records ---------------------------------------------------------------------------


def test_records_survive_their_file():
    record = Record("a", os.fsdecode(b"/\xe4.obj"), status="failed", message="ä", changes=("One.",))
    again = Record.from_line(record.line())
    assert again.input == record.input
    assert again.changes == record.changes
    assert np.isnan(again.mean)
    assert Record.from_line('{"name": "a", "input": "b", "status": "done", "new": 1}').name == "a"
    for line in ("", "{", "[]", "{}", "null", '{"name": "a"'):
        with pytest.raises(ValueError, match=r"no record|Expecting"):
            Record.from_line(line)


def test_lines_of_others_are_passed_over(scans, tmp_path):
    batch([scans], tmp_path / "maps")
    [line, *_] = lines(tmp_path / "maps")
    wrong = {"name": ["cap"], "changes": None, "finished": 1, "mean": "high", "flips": None}
    with (tmp_path / "maps" / "results.jsonl").open("a") as file:
        for name, value in (*wrong.items(), ("changes", [1])):
            file.write(json.dumps(line | {name: value}) + "\n")
            with pytest.raises(ValueError, match="no record"):
                Record.from_line(json.dumps(line | {name: value}))
    assert len(batch([scans], tmp_path / "maps").done) == 5
