"""The report for the browser, drawn by ``figures`` and opened in Chromium."""

import re
import runpy
from dataclasses import dataclass, replace
from pathlib import Path

import matplotlib as mpl
import pytest
from benchmark_commands import MACHINE, ROOT, benchmarks, refused, typical
from browser import chromium

from benchmarks.measure.ablation import ABLATIONS
from benchmarks.measure.methods import maps
from benchmarks.measure.models import as_disk, tier
from benchmarks.records.results import Measured
from benchmarks.records.store import Work, read_results, write_results
from benchmarks.write.figures import PLOTS
from benchmarks.write.pages import write_pages
from cdcp_igl import disk_map
from cdcp_igl.reference.case import Case


@dataclass(frozen=True)
class Drawn:
    """The folder that ``figures`` wrote, and where the results are."""

    folder: Path
    results: Path


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    """All methods on three small surfaces, and the map of CDCP; the numbers are made up."""
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
                records.append(made)
    write_results(folder / "here.json", MACHINE, records)
    with mpl.rc_context({"savefig.dpi": 30}):
        here = ("--out", folder, "--work", work.folder, "--machine", "here")
        done = benchmarks("figures", *here)
    assert done.exit_code == 0, done.output
    assert str(folder / "here" / "index.html") in done.stdout.replace("\n", "")
    return Drawn(folder / "here", folder / "here.json")


def test_every_figure_is_there_and_small(drawn):
    for plot in PLOTS:
        size = (drawn.folder / plot.file).stat().st_size
        assert 500 < size < 100_000, plot.file
    text = (drawn.folder / "README.md").read_text()
    assert re.findall(r"\]\((.*?)\)", text) == [plot.file for plot in PLOTS]


def test_pages_need_nothing_from_elsewhere(drawn):
    pages = sorted(drawn.folder.glob("*.html"))
    assert len(pages) == 4  # the index and three surfaces
    complaints = runpy.run_path(str(ROOT / "docs" / "check_links.py"))["complaints"]
    assert list(complaints(drawn.folder)) == []
    for page in pages:
        identifiers = re.findall(r' id="(.*?)"', page.read_text(encoding="utf-8"))
        assert len(set(identifiers)) == len(identifiers)


def test_the_numbers_are_those_of_the_records(drawn):
    page = (drawn.folder / "index.html").read_text(encoding="utf-8")
    about, records = read_results(drawn.results)
    for record in records:
        if record.section == "tables" and record.case.boundary != "none":
            assert f"{record.case.mean:.3f} / {record.case.sd:.3f}</td>" in page
            assert f'data-value="{record.case.mean}"' in page
    for text in (about["cpu"], about["commit"], about["date"], about["versions"]["libigl"]):
        assert text in page


def test_without_results_it_says_what_to_run(tmp_path):
    assert "python -m benchmarks tables" in refused("figures", "--out", tmp_path)


# -- in the browser --------------------------------------------------------------------

FAILED = "crashed: SIGSEGV"


@pytest.fixture(scope="module")
def index(drawn, tmp_path_factory):
    """A report of the same records, except that LDCP failed on one surface."""
    about, records = read_results(drawn.results)
    records = [
        replace(record, case=Case("ldcp", "disk", FAILED))
        if (record.section, record.model, record.case.method) == ("tables", "ellipse_20", "ldcp")
        else record
        for record in records
    ]
    measured = Measured(records)
    folder = tmp_path_factory.mktemp("report")
    return write_pages(folder, about, measured, [], lambda model: None)


@pytest.fixture(scope="module")
def browser():
    driver = chromium("disable-gpu")
    yield driver
    driver.quit()


@pytest.fixture
def opened(browser, index):
    browser.set_window_size(1400, 1000)
    browser.get(index.as_uri())
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
    for page in (drawn.folder / "index.html", drawn.folder / "terrain_coarse.html"):
        opened.get(page.as_uri())
        assert opened.execute_script("return document.documentElement.scrollWidth") <= width
        images = "return [...document.images].every(i => i.complete && i.naturalWidth > 0)"
        assert opened.execute_script(images)
    opened.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    loaded = "return performance.getEntriesByType('resource').map(e => e.name)"
    assert [name for name in opened.execute_script(loaded) if not name.startswith("data:")] == []
