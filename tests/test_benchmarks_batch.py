"""Many surfaces: any of them, side by side, in parts, and nothing that git tracks changed."""

import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import igl
import meshes
import numpy as np
import pytest
from benchmark_commands import ROOT, benchmarks, in_one_line, refused

import cdcp_igl
from benchmarks.measure.cases import Limits, run
from benchmarks.measure.methods import METHODS, TABLE
from benchmarks.measure.models import Model, as_disk
from benchmarks.records.record import OPENED
from benchmarks.records.results import Measured, NotMeasured
from benchmarks.records.store import Work, read_results
from cdcp_igl.batching.names import read_shard, shard_of
from cdcp_igl.reference import harmonic

LIMITS = Limits(60, 4000)
GRIDS = [Model(f"grid {k}", lambda k=k: meshes.grid(6 + k, 7)) for k in range(3)]
TETRAHEDRON = (
    np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]]),
    np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]),
)


def measure(folder, models, names=("cdcp", "harmonic"), limits=LIMITS, **options):
    chosen = {name: METHODS[name] for name in names}
    return run("tables", models, chosen, table=TABLE, limits=limits, work=Work(folder), **options)


def accuracies(records):
    return [(r.model, r.case.method, r.case.outcome, r.case.mean, r.histogram) for r in records]


def test_parts_and_jobs_measure_what_one_run_measures(tmp_path):
    alone = measure(tmp_path / "alone", GRIDS)
    parts = [measure(tmp_path / "w", GRIDS, shard=(part, 2), jobs=2) for part in (1, 2)]
    assert [{r.model for r in part} for part in parts] == [{"grid 0", "grid 2"}, {"grid 1"}]
    lines = [path.read_bytes() for path in sorted((tmp_path / "w").glob("results*.jsonl"))]
    assert [text.count(b"\n") for text in lines] == [4, 2]
    together = measure(tmp_path / "w", GRIDS)
    assert accuracies(together) == accuracies(alone)
    assert (tmp_path / "w" / "results.jsonl").read_bytes() == b""  # nothing was left to measure
    assert not list((tmp_path / "w").glob(".*.attempts"))


def test_other_conditions_are_measured_too(tmp_path, monkeypatch):
    def again(threads):
        (record,) = measure(tmp_path, GRIDS[:1], ["cdcp"], limits=Limits(60, 4000, threads))
        return record.threads, record.case.details["solver"]

    monkeypatch.setenv("CDCP_IGL_SOLVER", "scikit-sparse")
    assert [threads for threads, _ in map(again, (1, 4, 1))] == [1, 4, 1]
    monkeypatch.setenv("CDCP_IGL_SOLVER", "scipy")
    assert "SuperLU" in again(1)[1]
    assert len(Work(tmp_path).records()) == 3
    monkeypatch.setenv("CDCP_IGL_SOLVER", "magic")
    assert "not 'magic'" in refused("tables", "--models", "ellipse_20", "--work", tmp_path)


def test_what_a_limit_has_ended_is_measured_again_under_a_larger_one(tmp_path):
    outcomes = []
    for limits in (Limits(0.01, 4000), Limits(0.005, 4000), Limits(60, 5), Limits(60, 4000)):
        (record,) = measure(tmp_path, GRIDS[:1], ["cdcp"], limits=limits)
        outcomes.append(record.case.outcome)
    late = "no result within 0.01 s"
    assert outcomes == [late, late, "more than 5 MiB of memory", "ok"]


