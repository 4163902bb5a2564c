"""The benchmark harness: every row is there, whatever becomes of the cases."""

import re
import shlex
from contextlib import suppress
from dataclasses import replace
from itertools import islice
from pathlib import Path

import igl
import meshes
import numpy as np
import pytest
from benchmark_commands import GRID, LIMITS, MACHINE, ROOT, benchmarks, measure, record, refused

import cdcp_igl
from benchmarks.commands import GROWTH_METHODS
from benchmarks.measure import families, models
from benchmarks.measure.ablation import ABLATIONS, ALL, NONE, RESCUES
from benchmarks.measure.cases import Limits
from benchmarks.measure.methods import METHODS, maps
from benchmarks.measure.models import Model, as_disk
from benchmarks.records.paper import PAPER
from benchmarks.records.record import EDGES, OPENED
from benchmarks.records.results import Measured, NotMeasured
from benchmarks.records.store import Work, read_results, write_results
from benchmarks.write import front_page, sections
from benchmarks.write.report import as_markdown
from benchmarks.write.sections import tables
from cdcp_igl.reference import harmonic
from cdcp_igl.surface.mesh import DiskMesh
from cdcp_igl.verdict.certificate import certify, certify_sphere

V, F = GRID.load()
WITHOUT = "without harmonic measure"


def page(records):
    return as_markdown(MACHINE, Measured(records))


def test_what_a_record_says_is_what_the_map_is(tmp_path):
    made, factor = measure(tmp_path, ["cdcp", "factor"])
    uv = Work(tmp_path).map(made)
    np.testing.assert_array_equal(uv, cdcp_igl.cdcp(V, F))
    degrees = cdcp_igl.angle_distortion(V, F, uv)
    assert made.case.mean == pytest.approx(degrees.mean())
    assert (made.vertices, made.faces, made.boundary_vertices) == (len(V), len(F), 30)
    assert made.histogram == np.histogram(degrees, [*EDGES, np.inf])[0].tolist()
    assert set(made.case.details["seconds"]) >= {"factor", "trace", "circle", "mobius"}
    assert set(factor.case.details["seconds"]) == {"analyse", "factor"}
    assert factor.case.boundary == "none"
    assert np.isnan(factor.case.mean)


@pytest.mark.parametrize("name", maps())
def test_every_method_gives_a_map(name):
    boundary = METHODS[name].boundary
    V, F, _ = cdcp_igl.datasets.spherical_cap(6)  # without ears, which not every method can map
    if boundary == "sphere":
        V, F, _ = cdcp_igl.datasets.spheroid(2)
    made = METHODS[name].function(V, F)
    if boundary == "sphere":
        assert certify_sphere(F, getattr(made, "points", made)).valid
        return
    certificate = certify(DiskMesh(V, F), getattr(made, "uv", made))
    assert certificate.valid if boundary == "disk" else certificate.finite


def test_every_ablation_gives_a_map():
    for name, method in ABLATIONS.items():
        assert method.function(V, F).shape == (len(V), 2), name


def test_a_mechanism_is_left_out_of_one_map_only():
    *_, (length, V, F) = islice(families.FAMILIES["strips"](), 3)
    found = [RESCUES[name].function(V, F) for name in (ALL, WITHOUT, ALL)]
    assert length == "20:1"
    names = [made.boundary.name for made in found]
    assert names == ["harmonic measure", "arc length", "harmonic measure"]
    assert found[0].distortion.mean == found[2].distortion.mean != found[1].distortion.mean


def test_every_mechanism_can_be_left_out_where_it_is_needed():
    for model in islice(models.patches(), 3):
        for method in RESCUES.values():
            with suppress(cdcp_igl.MapError):  # and nothing else
                assert method.function(*model.load()).valid


def test_where_no_boundary_is_left_it_is_said_why():
    *_, (_, V, F) = islice(families.FAMILIES["strips"](), 5)
    with pytest.raises(cdcp_igl.MapError, match="No boundary is left, rejected geodesic: "):
        RESCUES[NONE].function(V, F)


def test_every_family_has_disks(monkeypatch):
    monkeypatch.delenv("CDCP_IGL_DATA", raising=False)
    found = families.disks(list(families.FAMILIES), 2, 1_000)
    names = [families.family_of(model.name) for model in found]
    # The others are large, or not at hand.
    assert names == ["fuzzed", "fuzzed", "strips", "parts", "parts"]
    assert families.family_of("chinese_lion") == "given"
    assert all(cdcp_igl.check(*model.load()).is_disk for model in found)


# -- what is measured ------------------------------------------------------------------


def test_a_model_that_is_not_to_be_had_is_a_row(tmp_path, monkeypatch):
    monkeypatch.delenv("CDCP_IGL_DATA", raising=False)
    records = measure(tmp_path, ["cdcp", "fdcp"], models.by_name(["no_such_model"]))
    outcomes = [record.case.outcome for record in records]
    assert outcomes == ["not to be had: no mesh of this name"] * 2
    assert "| no such model | – | – [1] | – [1] |" in page(records)
    assert Work(tmp_path).records() == []  # it may be there the next time


