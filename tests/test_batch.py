"""Many surfaces: nothing lost, nothing overwritten, nothing done twice."""

import csv
import json
import os
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path

import meshes
import numpy as np
import pytest

import cdcp_igl
from cdcp_igl.batching import Record, batch, journal, pool
from cdcp_igl.batching.memory import memory_needed
from cdcp_igl.batching.names import result_names, shown, surface_files

WORKERS = Path(__file__).parent / "workers"


def write_surfaces(folder, count):
    folder.mkdir(exist_ok=True)
    for i in range(count):
        V, F = meshes.grid(5 + i % 4, 6, seed=i)
        np.savez(folder / f"surface_{i:03}.npz", V=V, F=F)
    return folder


@pytest.fixture
def scans(tmp_path):
    return write_surfaces(tmp_path / "scans", 5)


@pytest.fixture
def unruly(monkeypatch):
    """Workers that die, hang and grow, by the name of the surface."""
    path = os.environ.get("PYTHONPATH", "")
    here = Path(cdcp_igl.__file__).parents[1]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(WORKERS), str(here), path]))


def contents(folder):
    return {path.name: path.read_bytes() for path in Path(folder).glob("*.npz")}


def lines(folder):
    return [json.loads(line) for line in (Path(folder) / "results.jsonl").read_text().splitlines()]


def command(*arguments, **options):
    here = str(Path(cdcp_igl.__file__).parents[1])
    return subprocess.run(
        [sys.executable, "-m", "cdcp_igl", "batch", *map(str, arguments)],
        capture_output=True,
        text=True,
        errors="surrogateescape",
        cwd=here,
        **options,
    )


# -- what is made ----------------------------------------------------------------------


@pytest.mark.parametrize("jobs", [1, 2])
def test_the_results_are_those_of_a_loop(scans, tmp_path, jobs):
    made = batch([scans], tmp_path / "maps", jobs=jobs, refine=1, mobius="area")
    assert [record.status for record in made.records] == ["done"] * 5
    for record in made.records:
        V, F = cdcp_igl.io.read_mesh(record.input)
        expected = cdcp_igl.disk_map(V, F, refine=1, mobius="area")
        with np.load(tmp_path / "maps" / f"{record.name}.npz") as saved:
            np.testing.assert_array_equal(saved["uv"], expected.uv)
        assert (record.mean, record.sd) == (expected.distortion.mean, expected.distortion.sd)
        assert (record.vertices, record.faces, record.disks) == (len(V), len(F), 1)
        assert (record.flips, record.conformal) == (0, expected.conformal)
        assert record.boundary == expected.trace.name
        assert 20 < record.memory < 2000
    names = sorted(path.name for path in (tmp_path / "maps").iterdir())
    assert names == [*(f"surface_{i:03}.npz" for i in range(5)), "results.jsonl", "summary.csv"][
        -2:
    ] + [f"surface_{i:03}.npz" for i in range(5)]


def test_every_surface_has_a_line(scans, tmp_path):
    V, F = meshes.grid()
    np.savez(scans / "torn.npz", V=V, F=F[1:-30])
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
        batch([scans], tmp_path / "maps", **options)
    assert not (tmp_path / "maps").exists()


# -- going on --------------------------------------------------------------------------


def test_what_is_done_is_not_done_again(scans, tmp_path):
    out = tmp_path / "maps"
    V, F = meshes.grid()
    np.savez(scans / "torn.npz", V=V, F=F[1:-30])
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
    V, F = meshes.grid()
    np.savez(scans / "torn.npz", V=V, F=F[1:-30])
    assert len(batch([scans], tmp_path / "maps").failed) == 1
    np.savez(scans / "torn.npz", V=V, F=F)
    assert batch([scans], tmp_path / "maps").failed == ()


def test_a_result_that_was_lost_is_made_again(scans, tmp_path):
    out = tmp_path / "maps"
    batch([scans], out)
    before = contents(out)
    (out / "surface_002.npz").unlink()
    batch([scans], out)
    assert contents(out) == before
    assert len(lines(out)) == 6


def test_a_result_without_a_line_is_made_again(scans, tmp_path):
    """As a run leaves it that was killed between the two."""
    out = tmp_path / "maps"
    batch([scans], out)
    before = contents(out)
    whole = (out / "results.jsonl").read_bytes()
    (out / "results.jsonl").write_bytes(whole[:-40])
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
    assert "would replace the surface" in made.records[0].message
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


# -- names -----------------------------------------------------------------------------


def test_names_do_not_collide(tmp_path):
    files = ["a/face.obj", "b/face.obj", "b/Face.ply", "b/hand.obj", "face.npz"]
    files += ["hand.obj.off", "c/x.obj", "c/x.ply", "c/x.obj.ply"]
    paths = [tmp_path / file for file in files]
    names = result_names(paths)
    assert names[0] == "a/face"
    assert names[1] == "b/face.obj"
    assert names[3] == "b/hand" or names[3] == "hand"
    assert len({name.casefold() for name in names}) == len(names)
    assert result_names([tmp_path / "one.obj"]) == ["one"]
    assert result_names([]) == []


def test_large_and_small_letters_count_as_equal(tmp_path):
    names = result_names([tmp_path / "Face.obj", tmp_path / "face.obj"])
    assert len({name.casefold() for name in names}) == 2


