"""The benchmark harness: every row is there, whatever becomes of the cases."""

from contextlib import suppress
from itertools import islice
from pathlib import Path

import meshes
import numpy as np
import pytest
from benchmark_commands import GRID, MACHINE, benchmarks, measure, record, refused

import cdcp_igl
from benchmarks.commands import GROWTH_METHODS
from benchmarks.measure import families, models
from benchmarks.measure.ablation import ABLATIONS
from benchmarks.measure.mechanisms import ALL, NONE, RESCUES
from benchmarks.measure.methods import METHODS, maps
from benchmarks.measure.models import Model
from benchmarks.records.paper import PAPER
from benchmarks.records.record import EDGES
from benchmarks.records.results import Measured
from benchmarks.records.store import Work, read_results, write_results
from benchmarks.write import front_page, sections
from benchmarks.write.report import as_markdown
from cdcp_igl.certificate import certify, certify_sphere
from cdcp_igl.surface.mesh import DiskMesh

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
    means = [RESCUES[name].function(V, F).distortion.mean for name in (ALL, WITHOUT, ALL)]
    assert length == "20:1"
    assert means[1] > 2 * means[0] == 2 * means[2]


def test_every_mechanism_can_be_left_out_where_it_is_needed():
    for model in islice(models.patches(), 3):
        for name, method in RESCUES.items():
            with suppress(cdcp_igl.MapError):  # and nothing else
                if name != NONE:
                    assert method.function(*model.load()).valid


def test_every_family_has_disks(monkeypatch):
    monkeypatch.delenv("CDCP_IGL_DATA", raising=False)
    found = families.disks(list(families.FAMILIES), 2, 1_000)
    names = [families.family_of(model.name) for model in found]
    assert names == ["fuzzed", "fuzzed", "strips"]  # the others are large, or not at hand
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


def test_a_changed_mesh_is_measured_again(tmp_path):
    measure(tmp_path, ["harmonic"])
    measure(tmp_path, ["harmonic"], [Model("grid", lambda: (2 * V, F))])
    assert len(Work(tmp_path).records()) == 2


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


def test_each_command_writes_a_section_of_the_same_results(tmp_path):
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
    assert lines[2].startswith("| method | human face | Chinese Lion | Human Brain | left hand |")
    rows = {line.split(" | ")[0]: line.split(" | ")[1:] for line in lines[4:]}
    assert rows["| CDCP"] == [*["1.25"] * 5, "0", "1 × |"]
    assert rows["| LSCM"] == [*["1.25"] * 5, "0", "4 × |"]
    assert rows["| BFF"] == ["1.25", "no map", *["1.25"] * 3, "12", "100 × |"]
    assert not any("outdated" in line for line in lines)
    assert "first run: make bench" in refused("readme", "--machine", "nowhere")