def test_every_model_of_the_paper_has_a_row(monkeypatch, tmp_path):
    monkeypatch.setenv("CDCP_IGL_DATA", str(tmp_path))
    names = [model.name for model in models.find()]
    assert [row.model or row.name for row in PAPER] == names[: len(PAPER)]
    assert sum(row.own == "own" for row in PAPER) == 3


def test_models_by_name_path_and_pattern(tmp_path, monkeypatch):
    monkeypatch.setenv("CDCP_IGL_DATA", str(tmp_path))
    for name in ("cat", "cow", "dog"):
        np.savez(tmp_path / f"{name}.npz", V=V, F=F)
    assert {"cat", "cow", "dog"} <= {model.name for model in models.find()}
    assert [model.name for model in models.find(["c?[tw]", "cat"])] == ["cat", "cow"]
    for folder in ("left", "right"):
        (tmp_path / folder).mkdir()
        np.savez(tmp_path / folder / "fox.npz", V=V, F=F)
    for text in (str(tmp_path / "left" / "fox.npz"), str(tmp_path / "left" / "*.npz")):
        (fox,) = models.find([text])
        assert fox.name == "fox"
        np.testing.assert_array_equal(fox.load()[1], F)
    both = models.find([f"{tmp_path}/*/fox.npz"])  # told apart by their folders
    assert [Path(model.name).parent.name for model in both] == ["left", "right"]


def test_a_name_that_matches_nothing_is_an_error(tmp_path):
    with pytest.raises(ValueError, match="'no_such' is neither the name of a surface nor a file"):
        models.find(["ellipse_20", "no_such"])
    told = refused("tables", "--models", "no_such/*.obj", "--work", tmp_path)
    assert "neither the name of a surface nor a file" in told
    assert list(tmp_path.iterdir()) == []
    assert "no method 'magic'" in refused("tables", "--methods", "magic")


def test_a_run_goes_on_where_it_stopped_and_methods_take_turns(tmp_path):
    measure(tmp_path, ["harmonic"])
    (kept,) = (path.read_bytes() for path in tmp_path.glob("results.jsonl"))
    assert kept.count(b"\n") == 1
    with (tmp_path / "results.jsonl").open("ab") as file:
        file.write(b'{"section": "tab')  # as if killed while writing
    turns = measure(tmp_path, ["harmonic", "factor"], repeats=lambda method, n: 2)
    assert [(made.case.method, made.repeat) for made in turns] == [
        *(("harmonic", 0), ("factor", 0), ("harmonic", 1), ("factor", 1)),
    ]
    assert (tmp_path / "results.jsonl").read_bytes().startswith(kept)
    assert [repr(kept) for kept in Work(tmp_path).records()] == [repr(made) for made in turns]
    measure(tmp_path, ["harmonic"], [Model("grid", lambda: (2 * V, F))])
    assert len(Work(tmp_path).records()) == len(turns) + 1  # the mesh has changed


def test_a_sequence_is_measured_beside_single_maps():
    made = METHODS["cdcp sequence"].function(*meshes.grid(20, 30))
    moved, afresh = made.seconds, made.phases["afresh"]
    assert min(moved, afresh) > 0
    details = {"seconds": {"afresh": afresh}}
    of_speed = record("grid", "cdcp sequence", "speed", seconds=moved, details=details)
    tables = sections.tables(Measured([of_speed]))
    (row,) = next(table.rows for table in tables if table.id == "sequences")
    assert row[0].text == "grid"
    assert [cell.value for cell in row[2:]] == pytest.approx(
        [afresh, moved, moved / afresh, 1 / moved]
    )


# -- commands --------------------------------------------------------------------------


def test_each_command_writes_a_section_of_the_same_results(tmp_path, cases_in_this_process):
    shared = ("--out", tmp_path, "--work", tmp_path / "w", "--machine", "here")
    shared = (*shared, "--models", "ellipse_20")
    for command in (
        ("speed", "--repeats", "2", "--methods", "cdcp,factor"),
        ("ablation", "--methods", "default"),
    ):
        done = benchmarks(*command, *shared)
        assert done.exit_code == 0, done.output
    text = (tmp_path / "here.md").read_text()
    assert "| default | " in text
    assert "| `cdcp` on ellipse_20 |" not in text  # with --models, only those
    assert "## Ablation" in text
    commands = read_results(tmp_path / "here.json")[0]["commands"]
    assert commands["speed"].startswith("python -m benchmarks speed --repeats 2 --methods")
    assert list(commands) == ["speed", "ablation"]
    rescue = ("ablation", "--methods", f"{ALL},{WITHOUT}", "--families", "strips", "--count", 1)
    done = benchmarks(*rescue, *shared[:-2])
    assert done.exit_code == 0, done.output
    assert "strips, 1" in done.stdout
    assert done.stdout.count("1; 1; 0+0; ") == 2


