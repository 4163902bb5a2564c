"""What notebooks and consoles show, and files by their suffix."""

import json
import re
from dataclasses import replace
from html import unescape
from pathlib import Path

import numpy as np
import pytest
from browser import SOFTWARE_WEBGL, chromium
from meshes import NASTY, corridor, grid

import cdcp_igl
from cdcp_igl.io import read_mesh, write_map
from cdcp_igl.printing import as_html

NOTEBOOK = Path(__file__).parents[1] / "docs" / "examples" / "notebook.ipynb"


@pytest.fixture(scope="module")
def mapped():
    V, F = grid(12, 15)
    return 100 * V, F, cdcp_igl.disk_map(100 * V, F)


def test_a_repr_is_one_line(mapped):
    V, F, result = mapped
    assert (
        repr(result)
        == f"DiskMap(180 vertices: valid, mean distortion {result.distortion.mean:.3g}°)"
    )
    assert repr(cdcp_igl.check(V, F)) == "MeshReport(180 vertices, 308 faces: a disk)"
    assert "closed surface" in repr(cdcp_igl.check(*NASTY["closed"][1:3]))
    failed = replace(result, certificate=replace(result.certificate, boundary_monotone=False))
    assert "NOT VALID" in repr(failed)
    assert "<iframe" not in failed._repr_html_()


def test_a_notebook_shows_a_table_and_the_page(mapped):
    _, _, result = mapped
    shown = result._repr_html_()
    assert "<table>" in shown
    page = unescape(re.search(r'srcdoc="(.*?)"', shown, re.DOTALL)[1])
    assert page == result.view_html()


@pytest.mark.parametrize("exponent", [-900, 1010])
def test_what_is_shown_does_not_depend_on_the_unit(exponent):
    V, F = grid(8, 9)
    W, G = np.ldexp(V, exponent), np.delete(F, 40, axis=0)
    for small, large in (
        (cdcp_igl.disk_map(V, F), cdcp_igl.disk_map(W, F)),
        (cdcp_igl.surface_map(V, G), cdcp_igl.surface_map(W, G)),
    ):
        assert small.view_html() == large.view_html()
        assert "<iframe" in large._repr_html_()


def test_a_large_surface_is_a_picture_in_a_notebook(mapped, monkeypatch):
    monkeypatch.setattr("cdcp_igl.result.base.MOST_VERTICES_OF_PAGES", 100)
    shown = mapped[2]._repr_html_()
    assert "<iframe" not in shown
    assert 'src="data:image/jpeg;base64,' in shown
    assert ".view()" in shown


def test_what_a_report_names_is_escaped(mapped):
    V, F, _ = mapped
    shown = cdcp_igl.check(V, F[1:] + 1)._repr_html_()
    assert "index out of range" in shown
    assert "<table>" in as_html("<b>", [("<i>", "a & b")])
    assert "&lt;b&gt;" in as_html("<b>", [("<i>", "a & b")])
    assert "a &amp; b" in as_html("<b>", [("<i>", "a & b")])


def test_plot_gives_axes(mapped):
    axes = mapped[2].plot()
    assert axes.shape == (4,)
    axes[0].set_title("mine")
    assert axes[0].figure is axes[3].figure


@pytest.mark.parametrize("suffix", [".npz", ".obj", ".ply"])
def test_a_map_is_saved_with_its_surface_in_its_unit(mapped, tmp_path, suffix):
    V, F, result = mapped
    file, by_hand = tmp_path / f"saved{suffix}", tmp_path / f"written{suffix}"
    result.save(file)
    write_map(by_hand, V, F, result.uv)
    assert (read_mesh(file)[0] == V).all()
    assert (read_mesh(file)[1] == F).all()
    if suffix != ".npz":
        assert file.read_bytes() == by_hand.read_bytes()


@pytest.mark.parametrize(
    ("suffix", "start"),
    [(".png", b"\x89PNG"), (".pdf", b"%PDF"), (".svg", b"<?xml"), (".html", b"<!doctype html>")],
)
def test_pictures_and_pages_are_saved(mapped, tmp_path, suffix, start):
    file = tmp_path / f"map{suffix}"
    mapped[2].save(file)
    assert file.read_bytes().startswith(start)
    assert list(tmp_path.iterdir()) == [file]


def test_the_report_is_saved(mapped, tmp_path):
    mapped[2].save(tmp_path / "map.json")
    assert json.loads((tmp_path / "map.json").read_text("utf-8"))["valid"] is True


