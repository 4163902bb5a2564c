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
from benchmark_commands import GRID, LIMITS, ROOT, benchmarks, measure, refused

import cdcp_igl
from benchmarks.measure.cases import Limits
from benchmarks.measure.models import Model, as_disk
from benchmarks.records.record import OPENED
from benchmarks.records.results import Measured, NotMeasured
from benchmarks.records.store import Work, read_results
from benchmarks.write.sections import tables
from cdcp_igl.reference import harmonic


def test_parts_and_jobs_measure_what_one_run_measures(tmp_path):
    grids = [Model(f"grid {k}", lambda k=k: meshes.grid(6 + k, 7)) for k in range(3)]
    parts = [measure(tmp_path, ["harmonic"], grids, shard=(k, 2), jobs=2) for k in (1, 2)]
    assert [{r.model for r in part} for part in parts] == [{"grid 0", "grid 2"}, {"grid 1"}]
    lines = [path.read_bytes() for path in sorted(tmp_path.glob("results*.jsonl"))]
    assert [text.count(b"\n") for text in lines] == [2, 1]
    together = measure(tmp_path, ["harmonic"], grids)
    for made, model in zip(together, grids, strict=True):
        V, F = model.load()
        degrees = cdcp_igl.angle_distortion(V, F, harmonic(V, F))
        assert (made.model, made.case.mean) == (model.name, pytest.approx(degrees.mean()))
    assert (tmp_path / "results.jsonl").read_bytes() == b""  # nothing was left to measure
    assert not list(tmp_path.glob(".*.attempts"))


def test_other_conditions_are_measured_too(tmp_path, monkeypatch):
    def again(threads):
        (record,) = measure(tmp_path, ["cdcp"], limits=Limits(60, 4000, threads))
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
        (record,) = measure(tmp_path, ["harmonic"], limits=limits)
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


def test_parts_by_command(tmp_path):
    arguments = ("tables", "--methods", "harmonic", "--models", "ellipse_20,square_80")
    arguments = (*arguments, "--work", tmp_path, "--machine", "here")
    for part in ("1/2", "2/2"):
        done = benchmarks(*arguments, "--shard", part)
        assert done.exit_code == 0, done.output
        assert "the same without --shard writes the results" in done.stdout
    assert not (tmp_path / "here.json").exists()
    assert benchmarks(*arguments).exit_code == 0
    records = read_results(tmp_path / "here.json")[1]
    assert [record.model for record in records] == ["ellipse_20", "square_80"]


def test_a_surface_that_is_no_disk_is_opened_once(tmp_path):
    closed = Model("closed", lambda: meshes.NASTY["closed"][1:3])
    (record,) = measure(tmp_path, ["harmonic"], [closed])
    assert record.ok
    assert record.mesh.endswith(OPENED)
    assert (record.faces, record.boundary_vertices) == (4, 4)
    V, F = Measured([record], Work(tmp_path).surface).surface("closed")
    assert cdcp_igl.check(V, F).is_disk
    Work(tmp_path).keep_surface(record.mesh, 2 * V, F)  # is taken, not opened again
    np.testing.assert_array_equal(as_disk(closed, Work(tmp_path))[1], 2 * V)
    assert measure(tmp_path, ["harmonic"], [closed]) == [record]


def test_closed_surfaces_are_mapped_as_they_are_and_cut_open(tmp_path):
    """A method onto the sphere has the surface, another the disk; and none of a disk."""
    closed = Model("closed", lambda: cdcp_igl.datasets.spheroid(2)[:2])
    names = ["flash", "sphere refine=5", "harmonic"]
    made = {r.case.method: r for r in measure(tmp_path, names, [closed, GRID])}
    assert sorted(made) == sorted(names)
    assert [made[name].ok for name in names] == [True] * 3
    assert [made[name].boundary_vertices > 0 for name in names] == [False, False, True]
    assert made["flash"].case.boundary == "sphere"
    assert made["sphere refine=5"].case.details["refinement"]["steps"] > 0
    records = [r for r in measure(tmp_path, names, [closed, GRID]) if r.model == "closed"]
    measured = Measured(records, Work(tmp_path).surface)
    assert [table.text for table in tables(measured) if "onto the sphere" in table.title]
    assert cdcp_igl.check(*measured.surface("closed")).is_disk


def test_the_largest_part_is_taken_with_its_holes_filled(tmp_path):
    V, F = meshes.grid(9, 9)
    middle = np.flatnonzero((F == 40).any(axis=1))
    holed = np.delete(F, middle, axis=0)
    small_V, small_F = meshes.grid(3, 3)
    both = np.vstack([small_V, V + 10]), np.vstack([small_F, holed + len(small_V)])
    mesh, _, disk = as_disk(Model("both", lambda: both), Work(tmp_path))
    assert mesh.endswith(OPENED)
    assert len(holed) < len(disk) <= len(F)


def test_a_map_is_that_of_its_mesh_and_of_its_model(tmp_path):
    wide, long = (meshes.grid(9, 6), meshes.grid(6, 9))
    for name, surface in (("a_b", wide), ("a_b", long), ("a b", long)):
        measure(tmp_path, ["harmonic"], [Model(name, lambda given=surface: given)])
    work = Work(tmp_path)
    before, _, other = work.records()
    again = Measured([before, other], work.surface, work.map)  # the first mesh is back
    for name, surface in (("a_b", wide), ("a b", long)):
        np.testing.assert_array_equal(again.map(name, "harmonic"), harmonic(*surface))
    later = replace(before, section="speed", mesh="changed")  # the surface is that of the maps
    measured = Measured([before, later], work.surface)
    np.testing.assert_array_equal(measured.surface("a_b")[0], wide[0])
    work.surface_path(before.mesh).unlink()
    with pytest.raises(NotMeasured, match="not in the work folder any more"):
        measured.surface("a_b")


@pytest.mark.slow
def test_the_commands_of_the_readme_change_nothing_that_git_tracks(tmp_path):
    """In a clean clone, each in a process of its own."""
    if not (ROOT / ".git").exists():
        pytest.skip("not a clone")
    clone = tmp_path / "clone"
    subprocess.run(["git", "clone", "--quiet", ROOT, clone], check=True)
    (clone / "scans").mkdir()
    V, F = GRID.load()
    igl.writeOBJ(str(clone / "scans" / "scan.obj"), V, F)
    text = (clone / "README.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```sh\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    (block,) = (block for block in blocks if "python -m benchmarks" in block)
    environment = {k: v for k, v in os.environ.items() if k != "CDCP_IGL_DATA"}
    environment |= {
        "PYTHONPATH": str(clone),
        "PATH": f"{Path(sys.executable).parent}:/usr/bin:/bin",
    }
    quick, _ = (
        subprocess.run(
            command, shell=True, cwd=clone, env=environment, capture_output=True, timeout=600
        )
        for command in block.splitlines()
    )
    for method in (" CDCP ", " FDCP ", " LSCM, free boundary "):
        assert quick.stdout.decode().count(method) == 8, quick.stderr.decode()
    tracked = ["git", "status", "--porcelain", "--untracked-files=no"]
    assert subprocess.check_output(tracked, cwd=clone) == b""
    (results,) = (clone / "mine").glob("*.json")
    assert {made.case.outcome for made in read_results(results)[1]} == {"ok"}
    page = results.with_suffix(".md").read_text()
    assert "Again: `python -m benchmarks tables --models 'scans/*.obj' --methods" in page
    assert f"threads: {LIMITS.threads}" in page
