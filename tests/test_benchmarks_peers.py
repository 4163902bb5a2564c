"""Other programs, methods of one's own, and statistics over many surfaces."""

import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from benchmark_commands import ROOT, benchmarks, measure, record, refused

from benchmarks.measure import models
from benchmarks.measure.methods import METHODS
from benchmarks.measure.models import Model
from benchmarks.measure.peers import PEERS
from benchmarks.records.comparison import paired, profiles, ranking, summary
from benchmarks.records.results import Section
from benchmarks.records.store import Work, read_results
from benchmarks.write.figures.style import style
from benchmarks.write.sections import peer_tables
from cdcp_igl import angle_distortion, check, datasets
from cdcp_igl.certificate import certify
from cdcp_igl.reference import bff, harmonic
from cdcp_igl.surface.mesh import DiskMesh

V, F, _ = datasets.ellipse(5)
PLANE = Model("plane", lambda: (V, F.astype(np.int32)))

# -- other programs --------------------------------------------------------------------


def peer(folder, name):
    (made,) = measure(folder, [name], [PLANE], "peers")
    return made


@pytest.mark.parametrize("name", ["SLIM", "SLIM conformal", "ARAP"])
def test_libigl_peers_open_a_plane(name):
    uv = PEERS[name].function(V, F)
    start = angle_distortion(V, F, harmonic(V, F)).mean()
    assert angle_distortion(V, F, uv).mean() < 0.1 * start


@pytest.mark.parametrize("name", PEERS)
def test_an_installed_peer_gives_a_map(name, tmp_path):
    if reason := PEERS[name].missing():
        pytest.skip(reason)
    made = peer(tmp_path, name)
    assert made.ok or "charts" in made.case.outcome


def test_what_is_not_installed_is_told(tmp_path, monkeypatch):
    missing = replace(PEERS["xatlas"], missing=lambda: "not to be had: needs pip install it")
    monkeypatch.setitem(METHODS, "xatlas", missing)
    assert peer(tmp_path, "xatlas").case.outcome == "not to be had: needs pip install it"
    assert Work(tmp_path).records() == []  # it is tried again


def test_the_head_of_a_column_says_what_the_boundary_is():
    made = section({name: [1] for name in ("cdcp", "lscm", "MeshLab harmonic")})
    heads = ["CDCP", "LSCM, free boundary", "MeshLab harmonic, not certified, single precision"]
    assert next(peer_tables(made)).headings[2:] == heads


# -- a method of one's own -------------------------------------------------------------


def tables(tmp_path, *arguments):
    return benchmarks(
        *("tables", "--models", "spherical_cap_20", "--methods", "cdcp"),
        *("--out", tmp_path, "--work", tmp_path / "w", "--machine", "here", *arguments),
        path=[ROOT / "tests", tmp_path],
    )


def test_ones_own_methods_join_the_tables_and_fail_in_rows(tmp_path):
    told = {"kills_itself": "crashed: SIGSEGV", "flipped": "not valid"}
    done = tables(tmp_path, *(f"--method=failing_methods:{name}" for name in told))
    assert done.exit_code == 0, done.output
    first, *others = [made.case.outcome for made in read_results(tmp_path / "here.json")[1]]
    assert first == "ok"
    for outcome, beginning in zip(others, told.values(), strict=True):
        assert outcome.startswith(beginning)
        assert outcome in (tmp_path / "here.md").read_text()


def test_a_method_that_has_changed_is_measured_again(tmp_path):
    file = tmp_path / "mine.py"
    for sign in ("", "[::, ::-1]"):
        file.write_text(f"import cdcp_igl\ndef own(V, F): return cdcp_igl.cdcp(V, F){sign}\n")
        done = tables(tmp_path, "--method", "mine:own")
        assert done.exit_code == 0, done.output
    own = read_results(tmp_path / "here.json")[1][1]
    assert own.case.outcome.startswith("not valid")
    assert len(Work(tmp_path / "w").records()) == 3


def test_the_method_of_the_documentation_maps():
    page = (ROOT / "docs" / "benchmarks.md").read_text(encoding="utf-8")
    names = {}
    exec(re.search(r"```python\n(import igl.*?)```", page, re.DOTALL)[1], names)
    assert certify(DiskMesh(V, F), names["tutte"](V, F)).valid


@pytest.mark.parametrize("name", ["no_such_module:map", "failing_methods:no_such", "magic"])
def test_a_method_that_is_not_there_is_an_error(name):
    assert "no method" in refused("tables", "--method", name)


def test_a_method_with_other_options_is_one_more():
    refined = METHODS["cdcp refine=2 refine_norm=1.2"].function(V, F)
    assert refined.refinement.steps == 2
    np.testing.assert_array_equal(METHODS["bff disk=True"].function(V, F), bff(V, F, disk=True))
    assert style("cdcp refine=2").label == "CDCP, refine=2"


# -- many surfaces ---------------------------------------------------------------------


def section(means, flips=0.0):
    """Records of methods by their means on surfaces a, b, c, ...; None where one failed."""
    return Section(
        record("abcdefgh"[k], method, mean=mean, sd=1.0, flips=flips, seconds=1.0, n=100 + k)
        if mean
        else record("abcdefgh"[k], method, outcome="failed", n=100 + k)
        for method, values in means.items()
        for k, mean in enumerate(values)
    )


