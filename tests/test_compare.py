"""Cases in processes of their own, and the table of them."""

import csv
import functools
import json
from pathlib import Path

import matplotlib
import meshes
import numpy as np
import pytest
from commands import invoke
from failing_methods import METHODS as FAILING
from surfaces import torus

import cdcp_igl
from cdcp_igl.reference import METHODS, Method
from cdcp_igl.reference.case import Case, measure, run_case

V, F = meshes.grid(8, 9)
MUST = "failed: must return (n, 2) numbers, and returned "
NO_MAP = ("--methods", "lscm", "--time-limit", 0)  # a row is all that is needed


@pytest.fixture
def mesh(tmp_path):
    path = tmp_path / "Gitter ä.npz"
    np.savez(path, V=V, F=F)
    return path


# -- cases -----------------------------------------------------------------------------


def test_a_case_is_what_the_library_says():
    hoard = np.ones(1 << 26)  # 512 MiB of the caller, which do not count
    case, uv = run_case("cdcp", V, F, time_limit=60, memory_limit=400)
    result = cdcp_igl.disk_map(V, F)
    np.testing.assert_array_equal(uv, result.uv)
    assert case.outcome == "ok"
    assert (case.mean, case.sd, case.max) == pytest.approx(
        (result.distortion.mean, result.distortion.sd, result.distortion.max)
    )
    assert case.flips == 0
    assert case.boundary_error < 1e-12
    areas = cdcp_igl.area_distortion(V, F, uv)
    assert case.area_sd == pytest.approx(areas.std())
    assert 1 < case.texels < np.exp(np.ptp(areas) / 2)
    assert case.seconds > 0
    assert 20 < case.memory < 400 < hoard.nbytes / 2**20


@pytest.mark.parametrize(
    ("method", "limits", "outcome"),
    [
        ("phases", {"time_limit": 0.01}, "no result within 0.01 s"),
        ("hog", {"time_limit": 60, "memory_limit": 400}, "more than 400 MiB of memory"),
        ("kills itself", {"time_limit": 60}, "crashed: SIGSEGV"),
    ],
)
def test_how_a_process_can_end(method, limits, outcome):
    case, uv = run_case(method, V, F, **limits, table="failing_methods:METHODS")
    assert (case.outcome, uv) == (outcome, None)
    assert np.isnan([case.mean, case.sd, case.max, case.area_sd, case.flips, case.seconds]).all()


@pytest.mark.parametrize(
    ("method", "outcome"),
    [
        ("raises two lines", "failed: RuntimeError: boom | pipe"),
        ("nothing", f"{MUST}NoneType"),
        ("list", f"{MUST}list"),
        ("complex", f"{MUST}complex128 of shape ({len(V)},)"),
        ("too short", f"{MUST}float64 of shape ({len(V) - 1}, 2)"),
        ("not finite", "not valid: not finite"),
        ("flipped", f"not valid: {len(F)} flipped faces"),
        ("free, not finite", "not valid: not finite"),
    ],
)
def test_a_failure_is_an_outcome(method, outcome):
    measured, uv = measure(FAILING[method], V, F)
    assert measured["outcome"].startswith(outcome)
    assert (list(measured), uv) == (["outcome"], None)


def test_an_error_of_the_library_is_named_by_its_type():
    measured, _ = measure(METHODS["fdcp"], V * [1, 1, 1e8], F)
    assert measured["outcome"].startswith("MapError: The map is not a bijection")


def test_a_method_that_changes_the_surface_is_judged_by_the_one_it_was_given():
    changed, uv = measure(FAILING["flattens the surface"], V, F)
    expected = cdcp_igl.angle_distortion(V, F, uv).mean()
    assert changed["mean"] == pytest.approx(expected)
    assert expected > 1


def test_phases_of_a_disk_map_and_of_a_clock():
    measured, uv = measure(FAILING["phases"], V, F)
    assert measured["details"]["valid"]
    assert uv.shape == (len(V), 2)
    assert 0 < sum(measured["details"]["seconds"].values()) < measured["seconds"]
    measured, uv = measure(FAILING["clock"], V, F)
    assert (measured["outcome"], measured["seconds"], uv) == ("ok", 42, None)
    assert measured["details"]["seconds"] == {"half": 21}


def test_json_has_no_nan():
    row = Case("lscm", "free", "crashed").as_json()
    assert row["mean"] is None
    assert json.loads(json.dumps(row, allow_nan=False)) == row


