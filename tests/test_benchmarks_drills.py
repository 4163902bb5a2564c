"""The commands fuzz, punctures, surfaces and faults: nothing crashes, hangs or has no type."""

import json
import os
import re
from pathlib import Path

import meshes
import numpy as np
import pytest
import surfaces
from benchmark_commands import benchmarks, refused
from failing_methods import hangs, kills_itself
from hypothesis import given, settings
from hypothesis import strategies as st
from rich.console import Console

import cdcp_igl
from benchmarks.measure import faults, punctures
from benchmarks.measure import fuzzing as fuzz
from benchmarks.measure.any_surface import least_distortion, seams_and_charts
from benchmarks.measure.faults import DRILLS, FAULT, examine
from benchmarks.measure.punctures import Comparison, Row, opened
from benchmarks.measure.worker import kept_answers
from cdcp_igl.surface.mesh import DiskMesh

REFINED = 3  # a case that is refined


@pytest.fixture(autouse=True)
def _generated_surfaces(monkeypatch):
    """The same cases with and without meshes at hand."""
    monkeypatch.delenv("CDCP_IGL_DATA", raising=False)
    fuzz.sources.cache_clear()
    yield
    fuzz.sources.cache_clear()


@settings(max_examples=40)
@given(st.integers(0, 2**31))
def test_certified_map_or_typed_error(seed):
    row = fuzz.examine(seed, fuzz.Row(0))
    assert row.outcome not in fuzz.FAULTS, row
    if row.disk and row.stretch <= 5:
        assert row.outcome.startswith("map"), row


@settings(max_examples=15)
@given(st.integers(0, 2**31), st.sampled_from([1, 1.5, 2]))
def test_refinement_never_raises_the_objective(seed, norm):
    case = fuzz.surface(seed, 0)
    if not cdcp_igl.check(case.V, case.F).is_disk:
        return
    try:
        result = cdcp_igl.disk_map(case.V, case.F, refine=2, refine_norm=norm)
    except (cdcp_igl.MapError, cdcp_igl.SolverError) as error:
        with pytest.raises(type(error)):  # there is no map to refine
            cdcp_igl.disk_map(case.V, case.F)
        return
    account = result.refinement
    assert result.certificate.valid
    if account.steps:
        assert account.after < account.before
    else:
        assert account.stopped == "no improvement"
        np.testing.assert_array_equal(result.uv, cdcp_igl.cdcp(case.V, case.F, refine=0))


@settings(max_examples=60)
@given(st.integers(0, 2**31))
def test_clean_mends_any_damage_but_that_of_the_arrays(seed):
    rng = np.random.default_rng(seed)
    V, F = fuzz._patch(rng, *fuzz._surface("paraboloid"))
    V, F, damage = fuzz._damage(rng, V, F)
    if damage.endswith("index"):
        return
    V, F = cdcp_igl.clean(V, F)[:2]
    report = cdcp_igl.check(V, F)
    assert report.is_disk or damage.endswith("merged"), (damage, report)


def test_cases_are_reproducible():
    one, two = fuzz.surface(3, 14), fuzz.surface(3, 14)
    np.testing.assert_array_equal(one.V, two.V)
    np.testing.assert_array_equal(one.F, two.F)
    assert (one.stretch, one.made) == (two.stretch, two.made)
    assert fuzz.surface(3, 15).made != one.made


@pytest.mark.parametrize(
    ("answer", "seconds", "outcome"), [(hangs, 1, "hang"), (kills_itself, 600, "crash")]
)
def test_what_hangs_or_crashes_is_a_row(tmp_path, answer, seconds, outcome):
    asked = [fuzz.Row(0), fuzz.Row(1)]
    rows = kept_answers(answer, asked, tmp_path, seconds, 2, Console(quiet=True))
    assert [(row.case, row.outcome) for row in rows] == [(0, outcome), (1, outcome)]