def test_results_that_cannot_be_written_are_told_before_anything_is_measured(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # the message names the path, and is cut into lines
    Path("file").touch()
    options = ("--models", "ellipse_20", "--work", tmp_path / "w")
    assert "Invalid value for --out: file/x: " in refused("tables", *options, "--out", "file/x")
    other = tmp_path / "here.json"
    for text in ("{}", "[]", "thesis"):
        other.write_text(text)
        for command in (("tables", *options), ("figures",)):
            told = refused(*command, "--out", tmp_path, "--machine", "here")
            assert "is no file of results: move it" in told
    assert not (tmp_path / "w").exists()


@pytest.mark.parametrize("line", ["{}", "3", '{"section": "tables", "method": "cdcp"}', '{"sect'])
def test_a_line_that_is_no_record_does_not_count(tmp_path, line):
    (tmp_path / "results.jsonl").write_text(f"{line}\n")
    assert Work(tmp_path).records() == []


def test_two_runs_do_not_write_to_one_folder(tmp_path):
    with Work(tmp_path).journal(), pytest.raises(OSError, match="another batch is writing"):
        measure(tmp_path, GRIDS)
    with Work(tmp_path).journal():
        done = tables("--models", "ellipse_20", "--work", tmp_path)
    assert done.returncode == 2
    assert "share the work by shards" in in_one_line(done.stderr)


def tables(*arguments):
    return benchmarks("tables", "--methods", "cdcp", *arguments)


def test_parts_by_command(tmp_path):
    arguments = ("--models", "ellipse_20,square_80", "--work", tmp_path / "w", "--machine", "here")
    for part in ("1/2", "2/2"):
        done = tables(*arguments, "--shard", part)
        assert done.returncode == 0, done.stderr
        assert "the same without --shard writes the results" in done.stdout
    assert not (tmp_path / "w" / "here.json").exists()
    assert tables(*arguments).returncode == 0
    records = read_results(tmp_path / "w" / "here.json")[1]
    assert [record.model for record in records] == ["ellipse_20", "square_80"]


@pytest.mark.parametrize("part", ["0/2", "3/2", "1", "a/b"])
def test_a_part_that_is_none(part):
    with pytest.raises(ValueError, match="I/N"):
        read_shard(part)
    assert "I/N" in refused("tables", "--shard", part)


def test_the_parts_are_all():
    items = list(range(10))
    parts = [shard_of(items, (part, 3)) for part in (1, 2, 3)]
    assert sorted(item for part in parts for item in part) == items
    assert shard_of(items, None) == items
    with pytest.raises(ValueError, match="from 1 to n"):
        shard_of(items, (4, 3))


def test_a_surface_that_is_no_disk_is_opened_once(tmp_path, monkeypatch):
    closed = Model("closed", lambda: TETRAHEDRON)
    (record,) = measure(tmp_path, [closed], ["cdcp"])
    assert record.ok
    assert record.mesh.endswith(OPENED)
    assert (record.faces, record.boundary_vertices) == (4, 4)
    V, F = Measured([record], Work(tmp_path).surface).surface("closed")
    assert cdcp_igl.check(V, F).is_disk
    monkeypatch.setattr("benchmarks.measure.models.surface_map", None)  # not called again
    assert measure(tmp_path, [closed], ["cdcp"]) == [record]


def test_the_largest_part_is_taken_with_its_holes_filled(tmp_path):
    V, F = meshes.grid(9, 9)
    middle = np.flatnonzero((F == 40).any(axis=1))
    holed = np.delete(F, middle, axis=0)
    small_V, small_F = meshes.grid(3, 3)
    both = np.vstack([small_V, V + 10]), np.vstack([small_F, holed + len(small_V)])
    mesh, _, disk = as_disk(Model("both", lambda: both), Work(tmp_path))
    assert mesh.endswith(OPENED)
    assert len(holed) < len(disk) <= len(F)


def test_a_surface_that_cannot_be_opened_is_a_row(tmp_path):
    V = np.random.default_rng(0).normal(size=(5, 3))
    moebius = np.array([[k, (k + 1) % 5, (k + 2) % 5] for k in range(5)])
    (record,) = measure(tmp_path, [Model("strip", lambda: (V, moebius))], ["cdcp"])
    assert record.case.outcome.startswith("not to be had: ")
    assert "one-sided" in record.case.outcome or "orient" in record.case.outcome


def test_a_map_is_that_of_its_mesh_and_of_its_model(tmp_path):
    wide, long = (meshes.grid(9, 6), meshes.grid(6, 9))
    for name, surface in (("a_b", wide), ("a_b", long), ("a b", long)):
        measure(tmp_path, [Model(name, lambda given=surface: given)], ["harmonic"])
    work = Work(tmp_path)
    before, _, other = work.records()
    again = Measured([before, other], work.surface, work.map)  # the first mesh is back
    for name, surface in (("a_b", wide), ("a b", long)):
        np.testing.assert_array_equal(again.map(name, "harmonic"), harmonic(*surface))


def test_the_surface_is_that_of_the_maps(tmp_path):
    (record,) = measure(tmp_path, GRIDS[:1], ["harmonic"])
    later = replace(record, section="speed", mesh="changed")
    measured = Measured([record, later], Work(tmp_path).surface)
    np.testing.assert_array_equal(measured.surface("grid 0")[0], GRIDS[0].load()[0])


def test_a_surface_that_is_gone_is_not_measured(tmp_path):
    (record,) = measure(tmp_path, GRIDS[:1], ["cdcp"])
    Work(tmp_path).surface_path(record.mesh).unlink()
    with pytest.raises(NotMeasured, match="not in the work folder any more"):
        Measured([record], Work(tmp_path).surface).surface(record.model)


@pytest.mark.slow
def test_the_commands_of_the_readme_change_nothing_that_git_tracks(tmp_path):
    """In a clean clone."""
    if not (ROOT / ".git").exists():
        pytest.skip("not a clone")
    clone = tmp_path / "clone"
    subprocess.run(["git", "clone", "--quiet", ROOT, clone], check=True)
    (clone / "scans").mkdir()
    for k in range(2):
        V, F = meshes.grid(8, 9 + k)
        igl.writeOBJ(str(clone / "scans" / f"scan{k}.obj"), V, F)
    text = (clone / "README.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```sh\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    (block,) = (block for block in blocks if "python -m benchmarks" in block)
    commands = block.splitlines()
    environment = {k: v for k, v in os.environ.items() if k != "CDCP_IGL_DATA"}
    environment |= {
        "PYTHONPATH": str(clone),
        "PATH": f"{Path(sys.executable).parent}:/usr/bin:/bin",
    }
    for command in commands:
        done = subprocess.run(
            command, shell=True, cwd=clone, env=environment, capture_output=True, timeout=600
        )
        assert done.returncode == 0, done.stderr.decode()
    tracked = ["git", "status", "--porcelain", "--untracked-files=no"]
    assert subprocess.check_output(tracked, cwd=clone) == b""
    assert (clone / "mine").is_dir()
