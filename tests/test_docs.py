"""Gallery, examples, tables of errors; and README, whose lines must work and do no harm again."""

import doctest
import importlib
import inspect
import re
import runpy
import shlex
import subprocess
import sys
from pathlib import Path

import igl
import matplotlib as mpl
import numpy as np
import pytest
from browser import chromium
from typer.testing import CliRunner

import cdcp_igl
from cdcp_igl.command_line.program import app

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PROGRAMS = sorted((DOCS / "examples").glob("*.py"))
PAGES = sorted({*DOCS.rglob("*.md")} - {*(DOCS / "generated").rglob("*.md")})

# The modules whose ``__all__`` is public; see docs/reference.
PUBLIC = (
    "cdcp_igl",
    "cdcp_igl.datasets",
    "cdcp_igl.io",
    "cdcp_igl.plot",
    "cdcp_igl.reference",
)
NOT_CALLED = {
    "MapRow",  # a type
}


def public_names():
    found = []
    for module in map(importlib.import_module, PUBLIC):
        for name in module.__all__:
            value = getattr(module, name)
            if name not in NOT_CALLED and callable(value):
                found.append(pytest.param(module.__name__, name, id=f"{module.__name__}.{name}"))
    return found


@pytest.mark.parametrize(("module", "name"), public_names())
def test_every_public_name_has_an_example(module, name):
    documented = getattr(importlib.import_module(module), name)
    assert doctest.DocTestParser().get_examples(inspect.getdoc(documented))


@pytest.mark.parametrize(("module", "name"), public_names())
def test_every_parameter_is_described(module, name):
    function = getattr(importlib.import_module(module), name)
    if inspect.isfunction(function):
        said = re.split(r"^\w+\n-+\n", inspect.getdoc(function), flags=re.MULTILINE)[1:2]
        described = set(re.findall(r"\w+", " ".join(re.findall(r"^\S.*", *said, re.MULTILINE))))
        assert set(inspect.signature(function).parameters) <= described | {"V", "F"}


@pytest.mark.parametrize(("module", "name"), public_names())
def test_every_public_name_is_in_the_reference(module, name):
    pages = "\n".join(page.read_text() for page in (DOCS / "reference").glob("*.md"))
    assert re.search(rf"^   ~(?:[\w.]+\.)?{name}$", pages, re.MULTILINE)


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda path: path.stem)
def test_program_of_the_gallery(program, monkeypatch, tmp_path, cases_in_this_process):
    """Without network and without a directory of meshes, as in a fresh clone.

    A program that then takes the terrain has a part of it; the pages are built with the whole.
    """
    load = cdcp_igl.datasets.load

    def offline(*arguments, **options):
        raise OSError("no network")

    def a_part(name):
        V, F = load(name)
        x, y = (V[:, :2] / np.ptp(V[:, :2], axis=0)).T
        part = cdcp_igl.submesh(V, F, vertices=(abs(x - 0.5) < 0.06) & (abs(y - 0.5) < 0.06))
        return part.V, part.F

    if '"nilearn"' in program.read_text():
        pytest.importorskip("nilearn")  # of the extra for the pages
    monkeypatch.setattr("pooch.retrieve", offline)
    if "except OSError" in program.read_text():
        monkeypatch.setattr("cdcp_igl.datasets.load", a_part)
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("CDCP_IGL_DATA", raising=False)
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", None)
    from matplotlib import pyplot as plt

    plt.switch_backend("agg")
    with mpl.rc_context():
        made = runpy.run_path(str(program))
        pictures = [plt.figure(number) for number in plt.get_fignums()]
        plt.close("all")
    assert pictures or isinstance(made["figure"], mpl.figure.Figure)


@pytest.mark.parametrize(
    "page",
    [page for page in PAGES if "```python\n>>>" in page.read_text(encoding="utf-8")],
    ids=lambda path: path.stem,
)
def test_code_on_the_pages(page):
    blocks = re.findall(r"^```python\n(>>>.*?)^```", page.read_text(), re.MULTILINE | re.DOTALL)

    test = doctest.DocTestParser().get_doctest("\n".join(blocks), {}, page.name, str(page), 0)
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    assert runner.run(test).failed == 0


def test_the_paper_cites_what_its_bibliography_has():
    _, _, text = (ROOT / "paper.md").read_text(encoding="utf-8").split("---\n", 2)
    entries = re.findall(r"^@\w+\{(\w+),", (ROOT / "paper.bib").read_text("utf-8"), re.MULTILINE)
    assert set(re.findall(r"@(\w+)", text)) == set(entries)


# -- pages that are generated ----------------------------------------------------------


