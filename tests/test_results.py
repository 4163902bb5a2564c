"""What all results share: printing, reports, notebooks, files by their suffix, images."""

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
from cdcp_igl.errors import counted
from cdcp_igl.io import read_mesh, write_map
from cdcp_igl.printing import as_html

NOTEBOOK = Path(__file__).parents[1] / "docs" / "examples" / "notebook.ipynb"
KINDS = "disk", "free", "rectangle", "surface"


@pytest.fixture(scope="module")
def mapped():
    """A surface, and a map of each kind; the surface map has the surface twice, far apart."""
    V, F = grid(12, 15)
    V = 100 * V
    return {
        "disk": (V, F, cdcp_igl.disk_map(V, F)),
        "free": (V, F, cdcp_igl.free_map(V, F, refine=1)),
        "rectangle": (V, F, cdcp_igl.rectangle_map(V, F, [0, 14, 179, 165])),
        "surface": (*twice(V, F), cdcp_igl.surface_map(*twice(V, F))),
    }


def twice(V, F):
    return np.vstack([V, V + 3000]), np.vstack([F, F + len(V)])


def test_what_is_lost_in_single_precision(tmp_path, caplog):
    """A strip 16 times as long as wide, whose ends are tiny on the disk."""
    V, F = corridor(16, 4)
    result = cdcp_igl.disk_map(V, F)
    x, y = ((result.uv + 1) / 2).astype(np.float32).astype(np.longdouble)[F].T  # products are exact
    area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])
    lost = np.count_nonzero(area <= 0)
    report = result.report()["lost_in_single_precision"]
    assert 10 < lost == report["faces"] < len(F) / 2
    assert report["share_of_area"] == pytest.approx(lost / len(F))
    assert f"{lost} faces without area" in str(result)
    caplog.clear()
    result.save(tmp_path / "a.obj")
    assert not caplog.records
    result.save(tmp_path / "a.glb")
    assert f"{lost} faces have no area" in caplog.text
    assert f"{lost / len(F):.2g} of the surface" in caplog.text
    caplog.clear()
    atlas = cdcp_igl.surface_map(*corridor(14, 8), outline="disk", scale_variation=np.inf)
    faces, share = atlas.lost_in_single_precision()
    assert faces > 100
    said = counted(faces, "face", "faces")
    assert f"in single precision {said} without area, {share:.2g} of" in caplog.text
    caplog.clear()
    assert cdcp_igl.surface_map(V, F, outline="free").lost_in_single_precision() == (0, 0)
    assert not caplog.records


# -- what is printed -------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "title", "short"),
    [
        ("disk", "disk map of 180 vertices", "DiskMap(180 vertices: valid, mean distortion "),
        ("free", "free map of 180 vertices", "FreeMap(180 vertices: valid, mean distortion "),
        ("rectangle", "rectangle map of 180 vertices", "RectangleMap(180 vertices: valid, modulus"),
        (
            "surface",
            "surface map of 616 faces onto 2 charts",
            "SurfaceMap(616 faces onto 2 charts: ",
        ),
    ],
)
def test_printing(mapped, kind, title, short):
    _, _, result = mapped[kind]
    first, *lines = str(result).splitlines()
    assert first == f"{title}: valid"
    assert repr(result).startswith(short)
    assert "\n" not in repr(result)
    names = [line[2:22].strip() for line in lines]
    assert names[0] == "angular distortion"
    assert names[-1] == "seconds"
    assert f"  certificate         {result.certificate}" in lines
    shown = result._repr_html_()
    for line in lines:
        assert f">{line[2:22].strip()}</th>" in shown
        assert f">{line[22:]}</td>" in shown
    assert "certified bijection</p>" in unescape(re.search(r'srcdoc="(.*?)"', shown, re.DOTALL)[1])


def test_a_map_that_is_not_valid_says_so_and_is_not_drawn(mapped):
    _, _, result = mapped["disk"]
    failed = replace(result, certificate=replace(result.certificate, boundary_monotone=False))
    assert "NOT VALID" in repr(failed)
    assert "NOT VALID" in str(failed)
    assert "<iframe" not in failed._repr_html_()


def test_a_map_that_is_not_conformal_says_which_disk_and_why():
    V, F = corridor(40)
    single = cdcp_igl.disk_map(V, F, refine=0)
    square, G = grid(12, 15)
    several = cdcp_igl.surface_map(
        np.vstack([square - 30, np.column_stack([V, 0 * V[:, 0]])]),
        np.vstack([G, F + len(square)]),
        outline="disk",
        scale_variation=np.inf,
        refine=0,
    )
    worst = np.argmax([disk.distortion.mean for disk in several.charts])
    for result in (single, several):
        assert not result.conformal
        assert result.verdict == "valid, NOT CONFORMAL"
        assert result.conformality.reasons[0] in str(result)
        assert result.report()["not_conformal_because"] == list(result.conformality.reasons)
    assert "certified bijection, NOT CONFORMAL" in several._repr_html_()
    assert several.conformality.reasons == tuple(
        f"charts[{worst}]: {reason}" for reason in several.charts[worst].conformality.reasons
    )


