"""Surfaces that are no disks, and the page about a batch."""

import re

import meshes
import numpy as np
import pytest
from batches import command, contents, lines, write_surfaces
from cdcp_igl.batching.stamps import read_stamp
from matplotlib import image as mpimg

import cdcp_igl
from cdcp_igl.batching import batch


@pytest.fixture
def scans(tmp_path):
    return write_surfaces(tmp_path / "scans", 3)


def write_parts(folder):
    """A surface of two parts, one of them turned over, and a closed one."""
    V, F = meshes.grid()
    two = np.vstack([F, F[:, ::-1] + len(V)])
    np.savez(folder / "two.npz", V=np.vstack([V, V + np.array([20, 0, 0])]), F=two)
    V = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    np.savez(folder / "closed.npz", V=V, F=[[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])


def test_surfaces_that_are_no_disks(scans, tmp_path):
    write_parts(scans)
    assert len(batch([scans], tmp_path / "disks").failed) == 2
    made = batch([scans], tmp_path / "maps", cut=True, refine=1)
    assert made.failed == ()
    records = {record.name: record for record in made.records}
    assert {name: record.disks for name, record in records.items()} == {
        **{f"surface_{i:03}": 1 for i in range(3)},
        "two": 2,
        "closed": 1,
    }
    assert all(np.isfinite(record.area) for record in made.records)
    assert any("cut open" in change for change in records["closed"].changes)
    for name in records:
        V, F = cdcp_igl.io.read_mesh(scans / f"{name}.npz")
        result = cdcp_igl.surface_map(V, F, refine=1)
        with np.load(tmp_path / "maps" / f"{name}.npz") as saved:
            np.testing.assert_array_equal(saved["uv"], result.uv)
            np.testing.assert_array_equal(saved["face_disk"], result.face_disk)
            np.testing.assert_array_equal(saved["F"][saved["face_index"]], F)


@pytest.mark.parametrize("format", ["obj", "ply", "glb"])
def test_their_texture_coordinates_are_side_by_side(scans, tmp_path, format):
    write_parts(scans)
    assert batch([scans], tmp_path / "maps", cut=True, format=format).failed == ()
    if format == "obj":
        text = (tmp_path / "maps" / "two.obj").read_text()
        texture = np.array(re.findall(r"^vt (\S+) (\S+)$", text, re.MULTILINE), float)
        assert texture.min() >= 0
        assert texture.max() <= 1
        V, F = cdcp_igl.io.read_mesh(scans / "two.npz")
        packed = cdcp_igl.surface_map(V, F).packed().reshape(-1, 2)
        assert {*map(tuple, texture)} == {*map(tuple, packed)}


@pytest.mark.parametrize(
    "options",
    [{"cut": True, "clean": True}, {"cut": True, "center": 3}, {"fill": 0.1}, {"spread": 1}],
)
def test_options_that_do_not_go_together(scans, tmp_path, options):
    with pytest.raises(ValueError, match=r"leave out clean|must be a method|that are cut"):
        batch([scans], tmp_path / "maps", **options)


def test_a_page_about_the_batch(scans, tmp_path):
    write_parts(scans)
    np.savez(scans / "<b>torn & bad.npz", V=meshes.grid()[0], F=[[0, 1, 99]])
    page = tmp_path / "page.html"
    done = command(scans, tmp_path / "maps", "--cut", "--report", page)
    assert done.returncode == 4
    text = page.read_text()
    assert "5 of 6 surfaces mapped" in text
    assert text.count("data:image/jpeg;base64,") == 5
    assert "&lt;b&gt;torn &amp; bad" in text
    assert "<b>" not in text
    assert "index out of range" in text or "MeshError" in text
    assert not re.search(r"(src|href)=\"(?!data:)", text)
    assert text.count("<rect") == 30
    # The results are the same, and a page can be had later.
    assert batch([scans], tmp_path / "plain", cut=True).done
    assert contents(tmp_path / "plain") == contents(tmp_path / "maps")
    batch([scans], tmp_path / "maps", cut=True, report=page)
    assert page.read_text() == text
    assert len(lines(tmp_path / "maps")) == 6


def test_pictures_of_others_are_not_overwritten(scans, tmp_path):
    out, page = tmp_path / "maps", tmp_path / "page.html"
    other = out / "thumbnails" / "surface_001.jpg"
    other.parent.mkdir(parents=True)
    other.write_bytes(b"thesis")
    [refused] = batch([scans], out, report=page).failed
    assert (refused.name, refused.error) == ("surface_001", "FileExistsError")
    assert refused.message.startswith(f"{other} is there")
    assert other.read_bytes() == b"thesis"
    other.unlink()
    for format in ("npz", "obj"):  # one picture will do for both
        assert batch([scans], out, report=page, format=format).failed == ()
        assert read_stamp(other) == read_stamp(out / f"surface_001.{format}")
    assert mpimg.imread(other).shape == (64, 64, 3)