def test_folders_and_patterns(scans, tmp_path):
    out = scans / "maps"
    (scans / "below" / ".hidden").mkdir(parents=True)
    for name in ("below/a.obj", "below/notes.txt", "below/.b.obj", "below/.hidden/c.obj"):
        (scans / name).touch()
    out.mkdir()
    (out / "surface_000.npz").touch()
    expected = [scans / "below" / "a.obj", *(scans / f"surface_{i:03}.npz" for i in range(5))]
    assert surface_files([scans], out) == expected
    assert surface_files([scans, scans / "surface_003.npz"], out) == expected
    assert surface_files([f"{scans}/*_00[12].npz"], out) == expected[2:4]
    assert surface_files([f"{scans}/**/*.obj"], out) == expected[:1]
    assert surface_files([tmp_path / "missing.obj"], out) == [tmp_path / "missing.obj"]
    for nothing in (f"{scans}/*.stl", out.parent / "below" / ".hidden" / "none*.obj"):
        with pytest.raises(ValueError, match="no surface there"):
            surface_files([nothing], out)
    with pytest.raises(ValueError, match="folder of the results"):
        surface_files([scans], scans)


def test_names_that_are_no_text(scans, tmp_path):
    name = os.fsdecode(b"Stra\xdfe 5\n.npz")  # Latin-1
    try:
        (scans / "surface_000.npz").rename(scans / name)
    except OSError:  # a file system that takes UTF-8 only
        pytest.skip("no such names here")
    done = command(scans, tmp_path / "maps")
    assert done.returncode == 0, done.stderr
    assert "Stra\\xdfe 5" in done.stdout
    assert (tmp_path / "maps" / name).exists()
    assert len(batch([scans], tmp_path / "maps").done) == 5
    assert len(lines(tmp_path / "maps")) == 5
    assert "\\xdf" in shown(name)


# -- workers that die ------------------------------------------------------------------


@pytest.mark.usefixtures("unruly")
def test_one_surface_does_not_cost_the_others(scans, tmp_path):
    for name in ("kill", "segfault", "once", "words", "hang", "hog", "chatty"):
        V, F = meshes.grid()
        np.savez(scans / f"{name}_x.npz", V=V, F=F)
    limits = {"time_limit": 4, "memory_limit": 500}
    made = batch([scans], tmp_path / "maps", jobs=2, **limits)
    said = {record.name: (record.error, record.message) for record in made.failed}
    assert said == {
        "kill_x": ("Crash", "crashed: SIGKILL (3 times)"),
        "segfault_x": ("Crash", "crashed: SIGSEGV (3 times)"),
        "words_x": ("Crash", "failed: last words (3 times)"),
        "hang_x": ("TimeLimit", "no result within 4 s"),
        "hog_x": ("MemoryLimit", "more than 500 MiB of memory"),
    }
    assert len(made.done) == 7
    seen = []
    batch([scans], tmp_path / "maps", progress=lambda *counts: seen.append(counts), **limits)
    assert seen == [(7, 5, 12)]


def test_a_worker_that_cannot_start(scans, tmp_path, monkeypatch):
    broken = tmp_path / "broken"
    broken.mkdir()
    (broken / "numpy.py").write_text("raise ImportError('no numpy today')")
    monkeypatch.setenv("PYTHONPATH", str(broken))
    monkeypatch.chdir(Path(cdcp_igl.__file__).parents[1])
    with pytest.raises(RuntimeError, match="no numpy today"):
        batch([scans], tmp_path / "maps")
    assert lines(tmp_path / "maps") == []


def test_large_surfaces_wait_for_each_other(scans, tmp_path, monkeypatch):
    running, most = set(), []

    class Watched(pool._Worker):
        def begin(self, task):
            running.add(task.name)
            most.append(len(running))
            super().begin(task)

    monkeypatch.setattr(pool, "_Worker", Watched)

    def finished(done, failed, total):
        for line in lines(tmp_path / "maps"):
            running.discard(line["name"])

    monkeypatch.setattr(pool, "available_memory", lambda: 1000.0)
    monkeypatch.setattr(pool, "memory_needed", lambda path: 600.0)
    assert len(batch([scans], tmp_path / "maps", jobs=3, progress=finished).done) == 5
    assert max(most) == 1


@pytest.mark.parametrize("suffix", ["npz", "obj", "off", "ply", "stl"])
def test_the_memory_is_guessed_from_above(tmp_path, suffix):
    V, F = meshes.grid(40, 50)
    path = tmp_path / f"grid.{suffix}"
    if suffix == "npz":
        np.savez_compressed(path, V=V, F=F)
    else:
        trimesh = pytest.importorskip("trimesh")
        trimesh.Trimesh(V, F, process=False).export(path)
    least = memory_needed(str(tmp_path / "missing.obj"))
    assert least + 2000 * 1e-3 < memory_needed(str(path)) < least + 2000 * 1e-2


# -- executors -------------------------------------------------------------------------


def test_any_executor(scans, tmp_path):
    batch([scans], tmp_path / "whole")
    for number, kind in enumerate((ThreadPoolExecutor, ProcessPoolExecutor)):
        with kind(2) as executor:
            made = batch([scans], tmp_path / f"maps{number}", executor=executor)
        assert len(made.done) == 5
        assert contents(tmp_path / f"maps{number}") == contents(tmp_path / "whole")
        assert not list((tmp_path / f"maps{number}").glob(".*"))


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