def test_a_mesh_report_shows_itself():
    V, F = grid(12, 15)
    assert repr(cdcp_igl.check(V, F)) == "MeshReport(180 vertices, 308 faces: a disk)"
    assert "closed surface" in repr(cdcp_igl.check(*NASTY["closed"][1:3]))
    shown = cdcp_igl.check(V, F[1:] + 1)._repr_html_()
    assert "<table>" in shown
    assert "index out of range" in shown


def test_what_a_table_names_is_escaped():
    shown = as_html("<b>", [("<i>", "a & b")])
    for text in ("<table>", "&lt;b&gt;", "&lt;i&gt;", "a &amp; b"):
        assert text in shown


# -- reports ---------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_a_report_has_json_types_and_a_flat_row(mapped, kind):
    V, F, result = mapped[kind]
    report = result.report()
    assert json.loads(json.dumps(report)) == report
    assert (report["vertices"], report["faces"]) == (len(V), len(F))
    assert report["valid"] is report["conformal"] is True
    assert report["certificate"]["flipped_faces"] == []
    assert report["seconds"] == result.timings
    assert min(result.timings.values()) >= 0
    row = result.report(flat=True)
    assert row["angular_distortion_degrees_mean"] == result.distortion.mean
    assert row["certificate_winding_number"] == 1
    assert row["not_conformal_because"] == row["certificate_flipped_faces"] == ""
    assert all(value is None or isinstance(value, str | int | float) for value in row.values())


def test_a_flat_row_spells_lists_out(mapped):
    rectangle, surface = mapped["rectangle"][2], mapped["surface"][2]
    assert rectangle.report(flat=True)["corners"] == "0, 14, 179, 165"
    row = replace(surface, changes=("one", "two")).report(flat=True)
    assert row["changes"] == "one; two"
    assert row["charts"] == 2


@pytest.mark.parametrize("kind", KINDS)
def test_area_distortion_is_that_of_the_function(mapped, kind):
    V, F, result = mapped[kind]
    expected = cdcp_igl.area_distortion(V, F, packed_at_vertices(V, F, result))
    np.testing.assert_allclose(result.area_distortion(), expected, atol=1e-12)


def packed_at_vertices(V, F, result):
    """The coordinates in the unit square, of maps that have one place for each vertex."""
    packed = result.packed()
    if packed.ndim == 2:
        return packed
    uv = np.empty((len(V), 2))
    uv[F] = packed
    return uv


def test_faces_that_were_turned_over_have_an_area(mapped):
    V, F, result = mapped["surface"]
    turned = np.where((np.arange(len(F)) % 5 == 0)[:, None], F[:, ::-1], F)
    other = cdcp_igl.surface_map(V, turned)
    np.testing.assert_allclose(other.area_distortion(), result.area_distortion(), atol=1e-9)


# -- in a notebook ---------------------------------------------------------------------


def test_what_is_shown_does_not_depend_on_the_unit():
    V, F = grid(8, 9)
    F = np.delete(F, 40, axis=0)
    small, large = (cdcp_igl.surface_map(np.ldexp(V, exponent), F) for exponent in (-900, 1010))
    assert small.view_html() == large.view_html()


def test_a_large_surface_is_a_picture_in_a_notebook():
    V, F, _ = cdcp_igl.datasets.square(102)
    result = cdcp_igl.disk_map(V, F)
    assert len(V) > 20_000
    shown = result._repr_html_()
    assert "<iframe" not in shown
    assert 'src="data:image/jpeg;base64,' in shown
    assert ".view()" in shown


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
def test_the_notebook_of_the_gallery_runs_and_its_page_lives(tmp_path):
    import nbformat
    from nbclient import NotebookClient
    from nbconvert import HTMLExporter
    from selenium.webdriver.support.ui import WebDriverWait

    book = nbformat.read(NOTEBOOK, 4)
    assert all(not cell.get("outputs") for cell in book.cells)  # it is kept without them
    NotebookClient(book, timeout=120, kernel_name="python3").execute()
    outputs = [output for cell in book.cells for output in cell.get("outputs", [])]
    assert not [output for output in outputs if output.output_type == "error"]
    assert sum("<iframe" in output.get("data", {}).get("text/html", "") for output in outputs) == 1
    file = tmp_path / "notebook.html"
    file.write_text(HTMLExporter().from_notebook_node(book)[0], encoding="utf-8")
    driver = chromium(*SOFTWARE_WEBGL)
    try:
        driver.get(file.as_uri())
        frame = driver.find_element("tag name", "iframe")
        driver.execute_script("arguments[0].scrollIntoView()", frame)
        driver.switch_to.frame(frame)
        WebDriverWait(driver, 30).until(
            lambda page: page.execute_script("return document.body.dataset.state") == "ready"
        )
    finally:
        driver.quit()


