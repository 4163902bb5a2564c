"""The benchmark harness: every row is there, whatever becomes of the cases."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import failing_methods
import meshes
import numpy as np
import pytest
from benchmark_commands import ROOT, benchmarks, refused

from benchmarks.commands import GROWTH_METHODS
from benchmarks.measure import models
from benchmarks.measure.ablation import ABLATIONS
from benchmarks.measure.candidate import Candidate
from benchmarks.measure.cases import Limits, run
from benchmarks.measure.machine import describe
from benchmarks.measure.methods import METHODS, TABLE
from benchmarks.measure.models import Model
from benchmarks.records.paper import PAPER
from benchmarks.records.record import EDGES, Record
from benchmarks.records.results import Measured
from benchmarks.records.store import Work, read_results, write_results
from benchmarks.write import front_page, sections
from benchmarks.write.report import as_markdown
from cdcp_igl.reference.case import OK, Case

V, F = meshes.grid(8, 9)
GRID = Model("grid", lambda: (V, F))
LIMITS = Limits(60, 4000)


def keep(work, record):
    with work.journal() as journal:
        journal.append(record)


def measure(tmp_path, names, table=METHODS, where=TABLE, model=GRID, **options):
    work = Work(tmp_path)
    chosen = {name: Candidate(table[name].function, table[name].boundary, "") for name in names}
    run("tables", [model], chosen, table=where, work=work, **{"limits": LIMITS, **options})
    return work


def failing(tmp_path, name, **options):
    where = "failing_methods:METHODS"
    work = measure(tmp_path, [name], failing_methods.METHODS, where, **options)
    (made,) = work.records()
    assert work.map(made) is None
    assert made.histogram == []
    return made.case


MACHINE = describe(1) | {"time_limit": 60, "memory_limit": 4000, "commands": {"tables": "again"}}


def page(work):
    return as_markdown(MACHINE, Measured(work.records()))


def record(model, method, outcome="ok", section="tables", sizes=(100, 180, 18), **numbers):
    return Record(section, model, "d", *sizes, 0, Case(method, "disk", outcome, **numbers))


def test_what_a_record_says_is_what_the_map_is(tmp_path):
    import cdcp_igl

    work = measure(tmp_path, ["cdcp", "factor"])
    made, factor = work.records()
    uv = work.map(made)
    np.testing.assert_array_equal(uv, cdcp_igl.cdcp(V, F))
    degrees = cdcp_igl.angle_distortion(V, F, uv)
    assert made.case.mean == pytest.approx(degrees.mean())
    assert (made.vertices, made.faces, made.boundary_vertices) == (len(V), len(F), 30)
    assert made.histogram == np.histogram(degrees, [*EDGES, np.inf])[0].tolist()
    assert set(made.case.details["seconds"]) >= {"factor", "trace", "circle", "mobius"}
    assert set(factor.case.details["seconds"]) == {"analyse", "factor"}
    assert factor.case.boundary == "none"
    assert np.isnan(factor.case.mean)


def test_records_survive_json(tmp_path):
    made = record("m", "cdcp", mean=1.25)
    row = json.loads(json.dumps(made.as_json(), allow_nan=False))
    assert (row["sd"], row["mean"], row["method"]) == (None, 1.25, "cdcp")
    again = Record.of_json(row)
    assert again.case.mean == 1.25
    assert np.isnan(again.case.sd)
    write_results(tmp_path / "new" / "r.json", {"cpu": "this"}, [made, made])
    machine, records = read_results(tmp_path / "new" / "r.json")
    assert (machine, len(records)) == ({"cpu": "this"}, 2)


@pytest.mark.parametrize(
    ("name", "outcome"),
    [
        ("kills itself", "crashed: SIGSEGV"),
        ("raises", "failed: KeyError: 'what'"),
        ("not finite", "not valid: not finite"),
        ("free, not finite", "not valid: not finite"),
        ("flipped", "not valid: "),
        ("nothing", "failed: must return (n, 2) numbers, and returned NoneType"),
    ],
)
def test_a_failure_is_a_row_without_numbers(tmp_path, name, outcome):
    case = failing(tmp_path, name)
    assert case.outcome.startswith(outcome)
    numbers = [case.mean, case.sd, case.max, case.area, case.flips, case.seconds]
    assert np.isnan(numbers).all()


def test_limits_are_rows(tmp_path):
    assert failing(tmp_path / "t", "hangs", limits=Limits(2, 4000)).outcome == (
        "no result within 2 s"
    )
    assert failing(tmp_path / "m", "hog", limits=Limits(60, 400)).outcome == (
        "more than 400 MiB of memory"
    )


def test_a_failure_is_told_below_the_table(tmp_path):
    work = measure(tmp_path, ["fdcp", "ldcp", "cdcp", "factor"])
    lost = record("grid", "fdcp", "crashed: SIGSEGV", sizes=(72, 112, 30))
    keep(work, lost)  # the latest counts
    text = page(work)
    assert "| grid | 72 | no map [1] |" in text
    assert "[1] crashed: SIGSEGV" in text
    assert "All three are valid on 0 surfaces" in text
    assert "Not compared, because one is missing or failed: grid." in text


def test_the_comparison_names_where_cdcp_is_worse(tmp_path):
    work = Work(tmp_path)
    for model, means in (("good", (1.0, 1.0, 1.0049)), ("bad", (1.0, 2.0, 1.0051))):
        for method, mean in zip(("fdcp", "ldcp", "cdcp"), means, strict=True):
            keep(work, record(model, method, mean=mean, sd=1.0))
    text = page(work)
    assert "valid on 2 surfaces" in text
    assert "bad: 1.0051 against 1.0000 of FDCP." in text


def test_a_model_that_is_not_to_be_had_is_a_row(tmp_path, monkeypatch):
    monkeypatch.delenv("CDCP_IGL_DATA", raising=False)
    (missing,) = models.by_name(["no_such_model"])
    chosen = {name: METHODS[name] for name in ("cdcp", "fdcp")}
    work = Work(tmp_path)
    records = run("tables", [missing], chosen, table=TABLE, limits=LIMITS, work=work)
    outcomes = [record.case.outcome for record in records]
    assert outcomes == ["not to be had: no mesh of this name"] * 2
    assert "| no such model | – | – [1] | – [1] |" in as_markdown(MACHINE, Measured(records))
    assert work.records() == []  # it may be there the next time


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
    other = tmp_path / "other"
    other.mkdir()
    np.savez(other / "fox.npz", V=V, F=F)
    for text in (str(other / "fox.npz"), str(other / "*.npz")):
        (fox,) = models.find([text])
        assert fox.name == "fox"
        np.testing.assert_array_equal(fox.load()[1], F)


def test_a_name_that_matches_nothing_is_an_error(tmp_path):
    with pytest.raises(ValueError, match="'no_such' is neither the name of a surface nor a file"):
        models.find(["ellipse_20", "no_such"])
    told = refused("tables", "--models", "no_such/*.obj", "--work", tmp_path)
    assert "neither the name of a surface nor a file" in told
    assert list(tmp_path.iterdir()) == []


def test_two_files_of_one_name_are_told_apart(tmp_path):
    for name in ("left", "right"):
        (tmp_path / name).mkdir()
        np.savez(tmp_path / name / "ear.npz", V=V, F=F)
    found = models.find([f"{tmp_path}/*/ear.npz"])
    assert [Path(model.name).parent.name for model in found] == ["left", "right"]


def test_a_changed_mesh_is_measured_again(tmp_path):
    work = measure(tmp_path, ["cdcp"])
    measure(tmp_path, ["cdcp"])
    assert len(work.records()) == 1
    measure(tmp_path, ["cdcp"], model=Model("grid", lambda: (2 * V, F)))
    assert len(work.records()) == 2


def test_methods_take_turns(tmp_path):
    work = measure(tmp_path, ["harmonic", "lscm"], repeats=lambda method, n: 2)
    assert [(r.case.method, r.repeat) for r in work.records()] == [
        *(("harmonic", 0), ("lscm", 0), ("harmonic", 1), ("lscm", 1)),
    ]


def test_a_killed_run_goes_on_where_it_stopped(tmp_path):
    code = (
        "import sys; from pathlib import Path; from test_benchmarks import measure;"
        "measure(Path(sys.argv[1]), ['harmonic', 'lscm', 'cdcp', 'factor', 'ldcp'])"
    )
    path = os.pathsep.join([str(ROOT), str(ROOT / "tests")])
    process = subprocess.Popen(
        [sys.executable, "-c", code, str(tmp_path)],
        **{"env": os.environ | {"PYTHONPATH": path}, "stderr": subprocess.DEVNULL},
    )
    try:
        end = time.monotonic() + 120
        while len(Work(tmp_path).records()) < 2:
            assert time.monotonic() < end
            assert process.poll() is None
            time.sleep(0.01)
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
    before = (tmp_path / "results.jsonl").read_bytes()
    kept = before[: before.rfind(b"\n") + 1]
    assert 2 <= kept.count(b"\n") < 5
    with (tmp_path / "results.jsonl").open("ab") as file:
        file.write(b'{"section": "tab')  # as if killed while writing
    work = measure(tmp_path, ["harmonic", "lscm", "cdcp", "factor", "ldcp"])
    assert (tmp_path / "results.jsonl").read_bytes().startswith(kept)
    assert [r.case.method for r in work.records()] == ["harmonic", "lscm", "cdcp", "factor", "ldcp"]


def test_every_ablation_gives_a_map():
    for name, method in ABLATIONS.items():
        assert method.function(V, F).shape == (len(V), 2), name


def test_speed_and_ablation_pages(tmp_path):
    arguments = (
        *("--quick", "--out", tmp_path, "--work", tmp_path / "w", "--machine", "here"),
        *("--models", "ellipse_20"),
    )
    variants = "default,without Möbius"
    for command in (("speed", "--repeats", "2"), ("ablation", "--methods", variants)):
        done = benchmarks(*command, *arguments)
        assert done.returncode == 0, done.stderr
    text = (tmp_path / "here.md").read_text()
    assert "| default | 1.00 |" in text
    assert "| `cdcp` on ellipse_20 |" not in text  # with --models, only those
    assert "## Ablation" in text
    commands = read_results(tmp_path / "here.json")[0]["commands"]
    assert commands["speed"].startswith("python -m benchmarks speed --repeats 2 --quick --out")
    assert list(commands) == ["speed", "ablation"]


def test_growth_is_measured_on_one_surface_in_several_sizes(tmp_path):
    small, large = models.subdivided(1)
    assert (small.name, large.name) == ("terrain x 1", "terrain x 4")
    V, F = small.load()
    assert len(large.load()[1]) == 4 * len(F)
    np.testing.assert_array_equal(large.load()[0][: len(V)], V)  # the shape stays
    methods = {name: METHODS[name] for name in GROWTH_METHODS}
    options = {"table": TABLE, "limits": LIMITS, "work": Work(tmp_path)}
    measured = Measured(run("growth", [small, large], methods, **options))
    assert all(record.ok for record in measured.sections["growth"].records)
    assert measured.sizes == {}  # no surface of the other tables


def test_a_surface_of_which_no_map_was_measured_has_no_row():
    records = [
        Record("speed", model, "", n, 2 * n, 10, 0, Case(method, METHODS[method].boundary, OK))
        for model, n, method in (("small", 99, "cdcp warm"), ("large", 999, "cdcp"))
    ]
    table = sections.cases(Measured(records).sections["speed"])
    assert [row[0].text for row in table.rows] == ["large"]


def test_the_exponents_of_growth_are_in_the_table():
    records = [
        Record(
            *("growth", f"terrain x {n}", "", n, 2 * n, 10, 0),
            Case(method, METHODS[method].boundary, OK, seconds=1e-6 * n**1.05, memory=1e-3 * n),
        )
        for n in (20_000, 80_000, 320_000)
        for method in GROWTH_METHODS
    ]
    text = as_markdown(MACHINE, Measured(records))
    assert "| exponent of n | from 17,000 | 1.05 | 1.05 | 1.00 | 1.00 |" in text
    assert "Time of CDCP grows like n^1.05, its peak memory like n^1.00." in text


def test_rows_of_earlier_calls_do_not_linger(tmp_path):
    for name in ("cat", "dog"):
        np.savez(tmp_path / f"{name}.npz", V=V, F=F)
    shipped = ["git", "status", "--porcelain", "benchmarks/results", "README.md"]
    before = subprocess.check_output(shipped, cwd=ROOT)
    for name, method in (("cat", "cdcp,factor"), ("dog", "harmonic")):
        done = benchmarks(
            *("tables", "--models", tmp_path / f"{name}.npz", "--methods", method),
            *("--out", tmp_path / "out", "--work", tmp_path / "w", "--machine", "here"),
        )
        assert done.returncode == 0, done.stderr
    machine, records = read_results(tmp_path / "out" / "here.json")
    assert [(r.model, r.case.method) for r in records] == [("dog", "harmonic")]
    assert "--methods harmonic" in machine["commands"]["tables"]
    assert "cat" not in (tmp_path / "out" / "here.md").read_text()
    assert subprocess.check_output(shipped, cwd=ROOT) == before


def test_unknown_method():
    assert "'magic' is not one of" in refused("tables", "--methods", "magic")


def test_the_table_of_the_readme_is_that_of_the_results(tmp_path):
    seconds = {"factor": 0.25, "cdcp": 0.5, "lscm": 2.0}
    numbers = {"mean": 1.25, "sd": 2.5, "max": 87.0, "flips": 0.0}
    records = [
        record(model, method, section=section, sizes=(99, 160, 36), seconds=time, **numbers)
        for model in front_page.MODELS
        for section, method, time in (
            *(("tables", method, time) for method, time in seconds.items()),
            *(("peers", "cdcp", 1.0), ("peers", "SLIM", 100.0)),
        )
    ]
    records.append(record("chinese_lion", "BFF free", "not to be had: no BFF", section="peers"))
    write_results(tmp_path / "here.json", MACHINE, records)
    readme = tmp_path / "README.md"
    markers = f"before\n{front_page.BEGIN}\noutdated\n{front_page.END}\nafter\n"
    readme.write_text(markers, encoding="utf-8")
    front_page.rewrite(readme, tmp_path / "here.json")
    lines = readme.read_text(encoding="utf-8").splitlines()
    assert (lines[0], lines[-1]) == ("before", "after")
    assert lines[2].startswith("| method | boundary | Chinese Lion 99 | human face 99 |")
    rows = {line.split(" | ")[0]: line for line in lines[4:7]}
    assert rows["| CDCP"].startswith("| CDCP | disk | 1.250 / 2.500 / 87 (1 T) |")
    assert rows["| LSCM"].startswith("| LSCM | free | 1.250 / 2.500 / 87 (4 T) |")
    assert rows["| SLIM"].startswith("| SLIM | free | 1.250 / 2.500 / 87 (100 T) |")
    assert not any("BFF" in line or "outdated" in line for line in lines)


def test_without_results_there_is_no_table_for_the_readme():
    assert "first run: make bench" in refused("readme", "--machine", "nowhere")