def test_a_rectangle_is_saved_as_a_disk_is(tmp_path):
    V, F = grid(6, 8)
    V = V * [2, 1, 1]
    result = cdcp_igl.rectangle_map(V, F, [0, 7, 47, 40])
    for suffix in (".obj", ".npz", ".glb", ".png", ".html", ".json"):
        result.save(tmp_path / f"map{suffix}")
    assert len(list(tmp_path.iterdir())) == 6
    with np.load(tmp_path / "map.npz") as saved:
        assert (saved["uv"] == result.uv).all()
    lines = (line.split() for line in (tmp_path / "map.obj").read_text().splitlines())
    texture = np.array([words[1:] for words in lines if words[0] == "vt"], float)
    np.testing.assert_array_equal(texture, result.uv / max(1, result.modulus))
    assert texture.min() == 0
    assert texture.max() == 1
    report = json.loads((tmp_path / "map.json").read_text("utf-8"))
    assert report["valid"] is True
    assert report["modulus"] == result.modulus
    assert report["certificate"]["flipped_faces"] == []
    with pytest.raises(ValueError, match="no known type"):
        result.save(tmp_path / "map.txt")


def test_a_page_says_of_a_map_that_it_is_not_conformal(mapped):
    V, F = corridor(40)
    for result in (cdcp_igl.disk_map(V, F), cdcp_igl.surface_map(V, F, spread=np.inf)):
        assert "certified bijection, NOT CONFORMAL" in result._repr_html_()
    assert "NOT CONFORMAL" not in mapped[2]._repr_html_()


def test_an_unknown_suffix_is_refused(mapped, tmp_path):
    with pytest.raises(ValueError, match=r"'map\.txt' is of no known type"):
        mapped[2].save(tmp_path / "map.txt")
    assert list(tmp_path.iterdir()) == []


def test_positions_are_those_given():
    V, F = grid()
    for scale in (1e-30, 1, 3e20):
        mesh = cdcp_igl.disk_map(scale * V, F).mesh
        assert (mesh.positions == scale * V).all()
        assert (mesh.moved(7 * scale * V).positions == 7 * scale * V).all()
    assert (cdcp_igl.disk_map(V[:, :2], F).mesh.positions == V * [1, 1, 0]).all()
    assert np.isfinite(mesh.positions).all()


@pytest.fixture(scope="module")
def executed():
    import nbformat
    from nbclient import NotebookClient

    book = nbformat.read(NOTEBOOK, 4)
    NotebookClient(book, timeout=120, kernel_name="python3").execute()
    return book


@pytest.mark.filterwarnings("default")
def test_the_notebook_of_the_gallery_runs_and_its_page_lives(executed, tmp_path):
    from nbconvert import HTMLExporter
    from selenium.webdriver.common.by import By
    from selenium.webdriver.support.ui import WebDriverWait

    outputs = [output for cell in executed.cells for output in cell.get("outputs", [])]
    assert not [output for output in outputs if output.output_type == "error"]
    assert sum("<iframe" in output.get("data", {}).get("text/html", "") for output in outputs) == 1
    file = tmp_path / "notebook.html"
    file.write_text(HTMLExporter().from_notebook_node(executed)[0], encoding="utf-8")
    driver = chromium(*SOFTWARE_WEBGL)
    try:
        driver.get(file.as_uri())
        frame = driver.find_element(By.TAG_NAME, "iframe")
        driver.execute_script("arguments[0].scrollIntoView()", frame)
        driver.switch_to.frame(frame)
        WebDriverWait(driver, 30).until(
            lambda page: page.execute_script("return document.body.dataset.state") == "ready"
        )
    finally:
        driver.quit()


def test_the_notebook_is_kept_without_outputs():
    cells = json.loads(NOTEBOOK.read_text("utf-8"))["cells"]
    assert all(not cell.get("outputs") for cell in cells)


def test_every_result_shows_itself():
    V, F = grid(6, 8)
    rectangle = cdcp_igl.rectangle_map(V, F, [0, 7, 47, 40])
    several = cdcp_igl.surface_map(*NASTY["closed"][1:3])
    assert repr(several).startswith("SurfaceMap(4 faces onto 1 disk")
    for result, name in ((rectangle, "modulus"), (several, "spread of scale")):
        assert "\n" not in repr(result)
        shown = result._repr_html_()
        assert f">{name}</th>" in shown
        assert "<iframe" in shown