@pytest.fixture
def extensions(monkeypatch):
    monkeypatch.syspath_prepend(str(DOCS / "extensions"))


def test_every_bad_option_in_the_table_is_refused(extensions):
    from error_tables import CALLS, option_errors

    assert len(list(option_errors())) == len(CALLS)


def test_links_are_checked(tmp_path):
    complaints = runpy.run_path(str(DOCS / "check_links.py"))["complaints"]
    good = '<p id="here"><a href="#here"></a><a href="b.html#top"></a><a href="https://c.org"></a>'
    (tmp_path / "a.html").write_text(good)
    (tmp_path / "b.html").write_text('<p id="top"><img src="data:,">')
    assert list(complaints(tmp_path)) == []
    bad = ('<a href="#away">', '<a href="no.html">', '<script src="https://c.org/x.js">', str(ROOT))
    for n, text in enumerate(bad, 1):
        (tmp_path / f"bad{n}.html").write_text(text)
        assert len(list(complaints(tmp_path))) == n
    (tmp_path / "style.css").write_text("@import url('https://c.org/x.css')")
    assert len(list(complaints(tmp_path))) == len(bad) + 1


def test_pages_are_looked_at_in_a_browser(tmp_path):
    complaints = runpy.run_path(str(DOCS / "check_pages.py"))["complaints"]
    (tmp_path / "gallery").mkdir()
    good = '<div class="math"><svg width="99"></svg></div><table><tr><td>1</table>'
    dot = '<svg xmlns="http://www.w3.org/2000/svg" width="{}" height="9"></svg>'
    (tmp_path / "gallery" / "small.svg").write_text(dot.format(99))
    pages = {
        "fits": good,
        "wide": '<p style="width: 500px">so',  # on a phone only
        "cut": '<div class="math" style="overflow-x: auto"><p style="width: 2000px">',
        "empty": "<table><tr><th>method<tr><td></table>",
        "later": "This is not measured yet.",
        "night": "<style>[data-theme=dark] p { background: #222 }</style><p>so",  # black on it
        "gallery/small": '<img src="small.svg">',
    }
    for name, text in pages.items():
        (tmp_path / f"{name}.html").write_text(f"<!doctype html><article>{text}</article>")
    driver = chromium()
    try:
        found = [said.partition(".html, ")[::2] for said in complaints(tmp_path, driver)]
    finally:
        driver.quit()
    assert len(found) == 2 * len(pages) - 4  # for both widths
    once = {page: said for page, said in found if [page for page, _ in found].count(page) == 1}
    assert once["wide"].startswith("400 pixels: is ")
    assert once["night"] == "dark: contrast 1.3: so"
    assert set(dict(found)) == set(pages) - {"fits"}


def test_every_test_that_a_page_cites_is_there(extensions):
    pytest.importorskip("sphinx")
    from cited_tests import citations, code_of

    for citation in citations(DOCS):
        assert code_of(ROOT / "tests", citation)


def test_every_equation_has_its_places(extensions):
    from places import NOT_CITED, PACKAGE, equations

    for number, places in equations().items():
        assert bool(places) == (number not in NOT_CITED), number
        for file, line, _ in places:
            text = (PACKAGE / file).read_text(encoding="utf-8").splitlines()[line - 1]
            assert re.search(r"\(\d+\)", text)
    cited = {file for places in equations().values() for file, _, _ in places}
    steps = {f"steps/{name}.py" for name in ("center", "trace", "zipper", "mobius")}
    assert cited >= steps | {"algorithm.py", "solve/factored.py"}


def test_every_public_name_has_its_file(extensions):
    from places import PACKAGE, public_names

    found = {name: (file, line) for name, file, line in public_names()}
    assert set(found) >= {"cdcp_igl.disk_map", "cdcp_igl.io.READABLE", "cdcp_igl.reference.fdcp"}
    for name, (file, line) in found.items():
        text = (PACKAGE / file).read_text(encoding="utf-8").splitlines()[line - 1]
        assert name.rpartition(".")[2] in text or line == 1


def test_the_picture_of_the_way_names_files_that_are_there(extensions):
    import flow

    assert flow.missing() == []


# -- README: its lines run twice -------------------------------------------------------


README = Path(__file__).parent.parent.joinpath("README.md").read_text(encoding="utf-8")