# -- in Python -------------------------------------------------------------------------


def shadow(V, F):
    return V[:, :2]


def breaks(V, F):
    raise RuntimeError("<boom>")


def test_functions_of_ones_own_beside_methods_of_the_table():
    V, F, exact = cdcp_igl.datasets.spherical_cap(6, angle=60)
    exactly = Method(lambda V, F: exact, "disk", "")
    methods = {"own": shadow, "free": cdcp_igl.free_map, "exact": exactly, "no": breaks}
    compared = cdcp_igl.compare((V, F), methods | {"ours": "cdcp"})
    onto = {name: case.boundary for name, case in compared.cases.items()}
    assert onto == {"own": "free", "free": "free", "exact": "disk", "no": "free", "ours": "disk"}
    np.testing.assert_array_equal(compared.maps["ours"], cdcp_igl.cdcp(V, F))
    np.testing.assert_array_equal(compared.maps["own"], shadow(V, F))
    assert "no" not in compared.maps
    title, headings, *rows, why = str(compared).splitlines()
    assert title == f"{len(V)} vertices"
    assert headings.split()[:2] == ["method", "onto"]
    assert [row.split()[0] for row in rows] == list(compared.cases)
    own, failed = rows[0].split(), rows[3].split()
    assert own[-3] == "yes"
    assert own[2] == f"{cdcp_igl.angle_distortion(V, F, shadow(V, F)).mean():.3f}"
    assert failed == ["no", "free", *"–" * 5, "no", "map", *"––"]
    assert why == "no: failed: RuntimeError: <boom>"
    assert "&lt;boom&gt;" in compared._repr_html_()
    assert json.loads(json.dumps(compared.to_dict(), allow_nan=False))["no"]["mean"] is None


def test_what_flips_or_overlaps_is_said():
    V, F, _ = cdcp_igl.datasets.square(12)
    x, y = ((V[:, :2] - V[:, :2].min(axis=0)) / np.ptp(V[:, :2], axis=0)).T
    folded = np.column_stack([abs(x - 0.5), y])
    theta = 3 * np.pi * x  # around more than once
    wound = (2 + y)[:, None] * np.column_stack([np.cos(theta), np.sin(theta)])
    compared = cdcp_igl.compare(V, F, {"folded": lambda *_: folded, "wound": lambda *_: wound})
    assert compared.cases["folded"].flips > 0
    assert compared.cases["folded"].verdict.endswith("flips")
    assert (compared.cases["wound"].flips, compared.cases["wound"].verdict) == (0, "overlaps")


@pytest.mark.parametrize(
    ("methods", "message"),
    [
        (["cdpc"], "'cdpc' is not one of cdcp, "),
        ({"own": 3}, "3 is not one of"),
        ([shadow, shadow], "two methods are called 'shadow'"),
        ([functools.partial(shadow)], "has no name: pass a mapping"),
    ],
)
def test_what_cannot_be_compared(methods, message):
    with pytest.raises(ValueError, match=message):
        cdcp_igl.compare(V, F, methods)


def test_a_comparison_draws_and_shows_itself(tmp_path):
    V, F, _ = cdcp_igl.datasets.spherical_cap(6)
    names = [f"way {k}" for k in range(6)]
    compared = cdcp_igl.compare(V, F, dict.fromkeys(names, shadow))
    axes = compared.plot("cap")
    assert [a.get_title().split("  ")[0] for a in axes[1:]] == names
    assert len({a.get_subplotspec().rowspan.start for a in axes}) == 2  # rows of five panels
    page = compared.view(tmp_path / "maps.html").read_text()
    assert all(f'"{name}"' in page for name in names)


# -- the command -----------------------------------------------------------------------