# -- files and images ------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_a_map_is_saved_with_its_surface_in_its_unit(mapped, tmp_path, kind):
    V, F, result = mapped[kind]
    for suffix in (".npz", ".obj", ".ply"):
        file, by_hand = tmp_path / f"saved{suffix}", tmp_path / f"written{suffix}"
        result.save(file)
        write_map(by_hand, V, F, result)
        W, G = read_mesh(file)
        assert (W == V).all()
        assert (G == F).all()
        if suffix != ".npz":  # which has the time
            assert file.read_bytes() == by_hand.read_bytes()
    with np.load(tmp_path / "saved.npz") as saved:
        assert (saved["uv"] == result.uv).all()
    lines = (line.split() for line in (tmp_path / "saved.obj").read_text().splitlines())
    texture = {tuple(map(float, words[1:])) for words in lines if words[0] == "vt"}
    assert texture == set(map(tuple, result.packed().reshape(-1, 2)))
    assert 0 <= np.min(list(texture)) <= np.max(list(texture)) <= 1


def test_vertices_that_no_face_uses_are_not_saved(mapped, tmp_path):
    V, F, _ = mapped["surface"]
    unused = np.full((1, 3), np.nan)
    result = cdcp_igl.surface_map(np.vstack([unused, V, unused]), F + 1)
    result.save(tmp_path / "map.obj")
    W, G = read_mesh(tmp_path / "map.obj")
    assert (W == V).all()
    assert (G == F).all()


@pytest.mark.parametrize(
    ("kind", "suffix", "start"),
    [
        ("disk", ".svg", b"<?xml"),
        ("surface", ".html", b"<!doctype html>"),
        ("surface", ".json", b"{"),
    ],
)
def test_pictures_pages_and_reports_are_saved(mapped, tmp_path, kind, suffix, start):
    file, (_, _, result) = tmp_path / f"map{suffix}", mapped[kind]
    result.save(file)
    assert file.read_bytes().startswith(start)
    assert list(tmp_path.iterdir()) == [file]
    if suffix == ".json":
        assert json.loads(file.read_text("utf-8")) == result.report()


def test_an_unknown_suffix_is_refused(mapped, tmp_path):
    with pytest.raises(ValueError, match=r"'map\.txt' is of no known type"):
        mapped["disk"][2].save(tmp_path / "map.txt")
    assert list(tmp_path.iterdir()) == []


def test_positions_are_those_given():
    V, F = grid()
    for scale in (1e-30, 1, 3e20):
        mesh = cdcp_igl.disk_map(scale * V, F).mesh
        assert (scale * V == mesh.V).all()
        assert (7 * scale * V == mesh.moved(7 * scale * V).V).all()
    assert (cdcp_igl.disk_map(V[:, :2], F).mesh.V == V * [1, 1, 0]).all()
    assert np.isfinite(mesh.V).all()


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_baked_lies_where_the_map_is_packed(mapped, kind):
    """Texture coordinates baked as colours are the coordinates of the pixels."""
    V, F, result = mapped[kind]
    packed = packed_at_vertices(V, F, result)
    image = result.bake(packed, size=64)
    np.testing.assert_allclose(result.bake(lambda P: 3 * P, 64), result.bake(3 * V, 64), atol=1e-12)
    row, column = np.mgrid[:64, :64]
    pixels = np.stack([(column + 0.5) / 64, 1 - (row + 0.5) / 64], axis=-1)
    away = np.linalg.norm(image - pixels, axis=2)
    inside = away < 1e-9
    # The area of the image is that of the pixels in it.
    corners = packed[F]
    (a, b), (c, d) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
    assert inside.mean() == pytest.approx((a * d - b * c).sum() / 2, abs=0.03)
    # Beside it lies what is near: no farther than the nearest pixel of the image, and one more.
    y, x = np.nonzero(~inside)
    nearest = np.hypot(*(pixels[inside][:, None] - pixels[y, x]).transpose(2, 0, 1)).min(axis=0)
    assert (away[y, x] < nearest + 2 / 64).all()


@pytest.mark.parametrize("kind", KINDS)
def test_an_image_is_baked_from_its_old_place_to_the_new_one(mapped, kind):
    """One whose colours are the places of its pixels, which lie by a projection of the surface."""
    V, F, result = mapped[kind]
    x, y = np.meshgrid((np.arange(32) + 0.5) / 32, 1 - (np.arange(64) + 0.5) / 64)
    low, reach = V.min(axis=0), np.ptp(V, axis=0).max()
    old = 0.1 + 0.8 * (V - low)[:, :2] / reach
    for uv in (old, old[F]):
        image = result.bake(np.dstack([x, y, x]), 64, uv=uv)
        np.testing.assert_allclose(image[..., :2], result.bake(old, 64), atol=1e-9)
    beside = result.bake(np.dstack([x, y, x]), 64, uv=old + 7)  # where the image comes again
    np.testing.assert_allclose(beside[..., :2], result.bake(old, 64), atol=1e-9)


def test_what_cannot_be_baked_is_refused():
    _, V, F, _ = NASTY["annulus"]
    with pytest.raises(ValueError, match="no pixel lies on the surface"):
        cdcp_igl.annulus_map(V, F).bake(V, size=1)  # whose middle is in the hole