def blocks(language):
    return re.findall(rf"^```{language}\n(.*?)^```", README, re.MULTILINE | re.DOTALL)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with the files that README names."""
    V, F, _ = cdcp_igl.datasets.paraboloid(12)
    (tmp_path / "scans").mkdir()
    for name in ("face.obj", "scan.obj", "scans/first.obj", "scans/second.obj"):
        igl.writeOBJ(str(tmp_path / name), V, F)
    loop = igl.boundary_loop(F)
    V[:, 2] -= V[loop, 2].mean()
    V[loop, 2] = 0
    both, mirrored = np.vstack([V, V * [1, 1, -1]]), F[:, ::-1] + len(V)
    statue = cdcp_igl.clean(both, np.vstack([F, mirrored]))  # merged along the boundary: closed
    igl.writeOBJ(str(tmp_path / "statue.obj"), statue.V, statue.F)
    chart = cdcp_igl.cut(statue.V, statue.F)
    cdcp_igl.io.write_map(tmp_path / "statue.glb", chart.V, chart.F, chart.V[:, :2])  # with seams
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_readme_from_top_to_bottom_twice_in_one_folder(folder, cases_in_this_process):
    """All that is typed into Python, then all that is for the shell; then both again."""
    code = [
        "".join(example.source for example in doctest.DocTestParser().get_examples(block)) or block
        for block in blocks("python")
    ]
    assert len(code) >= 6
    (text,) = (block for block in blocks("sh") if "cdcp-igl map" in block)
    lines = [shlex.split(line, comments=True) for line in text.strip().splitlines()]
    assert {program for program, *_ in lines} == {"cdcp-igl"}
    for again in (False, True):
        known = {}
        for block in code:
            exec(block, known)
        for _, *arguments in lines:
            if again and arguments[0] == "map":  # what is there is kept
                assert CliRunner().invoke(app, arguments).exit_code == 2
                arguments.append("--force")
            done = CliRunner().invoke(app, arguments)
            # `check` says that the statue is no disk.
            assert done.exit_code == (2 if arguments[0] == "check" else 0), done.output
    made = {"map.html", "maps.html", "map.obj", "face_disk.obj", "statue_uv.glb", "scan_disk.obj"}
    assert made | {"face.html", "maps.png", "batch.html"} <= {
        path.name for path in folder.iterdir()
    }


def test_the_printed_result(real_mesh):
    (block,) = (block for block in blocks("python") if "print(result)" in block)
    expected = block.split("print(result)\n", 1)[1].splitlines()
    printed = str(cdcp_igl.disk_map(*real_mesh("chinese_lion_17334"))).splitlines()
    assert len(printed) == len(expected)
    for line, shown in zip(printed, expected, strict=True):
        label = line[:22]
        assert shown[:22] == label
        if label.strip() not in ("solver", "seconds"):  # of the machine
            assert shown == line


# -- what is told is typed -------------------------------------------------------------

TYPED = """# pyright: standard, reportUnknownArgumentType=true, reportUnknownVariableType=true
# pyright: reportUnknownMemberType=true
from typing import Any, assert_type

import numpy as np
from numpy.typing import NDArray

import cdcp_igl

assert_type(cdcp_igl.surface_map("a.glb").packed(), NDArray[np.float64])
assert_type(cdcp_igl.DiskMapper("a.glb").map(), cdcp_igl.DiskMap)
"""
KNOWN = """
def block_{}(
    V: NDArray[np.float64], F: NDArray[np.int64], result: cdcp_igl.DiskMap, anything: Any,
) -> None:
    {}
"""


def calls_with_one_object():
    for module, name in (param.values for param in public_names()):
        called = getattr(importlib.import_module(module), name)
        if not inspect.isfunction(called) and name != "DiskMapper":
            continue
        parameters = inspect.signature(called).parameters.values()
        needed = [each.name for each in parameters if each.default is each.empty]
        if {"V", "F"} <= set(needed):
            needed.remove("F")
            objects = ('"a.obj"' if each == "V" else "anything" for each in needed)
            yield f"{module}.{name}({', '.join(objects)})"


@pytest.mark.parametrize("checker", ["mypy", "basedpyright"])  # pyright as a wheel
def test_readme_and_one_object_in_place_of_two_are_typed(tmp_path, checker):
    code = [
        [line.removeprefix(">>> ") for line in block.splitlines() if line[:3] == block[:3] == ">>>"]
        or block.splitlines()
        for block in blocks("python")
    ]
    code.append(list(calls_with_one_object()))
    assert len(code[-1]) > 20
    file = tmp_path / "readme.py"
    functions = (KNOWN.format(k, "\n    ".join(lines)) for k, lines in enumerate(code))
    file.write_text(TYPED + "".join(functions), encoding="utf-8")
    options = {"mypy": ["--strict"], "basedpyright": ["--pythonpath", sys.executable]}[checker]
    command = [sys.executable, "-m", checker, *options, str(file)]
    ran = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stdout + ran.stderr
