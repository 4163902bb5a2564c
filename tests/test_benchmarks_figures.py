"""The pictures and the report of the benchmarks, other programs, statistics over many surfaces."""

import re
import runpy
from dataclasses import replace
from itertools import product

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from benchmark_commands import (
    MACHINE,
    MEANS,
    ROOT,
    SECONDS,
    benchmarks,
    measure,
    record,
    refused,
    typical,
)
from browser import chromium
from matplotlib.text import Text

from benchmarks.measure import models
from benchmarks.measure.ablation import ABLATIONS
from benchmarks.measure.methods import METHODS, maps
from benchmarks.measure.models import Model, as_disk, tier
from benchmarks.measure.peers import PEERS
from benchmarks.records.comparison import paired, profiles, ranking, summary
from benchmarks.records.record import EDGES
from benchmarks.records.results import Measured, NotMeasured, Section, growth
from benchmarks.records.store import Work, read_results, write_results
from benchmarks.write import report
from benchmarks.write.figures import PLOTS, surfaces
from benchmarks.write.figures.charts import (
    STACK,
    factorizations,
    histograms,
    performance_profiles,
    phases,
    seconds,
    seconds_growth,
    table_1,
)
from benchmarks.write.figures.style import HATCHES, MOST, STYLES, model_name, style
from benchmarks.write.sections import cases, peer_table
from benchmarks.write.table import markdown
from cdcp_igl import check, datasets, disk_map
from cdcp_igl.phases import PHASES
from cdcp_igl.plot.scene import Scene
from cdcp_igl.reference import bff
from cdcp_igl.reference.case import Case
from cdcp_igl.surface.mesh import DiskMesh
from cdcp_igl.verdict.certificate import certify


def test_distortion_is_painted_where_it_is():
    V, F, _ = datasets.square(10)
    uv = V[:, :2].copy()
    uv[V[:, 0] > 0, 0] *= 3  # the right half is stretched
    scene = Scene(V, F, 40)
    light = scene.distortion(uv, 40)[..., :3].sum(axis=2, dtype=float)
    assert light[10:30, 25:35].mean() > 1.5 * light[10:30, 5:15].mean()


# -- charts ----------------------------------------------------------------------------

MODELS = {"small": 20_000, "large": 80_000, "largest": 320_000}


def failure(model, method, section="tables"):
    return record(model, method, section, outcome="crashed: SIGSEGV", n=MODELS[model])


def measured(*extra):
    """All methods on all models; fdcp fails on the large one."""
    records = [
        failure(model, method)
        if (model, method) == ("large", "fdcp")
        else typical(model, method, section, n=n, repeat=repeat)
        for model, n in MODELS.items()
        for method in SECONDS
        for section, repeat in (("tables", 0), ("speed", 0), ("speed", 1))
    ]
    return Measured([*records, *extra])


def line(axes, method):
    return next(one for one in axes.lines if one.get_label() == STYLES[method].label)


def test_numbers_and_failures_are_drawn_where_they_belong():
    axes = table_1(measured()).axes[0]
    for method in ("cdcp", "ldcp", "harmonic"):
        np.testing.assert_allclose(line(axes, method).get_xdata(), MEANS[method])
    names = [text.get_text() for text in axes.get_yticklabels()]
    assert names == [f"{name}  {n:,}" for name, n in MODELS.items()]
    lost, (text,) = line(axes, "fdcp"), axes.texts
    np.testing.assert_array_equal(np.isnan(lost.get_xdata()), [False, True, False])
    assert (text.get_text(), text.get_position()[1]) == ("no map", lost.get_ydata()[1])


def test_times_are_multiples_of_a_factorization_of_the_same_model():
    axes = factorizations(measured()).axes[0]
    np.testing.assert_allclose(line(axes, "cdcp").get_xdata(), 2)
    np.testing.assert_allclose(line(axes, "harmonic").get_xdata(), 1)


def test_the_phases_add_up():
    axes = phases(measured()).axes[0]
    assert {name for names, _ in STACK.values() for name in names} == set(PHASES)
    widths = np.array([[bar.get_width() for bar in bars] for bars in axes.containers])
    np.testing.assert_allclose(widths.sum(axis=0), 2)
    assert len({bars[0].get_hatch() for bars in axes.containers}) == len(HATCHES)


def test_histograms_show_densities():
    panel = histograms(measured()).axes[0]
    for stairs in panel.patches:
        density, edges, _ = stairs.get_data()
        assert (density * np.diff(edges)).sum() == pytest.approx(100)


def test_growth_is_the_exponent():
    n = np.array([100.0, 20_000, 40_000, 90_000, 1e6])
    values = 3e-5 * n**1.2
    values[0] = 17  # too small to count
    assert growth(n, values) == pytest.approx((1.2, 3e-5))
    assert np.isnan(growth(n[:3], values[:3])).all()
    assert growth(n, np.append(values[:-1], np.nan))[0] == pytest.approx(1.2)