def test_the_summary_counts_and_sums_up():
    table = summary(section({"cdcp": [1, 2, 3, 4, 5], "fdcp": [1, None, 3, None, 8]}))
    assert table.loc["cdcp", "mapped"] == 1
    assert table.loc["fdcp", "mapped"] == pytest.approx(0.6)
    assert table.loc["fdcp", "unflipped"] == pytest.approx(0.6)
    quartiles = [table.loc["cdcp", f"mean {q}"] for q in (0.25, 0.5, 0.75)]
    np.testing.assert_allclose(quartiles, [2, 3, 4])
    assert table.loc["fdcp", "mean 0.5"] == 3
    assert summary(section({"lscm": [1, 2]}, flips=3.0)).loc["lscm", "unflipped"] == 0


def test_a_profile_is_the_share_within_a_factor_of_the_best():
    made = profiles(
        section({"cdcp": [1, 4, 3, None], "fdcp": [2, 1, 3, None]}), ["cdcp", "fdcp"], "mean"
    )
    np.testing.assert_allclose(made["cdcp"], [1, 1, 4])  # none counts where nobody has a map
    np.testing.assert_allclose(made["fdcp"], [1, 1, 2])
    made = profiles(section({"cdcp": [1, 1], "fdcp": [2, None]}), ["cdcp", "fdcp"], "mean")
    np.testing.assert_allclose(made["fdcp"], [2, np.inf])


def test_the_best_has_the_least_median_ratio_and_no_flips():
    made = section({"cdcp": [1, 4, 3], "fdcp": [2, 1, 3], "ldcp": [9, 9, None]})
    ranked = ranking(made, "disk", "mean")
    assert [method for method, *_ in ranked] == ["cdcp", "fdcp", "ldcp"]
    assert ranked[0][1:] == (1, pytest.approx(2 / 3))
    assert ranking(section({"cdcp": [1, 2]}, flips=1.0), "disk", "mean") == []
    closed = [record("a", "sphere", boundary="sphere", mean=1.0, flips=0)]  # of two surfaces
    assert ranking(Section([*made.records, *closed]), "sphere", "mean") == [("sphere", 1, 1)]


def test_paired_tests_have_their_exact_values():
    better = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    worse = [value + k for k, value in enumerate(better, 1)]
    made = paired(section({"cdcp": better, "fdcp": worse}), "cdcp", "fdcp", "mean")
    assert (made.lower, made.higher, made.ties) == (6, 0, 0)
    assert made.median == -3.5
    assert made.sign == pytest.approx(2 / 2**6)
    assert made.signed_rank == pytest.approx(2 / 2**6)


@pytest.mark.parametrize(
    ("means", "others", "counts"),
    [
        ([1, 2, 3], [1 + 1e-9, 2 - 2e-9, 3], (0, 0, 3)),  # rounding is no difference
        ([1, 2, None], [2, None, 1], (1, 0, 0)),  # only pairs are compared
    ],
)
def test_what_is_compared(means, others, counts):
    made = paired(section({"cdcp": means, "fdcp": others}), "cdcp", "fdcp", "mean")
    assert (made.lower, made.higher, made.ties) == counts
    assert (made.sign, made.signed_rank) == (1, 1)


def test_the_tiers_are_parts_of_each_other_and_the_same_everywhere(monkeypatch, tmp_path):
    monkeypatch.setenv("CDCP_IGL_DATA", str(tmp_path))
    quick, standard, large = (models.tier(name) for name in models.TIERS)
    assert [len(tier) for tier in (quick, standard, large)] == [8, 60, 300]
    names = [model.name for model in large]
    assert len(set(names)) == 300
    assert names[:60] == [model.name for model in standard]
    assert set(datasets.NAMES) < set(names[:60])
    monkeypatch.delenv("CDCP_IGL_DATA")
    for one, again in zip(quick, models.tier("quick"), strict=True):  # from the package alone
        assert check(*one.load()).is_disk
        np.testing.assert_array_equal(one.load()[0], again.load()[0])


def test_a_tier_has_results_and_rows_of_its_own(tmp_path, monkeypatch):
    monkeypatch.setitem(models.TIERS, "quick", 1)
    here = ("--out", tmp_path, "--work", tmp_path / "w", "--machine", "here")
    done = benchmarks("tables", "--tier", "quick", "--methods", "cdcp,lscm", *here)
    assert done.exit_code == 0, done.output
    rows = pd.read_csv(tmp_path / "here-quick.csv").set_index("method")
    assert rows.loc["lscm", "boundary"] == "free"
    page = (ROOT / "docs" / "benchmarks.md").read_text(encoding="utf-8")
    code = re.search(r"```python\n(import pandas.*?)```", page, re.DOTALL)[1]
    exec(code.replace("measured/mine-quick.csv", str(tmp_path / "here-quick.csv")), read := {})
    assert list(read["maps"]["method"]) == ["cdcp", "lscm"]
    records = read_results(tmp_path / "here-quick.json")[1]
    assert rows.loc["cdcp", "mean"] == records[0].case.mean
    assert "## Which method for what" not in (tmp_path / "here-quick.md").read_text()
    assert "without --models" in refused("tables", "--tier", "quick", "--models", "maze")
