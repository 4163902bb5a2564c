import os
import re
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import public_name

import cdcp_igl
from cdcp_igl import datasets
from cdcp_igl.surface.mesh import DiskMesh

ROOT = Path(__file__).parents[1]


@pytest.fixture
def no_data_directory(monkeypatch):
    monkeypatch.delenv("CDCP_IGL_DATA", raising=False)


def test_terrain_needs_no_network(no_data_directory):
    V, F = datasets.load("jacksboro_fault")
    report = cdcp_igl.check(V, F)
    assert report.is_disk
    assert (report.n_vertices, report.n_faces) == (138_632, 275_772)
    normal = np.cross(V[F[0, 1]] - V[F[0, 0]], V[F[0, 2]] - V[F[0, 0]])
    assert normal[2] > 0  # faces are counterclockwise seen from above
    assert 200 < V[:, 2].min() < V[:, 2].max() < 1500  # metres
    assert 25e3 < np.ptp(V[:, 0]) < 40e3


def test_data_directory_comes_first(tmp_path, monkeypatch):
    V, F, _ = datasets.spherical_cap(3)
    (tmp_path / "deep").mkdir()
    np.savez(tmp_path / "deep" / "chinese_lion.npz", V=V, F=F)
    np.savez(tmp_path / "mine.npz", V=2 * V, F=F)
    monkeypatch.setenv("CDCP_IGL_DATA", str(tmp_path))
    np.testing.assert_array_equal(datasets.load("chinese_lion")[0], V)
    np.testing.assert_array_equal(datasets.load("mine")[0], 2 * V)
    np.testing.assert_array_equal(datasets.load("mine.npz")[0], 2 * V)
    monkeypatch.setenv("CDCP_IGL_DATA", str(tmp_path / "nowhere"))
    with pytest.raises(FileNotFoundError, match="CDCP_IGL_DATA"):
        datasets.load("chinese_lion")


def test_unknown_name(no_data_directory):
    with pytest.raises(ValueError, match=r"'teapot'.*chinese_lion"):
        datasets.load("teapot")


def test_offline_error_says_both_ways_out(no_data_directory, tmp_path, monkeypatch):
    import pooch

    monkeypatch.setattr(pooch, "os_cache", lambda _: tmp_path)

    def unreachable(*_):
        raise ConnectionError

    monkeypatch.setattr(pooch, "retrieve", unreachable)
    with pytest.raises(OSError, match=r"connect to the network .* CDCP_IGL_DATA"):
        datasets.load("left_hand")


def test_the_pages_name_what_else_the_tests_use():
    if os.environ.get("CDCP_IGL_REQUIRE_DATA") != "1":
        pytest.skip("the directory may have any surfaces")
    page = (ROOT / "docs" / "reference" / "datasets.md").read_text("utf-8")
    listed = page.partition("## Not to be downloaded")[2].partition("## With known maps")[0]
    named = re.findall(r"^\| (`.*?`) \|", listed, re.MULTILINE)
    folder = Path(os.environ["CDCP_IGL_DATA"])
    there = {str(path.relative_to(folder).with_suffix("")) for path in folder.rglob("*.npz")}
    private = {name for name in there if public_name(name) is None}
    assert set(re.findall("`(.*?)`", " ".join(named))) == private


@pytest.mark.parametrize(
    ("module", "name"), [("pooch", "human_face"), ("matplotlib", "jacksboro_fault")]
)
def test_missing_extra_is_named(no_data_directory, monkeypatch, module, name):
    for loaded in [m for m in sys.modules if m.partition(".")[0] == module]:
        monkeypatch.delitem(sys.modules, loaded)
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(ImportError, match=r"pip install '\.\[(data|plot)\]'"):
        datasets.load(name)


@pytest.mark.parametrize("aspect", [1.01, 2, 8])
def test_the_rim_of_an_ellipse_is_on_the_circle(aspect):
    V, F, uv = datasets.ellipse(20, aspect)
    loop = DiskMesh(V, F).loop
    assert abs(np.linalg.norm(uv[loop], axis=1) - 1).max() < 1e-9