def test_a_chart_that_cannot_be_drawn_says_why():
    """What was not measured, where everything failed, surfaces too many to draw one by one."""
    sections = ("tables", "speed")
    failed = [failure(*of) for of in product(MODELS, SECONDS, sections)]
    charts = [plot for plot in PLOTS if plot.draw.__module__ != surfaces.__name__]
    for records, plots, why in (
        ([], PLOTS, r"run: python -m benchmarks (tables|speed|ablation)"),
        (failed, charts, "failed|no method has|not measured yet"),
        (mapped({"cdcp": [1] * (MOST + 1)}), [histograms, table_1, surfaces.images], "more than"),
    ):
        measured = Measured(records)
        for plot in plots:
            with pytest.raises(NotMeasured, match=why):
                plot(measured)


def test_a_profile_has_the_methods_that_were_run_everywhere():
    """One that was run on a few would look like one that fails on the others."""
    means = [1, 2, 3, 4, 5]
    records = mapped({"cdcp": means, "fdcp": means, "ldcp": means[:-1]})
    figure = performance_profiles(Measured(records))
    assert figure.axes[0].get_legend_handles_labels()[1] == ["FDCP", "CDCP"]


@pytest.mark.parametrize(
    "draw", [histograms, table_1, seconds, seconds_growth, performance_profiles]
)
def test_a_method_of_ones_own_is_in_the_figures_of_the_tables(draw):
    figure = draw(measured(*(typical(model, "mine:own", n=n) for model, n in MODELS.items())))
    assert any("mine:own" in text.get_text() for text in figure.findobj(Text))


# -- names of surfaces -----------------------------------------------------------------


def named(*names):
    return [record(name, "harmonic", histogram=[1] * len(EDGES)) for name in names]


def test_names_are_told_apart_and_paths_stay_as_they_are():
    names = ("left_ear_100", "a_b", "a b", "a|b", "/tmp/my_scans/ear.obj")
    table = cases(Measured(named(*names)).sections["tables"])
    assert [row[0].text for row in table.rows] == ["left ear", *names[1:]]
    assert r"| a\|b | 100 |" in markdown(table)  # a bar is no column
    assert model_name(names[-1], 100) == "/tmp/my_scans/ear.obj  100"


def test_each_surface_has_a_page_of_its_own(tmp_path):
    V, F, _ = datasets.ellipse(3)
    records = [*named("a_b", "a b"), record("a", "without Möbius", "ablation")]
    report.draw(tmp_path, MACHINE, Measured(records, lambda mesh: (V, F)))
    names = {"a_b.html", "a~20b.html", "a.html"}
    assert {page.name for page in tmp_path.glob("a*.html")} == names


# -- other programs --------------------------------------------------------------------

V, F, _ = datasets.ellipse(5)
PLANE = Model("plane", lambda: (V, F.astype(np.int32)))


def peer(folder, name):
    (made,) = measure(folder, [name], [PLANE], "peers")
    return made


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
    made = mapped({name: [1] for name in ("cdcp", "lscm", "MeshLab harmonic")})
    renamed = record("0", "BFF disk", boundary="free", mean=1.0)  # in older results
    heads = ["CDCP", "LSCM, free boundary", "MeshLab harmonic, not certified, single precision"]
    heads.append("BFF disk, free boundary")
    assert peer_table(Section([*made, renamed])).headings[2:] == heads


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


def mapped(means, flips=0.0):
    """Records of methods by their means on one surface after the other; None where one failed."""
    numbers = {"sd": 1.0, "flips": flips, "seconds": 1.0}
    for method, values in means.items():
        for k, mean in enumerate(values):
            of = numbers | {"mean": mean} if mean else {"outcome": "failed"}
            yield record(f"{k}", method, boundary=METHODS[method].boundary, n=100 + k, **of)


def section(means, flips=0.0):
    return Section(mapped(means, flips))


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
    closed = [record("0", "sphere", boundary="sphere", mean=1.0, flips=0)]  # of two surfaces
    assert ranking(Section([*made.records, *closed]), "sphere", "mean") == [("sphere", 1, 1)]


@pytest.mark.parametrize(
    ("means", "others", "counts", "median", "p"),
    [
        (range(1, 7), range(2, 13, 2), (6, 0, 0), -3.5, 2 / 2**6),
        ([1, 2, 3], [1 + 1e-9, 2 - 2e-9, 3], (0, 0, 3), 0, 1),  # rounding is no difference
        ([1, 2, None], [2, None, 1], (1, 0, 0), -1, 1),  # only pairs are compared
    ],
)
def test_paired_tests_have_their_exact_values(means, others, counts, median, p):
    made = paired(section({"cdcp": means, "fdcp": others}), "cdcp", "fdcp", "mean")
    assert (made.lower, made.higher, made.ties) == counts
    assert (made.median, made.sign, made.signed_rank) == pytest.approx((median, p, p), abs=1e-8)


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


# -- the report for the browser, drawn by figures and opened in Chromium ---------------