# -- the report ------------------------------------------------------------------------


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="another commit is needed")
def test_a_commit_in_turn_with_this_code(tmp_path):
    np.savez(tmp_path / "grid.npz", **dict(zip("VF", meshes.grid(8, 9), strict=True)))
    turn = ("speed", "--against", "HEAD", "--models", tmp_path / "grid.npz", "--repeats", "2")
    told = benchmarks(*turn, "--methods", "cdcp refine=1").output
    assert re.search(r"grid cdcp refine=1 *│ all .* to .*│ \d\.\d\d \(", told), told
    assert re.search("│ refine ", told)
    assert "is not cdcp" in refused(*turn, "--methods", "cdcp,lscm")
    assert "not a valid object name" in refused("speed", "--against", "nowhere")


def test_a_failure_is_told_below_the_table():
    records = [record("grid", name, mean=1.0, sd=1.0) for name in ("fdcp", "ldcp", "cdcp")]
    lost = record("grid", "fdcp", outcome="failed: boom | pipe")
    text = page([*records, lost])  # the latest counts
    assert "| grid | 100 | no map [1] |" in text
    assert "[1] failed: boom | pipe" in text
    for table in (part for part in text.split("\n\n") if part.startswith("|")):
        assert len({row.replace(r"\|", "").count("|") for row in table.splitlines()}) == 1, table


def test_the_exponents_of_growth_are_in_the_table():
    records = [
        record(
            *(f"terrain x {n}", method, "growth"),
            **{"n": n, "boundary": METHODS[method].boundary},
            **{"seconds": 1e-6 * n**1.05, "memory": 1e-3 * n},
        )
        for n in (20_000, 80_000, 320_000)
        for method in GROWTH_METHODS
    ]
    text = page(records)
    assert "| exponent of n | from 17,000 | 1.05 | 1.05 | 1.00 | 1.00 |" in text
    assert Measured(records).sizes == {}  # no surface of the other tables


def test_the_table_of_the_readme_is_that_of_the_results(tmp_path):
    numbers = {"mean": 1.25, "n": 99}
    records = [
        record(model, method, "peers", seconds=time, flips=flips, **numbers)
        for model in front_page.SHOWN
        for method, time, flips in (("cdcp", 0.5, 0), ("lscm", 2.0, 0), ("bff", 50.0, 3))
    ]
    records[5] = record("chinese_lion", "bff", "peers", outcome="crashed: of itself", n=99)
    records.append(record("chinese_lion", "abf", "peers", outcome="not to be had: none", n=99))
    write_results(tmp_path / "here.json", MACHINE, records)
    readme = tmp_path / "README.md"
    markers = f"before\n{front_page.BEGIN}\noutdated\n{front_page.END}\nafter\n"
    readme.write_text(markers, encoding="utf-8")
    front_page.rewrite(readme, tmp_path / "here.json")
    lines = readme.read_text(encoding="utf-8").splitlines()
    assert (lines[0], lines[-1]) == ("before", "after")
    assert lines[2] == "| method | mean ° | flips | time |"
    rows = {line.split(" | ")[0]: line.split(" | ")[1:] for line in lines[4:]}
    assert rows["| CDCP"] == ["1.25 (1.25–1.25)", "0", "1 × |"]
    assert rows["| LSCM"] == ["1.25 (1.25–1.25)", "0", "4 × |"]
    assert rows["| BFF"] == ["1.25 (1.25–1.25), no map of 1", "12", "100 × |"]
    assert not any("outdated" in line for line in lines)
    assert "first run: make bench" in refused("readme", "--machine", "nowhere")


# -- many surfaces: side by side, in parts, any of them --------------------------------


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
    assert "python -m benchmarks tables" in refused("figures", "--out", tmp_path)
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


def test_the_commands_of_the_readme(tmp_path, monkeypatch, cases_in_this_process):
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"^```sh\n(python -m benchmarks .*?)^```", text, re.MULTILINE | re.DOTALL)
    (tmp_path / "scans").mkdir()
    igl.writeOBJ(str(tmp_path / "scans" / "scan.obj"), *GRID.load())
    monkeypatch.chdir(tmp_path)
    typed = (shlex.split(line, comments=True)[3:] for line in block.splitlines())
    quick, own = (benchmarks(*arguments, "--work", tmp_path / "w") for arguments in typed)
    for method in (" CDCP ", " FDCP ", " LSCM, free boundary "):
        assert quick.stdout.count(method) == 8, quick.output
    assert own.exit_code == 0
    (results,) = (tmp_path / "mine").glob("*.json")
    assert {made.case.outcome for made in read_results(results)[1]} == {"ok"}
    page = results.with_suffix(".md").read_text()
    assert "Again: `python -m benchmarks tables --models 'scans/*.obj' --methods" in page
    assert f"threads: {LIMITS.threads}" in page
