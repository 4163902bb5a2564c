"""Surfaces that are no disks, and the page about a batch."""

import re

import meshes
import numpy as np
import pytest
from batches import batch, contents, invoke, lines, write_surfaces

import cdcp_igl


@pytest.fixture
def scans(tmp_path):
    """Two disks; a surface of two parts, one of them flipped; and a closed one."""
    folder = write_surfaces(tmp_path / "scans", 2)
    V, F = meshes.grid()
    two = np.vstack([F, F[:, ::-1] + len(V)])
    np.savez(folder / "two.npz", V=np.vstack([V, V + np.array([20, 0, 0])]), F=two)
    _, V, F, _ = meshes.NASTY["closed"]
    np.savez(folder / "closed.npz", V=V, F=F)
    return folder


def test_surfaces_that_are_no_disks(scans, tmp_path):
    assert len(batch([scans], tmp_path / "disks").failed) == 2
    made = batch([scans], tmp_path / "maps", cut=True, refine=1, solver="scipy")
    assert made.failed == ()
    records = {record.name: record for record in made.records}
    disks = {name: record.disks for name, record in records.items()}
    assert disks == {"surface_000": 1, "surface_001": 1, "two": 2, "closed": 1}
    assert all(np.isfinite(record.area) for record in made.records)
    assert any("cut open" in change for change in records["closed"].changes)
    for name in records:
        V, F = cdcp_igl.io.read_mesh(scans / f"{name}.npz")
        result = cdcp_igl.surface_map(V, F, refine=1, solver="scipy")
        with np.load(tmp_path / "maps" / f"{name}.npz") as saved:
            np.testing.assert_array_equal(saved["uv"], result.uv)
            np.testing.assert_array_equal(saved["face_chart"], result.face_chart)
            np.testing.assert_array_equal(saved["F"][saved["face_index"]], F)


def test_a_page_about_the_batch(scans, tmp_path):
    np.savez(scans / "<b>torn & bad.npz", V=meshes.grid()[0], F=[[0, 1, 99]])
    page = tmp_path / "page.html"
    assert invoke(scans, tmp_path / "maps", "--cut", "--report", page).exit_code == 4
    text = page.read_text()
    assert "4 of 5 surfaces mapped" in text
    assert "&lt;b&gt;torn &amp; bad" in text
    assert "<b>" not in text
    assert "index out of range" in text or "MeshError" in text
    assert not re.search(r"(src|href)=", text)
    assert text.count("<rect") == 30
    # The results are the same without it, and it can be had later.
    assert batch([scans], tmp_path / "plain", cut=True).done
    assert contents(tmp_path / "plain") == contents(tmp_path / "maps")
    batch([scans], tmp_path / "maps", cut=True, report=page)
    assert page.read_text() == text
    assert len(lines(tmp_path / "maps")) == 5


@pytest.mark.parametrize("name", ["summary.csv", "page.html"])
def test_summaries_and_reports_of_others_are_not_overwritten(scans, tmp_path, name):
    (tmp_path / "maps").mkdir()
    other = tmp_path / "maps" / name
    other.write_text("thesis")
    done = invoke(scans, tmp_path / "maps", "--report", tmp_path / "maps" / "page.html")
    assert done.exit_code == 1
    assert f"{other}: is no" in done.stderr
    assert [path.name for path in (tmp_path / "maps").iterdir()] == [name]
    assert other.read_text() == "thesis"