FAILED = "crashed: SIGSEGV"


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    """The folder that ``figures`` wrote: all methods on three small surfaces.

    LDCP failed on one; there is the map of CDCP; the numbers are made up.
    """
    folder = tmp_path_factory.mktemp("results")
    work, records = Work(folder / "work"), []
    methods = {"tables": maps(), "speed": ["cdcp", "lscm"], "ablation": ABLATIONS}
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("CDCP_IGL_DATA", raising=False)
        models = tier("quick")[:3]
    for model in models:
        mesh, V, F = as_disk(model, work)
        for section, names in methods.items():
            for name in ("factor", *names):
                made = replace(typical(model.name, name, section, n=len(V)), mesh=mesh)
                if (section, name) == ("tables", "cdcp"):
                    result = disk_map(V, F)
                    made = replace(made, case=replace(made.case, details=result.report()))
                    work.keep_map(made, result.uv)
                if (section, name, model.name) == ("tables", "ldcp", "ellipse_20"):
                    made = replace(made, case=Case("ldcp", "disk", FAILED))
                records.append(made)
    write_results(folder / "here.json", MACHINE, records)
    with mpl.rc_context({"savefig.dpi": 30}):
        here = ("--out", folder, "--work", work.folder, "--machine", "here")
        done = benchmarks("figures", *here)
    assert done.exit_code == 0, done.output
    assert str(folder / "here" / "index.html") in done.stdout.replace("\n", "")
    return folder / "here"


def test_every_figure_is_there_and_small(drawn):
    for plot in PLOTS:
        size = (drawn / plot.file).stat().st_size
        assert 500 < size < 100_000, plot.file
    text = (drawn / "README.md").read_text()
    assert re.findall(r"\]\((.*?)\)", text) == [plot.file for plot in PLOTS]


def test_pages_need_nothing_from_elsewhere(drawn):
    pages = sorted(drawn.glob("*.html"))
    assert len(pages) == 4  # the index and three surfaces
    complaints = runpy.run_path(str(ROOT / "docs" / "check_links.py"))["complaints"]
    assert list(complaints(drawn)) == []
    for page in pages:
        identifiers = re.findall(r' id="(.*?)"', page.read_text(encoding="utf-8"))
        assert len(set(identifiers)) == len(identifiers)


def test_the_numbers_are_those_of_the_records(drawn):
    page = (drawn / "index.html").read_text(encoding="utf-8")
    about, records = read_results(drawn.with_suffix(".json"))
    for made in records:
        if made.section == "tables" and made.ok and made.case.boundary != "none":
            assert f"{made.case.mean:.3f} / {made.case.sd:.3f}</td>" in page
            assert f'data-value="{made.case.mean}"' in page
    for text in (about["cpu"], about["commit"], about["date"], about["versions"]["libigl"]):
        assert text in page


# -- in the browser --------------------------------------------------------------------


@pytest.fixture(scope="module")
def browser():
    driver = chromium("disable-gpu")
    yield driver
    driver.quit()


@pytest.fixture
def opened(browser, drawn):
    browser.set_window_size(1400, 1000)
    browser.get((drawn / "index.html").as_uri())
    yield browser
    assert browser.get_log("browser") == []


def column(browser, table, heading):
    """The button of a heading, and a function that reads its column."""
    from selenium.webdriver.common.by import By

    headings = browser.find_elements(By.CSS_SELECTOR, f"#{table} thead th")
    k = next(k for k, th in enumerate(headings) if th.text.startswith(heading))

    def read():
        cells = browser.find_elements(By.CSS_SELECTOR, f"#{table} tbody tr > :nth-child({k + 1})")
        return [cell.text for cell in cells]

    return headings[k].find_element(By.TAG_NAME, "button"), headings[k], read


def test_a_click_sorts_by_number_and_failures_stay_last(opened):
    button, heading, read = column(opened, "cases-table", "mean")
    before = read()
    for direction in ("ascending", "descending"):
        opened.execute_script("arguments[0].scrollIntoView()", button)
        button.click()
        assert heading.get_attribute("aria-sort") == direction
        shown = read()
        assert shown[-1] == "–"
        values = [float(text) for text in shown[:-1]]
        assert values == sorted(values, reverse=direction == "descending")
        assert sorted(shown) == sorted(before)
        assert shown != before
    _, _, outcomes = column(opened, "cases-table", "outcome")
    assert outcomes()[-1] == FAILED


@pytest.mark.parametrize("width", [400, 1400])
def test_a_window_scrolls_in_one_direction_only(opened, drawn, width):
    metrics = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
    opened.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    for page in (drawn / "index.html", drawn / "terrain_coarse.html"):
        opened.get(page.as_uri())
        assert opened.execute_script("return document.documentElement.scrollWidth") <= width
        images = "return [...document.images].every(i => i.complete && i.naturalWidth > 0)"
        assert opened.execute_script(images)
    opened.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    loaded = "return performance.getEntriesByType('resource').map(e => e.name)"
    assert [name for name in opened.execute_script(loaded) if not name.startswith("data:")] == []