def test_a_case_is_refined_in_its_turn():
    row = fuzz.examine(1, fuzz.Row(REFINED))
    assert row.refine > 0
    assert np.isfinite(row.refined)


@pytest.mark.parametrize(
    ("command", "said", "told"),
    [
        (("fuzz", "--cases", 6), "refined maps", ["case 0: "]),
        (
            ("punctures", "closed", "--places", 1),
            "sphere",
            ["sphere less a face", f"{punctures.METHODS[0]} hang"],
        ),
    ],
)
def test_a_killed_run_goes_on_where_it_stopped(tmp_path, monkeypatch, command, said, told):
    monkeypatch.chdir(tmp_path)
    Path("closed").mkdir()
    for name, (V, F) in {"sphere": surfaces.sphere(), "torus": surfaces.torus()}.items():
        np.savez(f"closed/{name}.npz", V=V, F=F)
    whole = benchmarks(*command, "--work", "work")
    assert whole.exit_code == 0, whole.output
    assert said in whole.stdout
    assert "torus" not in whole.stdout  # it has a handle
    (path,) = Path("work").glob("*/results.jsonl")
    lines = path.read_bytes().splitlines(keepends=True)
    assert len(lines) in (6, len(punctures.RINGS) * len(punctures.METHODS))
    lost = lines[0].replace(json.loads(lines[0])["outcome"].encode(), b"hang")
    path.write_bytes(lost + b"".join(lines[1:3]) + lines[3][:9])  # in the middle of a line
    # What is left is examined side by side, with the same outcome.
    again = benchmarks(*command, "--work", "work", "--jobs", 2)
    assert again.exit_code == 1  # for what is lost
    assert all(text in again.stdout for text in told)
    assert path.read_bytes().startswith(lost)
    made = path.read_bytes().splitlines(keepends=True)
    kept, found = ({re.sub(b'"seconds".*', b"", line) for line in some} for some in (lines, made))
    assert len(kept - found) == 1
    assert len(made) == len(lines)  # half a line is gone


# -- punctures -------------------------------------------------------------------------


@pytest.mark.parametrize(("kind", "boundary"), [("face", 3), ("vertex", 6), ("2-ring", 12)])
def test_what_is_taken_out(kind, boundary):
    V, F = surfaces.sphere()  # all its vertices but those at the poles have six neighbours
    W, G = opened(V, F, kind, 80)
    assert len(DiskMesh(W, G).loop) == boundary
    assert len(W) == len(V) - {"face": 0, "vertex": 1, "2-ring": 7}[kind]


def row(method, outcome, mean=np.nan):
    return Row("blob", "digest", "face", 0, 7, method, outcome, mean)


@pytest.mark.parametrize(
    ("ours", "others", "fault", "worse"),
    [
        (("map", 2.0), [("map", 1.9), ("MapError",)], False, False),
        (("map", 2.0), [("map", 1.6), ("map", 2.2)], False, True),
        (("map", 2.0), [("MapError",)], False, False),
        (("MapError",), [("map", 3.0)], False, True),
        (("MapError",), [("MapError",)], False, False),
        (("untyped exception",), [("MapError",)], True, False),
        (("not certified", 2.0), [("map", 3.0)], True, False),
    ],
)
def test_what_is_wrong(ours, others, fault, worse):
    one = Comparison(row("ours", *ours), [row("other", *other) for other in others])
    assert (one.is_fault, one.is_worse) == (fault, worse)
    assert str(one).startswith("blob less a face (face 7): ours")


# -- surfaces of all kinds -------------------------------------------------------------


