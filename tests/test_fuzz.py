"""Random surfaces, good and bad: each ends as a certified map or as a typed error."""

import json
import os
import time
from operator import attrgetter

import numpy as np
import pytest
from benchmark_commands import benchmarks
from hypothesis import given, settings
from hypothesis import strategies as st
from rich.console import Console

import cdcp_igl
from benchmarks.measure import fuzzing as fuzz
from benchmarks.measure.worker import kept_answers

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
    row = fuzz.examine(seed, 0)
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
    ("answer", "seconds", "outcome"), [(time.sleep, 1, "hang"), (os._exit, 600, "crash")]
)
def test_what_hangs_or_crashes_is_a_row(tmp_path, answer, seconds, outcome):
    asked, case = {600: fuzz.Row(600), 601: fuzz.Row(601)}, attrgetter("case")
    rows = kept_answers(answer, asked, case, tmp_path, seconds, 2, Console(quiet=True))
    assert [(row.case, row.outcome) for row in rows] == [(600, outcome), (601, outcome)]


def test_a_case_is_refined_in_its_turn():
    row = fuzz.examine(1, REFINED)
    assert row.refine > 0
    assert np.isfinite(row.refined)


def test_a_killed_run_goes_on_where_it_stopped(tmp_path):
    command = ("fuzz", "--cases", 6, "--work", tmp_path)
    whole = benchmarks(*command)
    assert whole.exit_code == 0
    assert "refined maps" in whole.stdout
    path = tmp_path / "fuzz-1" / "results.jsonl"
    lines = path.read_bytes().splitlines(keepends=True)
    lost = lines[0].replace(json.loads(lines[0])["outcome"].encode(), b"hang")
    path.write_bytes(lost + b"".join(lines[1:3]) + lines[3][:9])  # in the middle of a line
    # What is left is examined side by side, with the same outcome.
    again = benchmarks(*command, "--jobs", 2)
    assert again.exit_code == 1  # for what is lost
    assert "case 0: " in again.stdout
    assert path.read_bytes().startswith(lost)
    made = path.read_bytes().splitlines(keepends=True)
    assert set(lines[1:]) < set(made)
    assert len(made) == len(lines) + 1  # half a line