def test_every_row_is_there(tmp_path, mesh, cases_in_this_process):
    V, F, _ = cdcp_igl.datasets.spherical_cap(6)  # without ears, which not every method can map
    np.savez(mesh, V=V, F=F)
    name = mesh.name
    files = [tmp_path / file for file in ("r.json", "r.csv", "p.svg", "v.html")]
    options = zip(("--json", "--csv", "--picture", "--view"), files, strict=True)
    with matplotlib.rc_context({"svg.fonttype": "none", "figure.dpi": 30}):  # text stays text
        done = invoke("compare", mesh, *(word for option in options for word in option))
    assert (done.exit_code, done.stderr) == (0, "")
    # A long path is broken at the edge of the screen, wherever that is.
    assert f"{name}: {len(V)} vertices".replace(" ", "") in "".join(done.stdout.split())
    plane = [name for name, method in METHODS.items() if method.boundary != "sphere"]
    for method in plane:
        assert method in done.stdout
    onto = [line.split()[1] for line in done.stdout.splitlines()[2:]]
    assert onto == [METHODS[method].boundary for method in plane]
    rows = json.loads(files[0].read_text())
    assert [row["method"] for row in rows] == plane
    assert {row["outcome"] for row in rows} == {"ok"}
    assert rows[0]["mesh"].endswith(name)
    with files[1].open(newline="") as file:
        table = list(csv.DictReader(file))
    assert [row["method"] for row in table] == plane
    assert table[0]["mesh"].endswith(name)
    assert name in files[2].read_text()
    page = files[3].read_text()
    assert all(f'"{method}"' in page for method in plane if method != "cdcp")
    assert invoke("compare", mesh, "b.obj", "--view", files[3]).exit_code == 2  # for one mesh


def test_closed_surfaces_are_mapped_onto_the_sphere_and_cut_open(
    tmp_path, mesh, cases_in_this_process
):
    V, F, _ = cdcp_igl.datasets.spheroid(2)
    np.savez(tmp_path / "egg.npz", V=V, F=F)
    np.savez(tmp_path / "ring.npz", V=torus()[0], F=torus()[1])
    files = [tmp_path / "r.json", tmp_path / "p.png"]
    methods = ("--methods", "sphere,flash,lscm", "--json", files[0], "--picture", files[1])
    for names, image in (("sphere", "Sphere"), ("sphere,lscm", "LSCM")):
        page = tmp_path / f"{names}.html"
        arguments = ("--methods", names, "--view", page)
        assert invoke("compare", tmp_path / "egg.npz", *arguments).exit_code == 0
        assert image.lower() in page.read_text().lower()
        assert ' NOT VALID"' not in page.read_text()  # each map is shown on what it maps
    done = invoke("compare", tmp_path / "egg.npz", tmp_path / "ring.npz", mesh, *methods)
    assert done.exit_code == 4
    assert "genus 1" in done.stderr
    assert "cut open for maps to the plane" in " ".join(done.stdout.split())
    of_lscm, sphere, flash, *others = json.loads(files[0].read_text())
    assert (of_lscm["method"], of_lscm["outcome"]) == ("lscm", "ok")
    result = cdcp_igl.sphere_map(V, F)
    assert sphere["mean"] == pytest.approx(result.distortion.mean)
    assert sphere["area_sd"] == pytest.approx(result.area_distortion().std())
    assert flash["boundary"] == "sphere"
    assert max(sphere["boundary_error"], flash["boundary_error"]) < 1e-12
    assert [row["outcome"][:17] for row in others] == [
        "failed: MeshError",
        *["failed: MeshError", "ok"],
    ]


def test_each_mesh_is_compared_once(mesh):
    done = invoke("compare", mesh, mesh, *NO_MAP)
    assert (done.exit_code, done.stderr) == (0, "")
    assert done.stdout.count("lscm: no result within 0 s") == 1


def test_a_bad_mesh_is_named_and_the_others_go_on(tmp_path, mesh):
    np.savez(tmp_path / "hole.npz", V=V, F=F[1:-40])
    files = tmp_path / "hole.npz", tmp_path / "missing.obj", mesh
    report = tmp_path / "r.json"
    done = invoke("compare", *files, *NO_MAP, "--json", report)
    assert done.exit_code == 4
    assert f"{files[0]}: " in done.stderr
    assert f"{files[1]}: No such file" in done.stderr
    assert done.stdout.count("lscm:") == 1
    assert [row["mesh"] for row in json.loads(report.read_text())] == [str(mesh)]
    done = invoke("compare", *files[:2])
    assert (done.exit_code, done.stdout) == (2, "")


def test_what_is_there_is_kept(tmp_path, mesh, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("r.json").write_text("thesis")
    done = invoke("compare", mesh, *NO_MAP, "--json", "r.json")
    assert (done.exit_code, done.stdout) == (2, "")
    assert "r.json is there; --force replaces it." in done.stderr
    assert Path("r.json").read_text() == "thesis"
    assert invoke("compare", mesh, *NO_MAP, "--json", "r.json", "--force").exit_code == 0
    assert Path("r.json").read_text() != "thesis"