def test_a_row_for_each_surface_and_each_program(tmp_path):
    _, V, F, _ = meshes.NASTY["Moebius strip"]
    mesh = {
        "handles_torus": surfaces.torus(),
        "loops_tube": surfaces.tube(n=8),
        "loops_strip": (V, F),
    }
    for name, (V, F) in mesh.items():
        np.savez(tmp_path / f"{name}.npz", V=V, F=F)
    np.savez(tmp_path / "points.npz", V=V, F=np.empty((0, 3), int))
    V, F = surfaces.torus()  # each face by itself, and one of them twice
    np.savez(
        tmp_path / "soup.npz",
        V=V[np.vstack([F, F[:1]])].reshape(-1, 3),
        F=np.arange(3 * len(F) + 3).reshape(-1, 3),
    )
    table = tmp_path / "made.md"
    shown = benchmarks("surfaces", tmp_path, "--work", tmp_path / "w", "--out", table)
    assert shown.exit_code == 0, shown.output
    for text in (shown.stdout, table.read_text()):
        assert text.index("| handles_torus | 192 | cdcp_igl | 1 |") < text.index("| loops_strip |")
        assert "| cdcp_igl | 4 of 5 | 4 | 1 | " in text
        assert text.count("| 192 | cdcp_igl | 1 |") == 2
        assert "no map: " in text
    assert f"- Again: `python -m benchmarks surfaces {tmp_path}" in table.read_text()


def test_seams_are_what_lies_apart_in_the_texture():
    V, F = surfaces.torus()
    result = cdcp_igl.surface_map(V, F)
    mirrored = F[:, ::-1], result.uv[:, ::-1]
    for surface in ((V, F, result.uv), (V, *mirrored)):
        assert seams_and_charts(*surface) == pytest.approx((result.cut.length, 1))
    F, uv = F.copy(), result.uv.copy()
    F[5], uv[5] = F[5, ::-1], uv[5, ::-1]  # one face is turned over: it has no other seams
    assert seams_and_charts(V, F, uv) == pytest.approx((result.cut.length, 1))


def test_surfaces_that_are_missing_are_told_with_what_to_do(tmp_path, monkeypatch):
    for command in ("surfaces", "punctures"):
        assert "'/nope' does not exist" in refused(command, "/nope")
    for command in ("surfaces", "punctures"):
        assert "give another folder" in refused(command, tmp_path)
    monkeypatch.delenv("CDCP_IGL_DATA", raising=False)
    assert "set CDCP_IGL_DATA to a folder" in refused("surfaces")
    monkeypatch.setenv("CDCP_IGL_DATA", "/nope")
    for command in (["surfaces"], ["tables"], ["tables", "--models", "nefertiti_299"]):
        assert "'/nope' is no folder: set it" in refused(*command)


@pytest.mark.parametrize(
    "mesh", [surfaces.torus(), surfaces.sphere(), surfaces.tube(), meshes.fan()]
)
def test_no_map_is_below_the_bound(mesh):
    for refine in (0, 5):
        result = cdcp_igl.surface_map(9 * mesh[0], mesh[1], refine=refine)  # larger than a disk
        assert 0 < least_distortion(result) <= result.distortion.mean


def test_the_bound_of_a_fan_is_its_angle_defect():
    V, F = meshes.fan()
    result = cdcp_igl.surface_map(V, F)
    angles = cdcp_igl.libigl.angles(V, F)
    around = angles[:, 0].sum()
    rim = np.bincount(F[:, 1:].ravel(), angles[:, 1:].ravel())
    expected = abs(2 * np.pi - around) + np.maximum(rim - np.pi, 0).sum()
    assert least_distortion(result) == pytest.approx(np.degrees(expected) / F.size)


# -- faults ----------------------------------------------------------------------------


@pytest.mark.skipif(not os.path.exists("/proc/self/task"), reason="needs Linux")
def test_nothing_that_is_disturbed_hangs_or_is_half_done(tmp_path):
    done = benchmarks("faults", "--cases", 1, "--work", tmp_path)
    assert done.exit_code == 0, done.stdout
    for kind in DRILLS:
        assert kind in done.stdout


def test_an_error_without_a_type_is_a_fault():
    assert examine(1, faults.Row("no kind", 0)).outcome.startswith(FAULT)
