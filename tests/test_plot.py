"""Figures of maps: what is drawn, from where it is seen, and what stands beside it."""

import tracemalloc
from io import BytesIO

import numpy as np
import pytest
from commands import printed
from meshes import cells

from cdcp_igl import cdcp, disk_map, rectangle_map, surface_map
from cdcp_igl.plot import side_by_side
from cdcp_igl.plot.raster import in_picture, rasterize
from cdcp_igl.plot.scene import SQUARES, Scene
from cdcp_igl.plot.viewpoint import choose_viewpoint


def grid(n, height):
    x, y, F = cells(n, n)
    x, y = 2 * x / (n - 1) - 1, 2 * y / (n - 1) - 1
    return np.column_stack([x, y, height(x, y)]), F


def nearly_closed_sphere(n=24):
    """A sphere but for a hole around its south pole."""
    V, F = grid(n, lambda x, y: 0 * x)
    x, y, _ = V.T
    radius = np.maximum(abs(x), abs(y))
    polar, azimuth = 2.8 * radius, np.arctan2(y, x)
    sphere = np.column_stack(
        [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)]
    )
    return sphere, F


@pytest.fixture(scope="module")
def drawn():
    """A map of three spheres onto disks, and the axes on which it is drawn."""
    V, F = nearly_closed_sphere()
    result = surface_map(np.vstack([V, 0.5 * V + 3, V - 3]), np.vstack([F, F + 576, F + 2 * 576]))
    return result, result.plot(name="spheres")


def test_picture(drawn):
    result, axes = drawn
    figure = axes[0].figure
    assert axes.tolist() == figure.axes
    assert len(axes) == 4
    assert "spheres, 1,728 vertices" in figure.get_suptitle()
    assert "0 flipped faces" in figure.get_suptitle()
    file = BytesIO()
    figure.savefig(file, dpi=30)
    assert file.getvalue().startswith(b"\x89PNG")
    assert axes[1].get_title() == "3 charts in the same colours"
    image = axes[1].images[0].get_array()
    for part in np.split(in_picture(result.packed().reshape(-1, 2), len(image)), 3):
        x, y = part.mean(axis=0).astype(int)
        assert image[y, x, 3] == 255


def test_colours_of_surface_and_disk_agree():
    V, F = grid(20, lambda x, y: 0 * x)
    scene = Scene(V, F, 40)
    surface, disk = scene.by_normal(), scene.disk(disk_map(V, F).uv)
    assert len(np.unique(surface[surface[..., 3] == 255], axis=0)) == 1
    np.testing.assert_array_equal(surface[20, 20], disk[20, 20])


def test_what_a_large_slanted_face_hides_is_hidden():
    """Under a roof, nearer than the middle of its slope: only the depth at its place tells."""
    roof = [[-10, -10, 0], [0, -10, 10], [0, 10, 10], [-10, 10, 0], [10, -10, 0], [10, 10, 0]]
    small = np.array([[0, 0, 0], [0.2, 0, 0], [0, 0.2, 0]])
    below, above = (small + np.array(place) for place in ([1, 0, 7], [1, 3, 9.5]))
    V = np.vstack([roof, below, above])
    F = np.array([[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2], [6, 7, 8], [9, 10, 11]])
    assert set(Scene(V, F, 200).surface.face.ravel()) == {-1, 0, 1, 2, 3, 5}


def test_a_face_without_area_hides_nothing():
    V = np.array([[-1.0, -1, 0], [1, -1, 0], [0, 1, 0], [0, 0, 1]])
    shown = rasterize(V, np.array([[0, 1, 2], [0, 3, 3], [3, 3, 3]]), 30).face
    assert set(shown.ravel()) == {-1, 0}


def test_a_large_face_needs_little_memory():
    V, F = np.array([[0.0, 0], [1, 0], [0, 1]]), np.array([[0, 1, 2]])
    tracemalloc.start()
    raster = rasterize(V, F, 600)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 150 * raster.face.size
    assert raster.seen.mean() == pytest.approx(0.96**2 / 2, abs=0.01)


def test_the_checkerboard_has_as_many_squares_as_it_says():
    V, F = grid(4, lambda x, y: 0 * x)
    row = Scene(V, F, 240).checkerboard(V[:, :2])[120, 6:-6, 2]
    assert np.count_nonzero(np.diff((row > 200).astype(int))) == SQUARES - 1


def test_the_histogram_says_what_its_line_and_its_band_are(drawn):
    result, (_, _, _, axes) = drawn
    assert 98.5 < sum(bar.get_height() for bar in axes.containers[0]) < 100  # all but the tail
    mean, sd = result.distortion.mean, result.distortion.sd
    legend = axes.get_legend()
    said = [text.get_text() for text in legend.get_texts()]
    assert said[:2] == [f"mean {mean:.3f}°", f"± SD, standard deviation {sd:.3f}°"]
    line, band = axes.lines[0], axes.patches[-1]
    assert line.get_xdata()[0] == mean
    assert band.get_label() == said[1]
    assert band.get_window_extent().width < axes.get_window_extent().width
    reach = axes.transData.inverted().transform(band.get_window_extent())[:, 0]
    np.testing.assert_allclose(reach, [max(mean - sd, 0), mean + sd], atol=1e-9)


def test_a_rectangle_stands_upright():
    V, F = grid(9, lambda x, y: 0.1 * x)
    V = V[:, [1, 0, 2]] * [-1, 2, 1]  # turned by a quarter
    uv = rectangle_map(V, F, [0, 8, 80, 72]).uv
    seen = Scene(V, F, 60, turns=False).disk(uv)[..., 3] > 0
    assert seen[seen.any(axis=1)][:, seen.any(axis=0)].all()


def viewpoint(V, F):
    view = choose_viewpoint(V, F)
    np.testing.assert_allclose(view @ view.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(view) > 0
    return view


def test_an_open_surface_is_seen_from_its_outside():
    V, F = grid(9, lambda x, y: 0.2 * x * y)
    np.testing.assert_allclose(viewpoint(V, F), np.eye(3), atol=0.02)
    np.testing.assert_allclose(viewpoint(V, F[:, ::-1])[2], [0, 0, -1], atol=0.02)


def test_a_nearly_closed_surface_stands_on_its_opening():
    right, up, towards = viewpoint(*nearly_closed_sphere())
    assert up[2] > 0.9
    assert abs(towards[2]) < 0.36
    assert abs(right[2]) < 1e-6


def test_pyplot_is_left_alone():
    code = (
        "import sys, cdcp_igl; V, F, _ = cdcp_igl.datasets.spherical_cap(2);"
        "cdcp_igl.disk_map(V, F).view_html(); cdcp_igl.plot.side_by_side;"
        "print('matplotlib' in sys.modules, 'matplotlib.pyplot' in sys.modules)"
    )
    assert printed(code) == ["True False"]


def test_the_lion_shows_its_face(real_mesh):
    V, F = real_mesh("chinese_lion_17334")
    view = viewpoint(V, F.astype(np.int64))
    assert view[1, 1] > 0.5
    assert view[2, 2] > 0


def test_maps_side_by_side():
    V, F = grid(8, lambda x, y: 0.2 * x * y)
    uv = cdcp(V, F)
    figure = side_by_side([(V, F, [("one", 1.5, uv), ("two", np.nan, None)]), (V, F, [])])
    titles = [axes.get_title() for axes in figure.axes]
    assert titles == ["64 vertices", "one  1.500°", "two", "64 vertices"]
    assert [len(axes.images) for axes in figure.axes] == [1, 1, 0, 1]
    assert figure.axes[2].texts[0].get_text() == "no map"
    assert "mean of the angular distortion" in figure.get_supxlabel()


@pytest.mark.parametrize(
    ("names", "columns"), [(["", "CAPITALS_" * 5], 1), (["a$b$ c.obj", "three_lines_" * 4], 7)]
)
def test_names_of_files_lie_in_the_picture_and_on_no_image(names, columns):
    V, F = grid(4, lambda x, y: 0 * x)
    figure = side_by_side([(V, F, [("lscm", np.nan, None)] * columns)] * 2, names=names)
    figure.draw_without_rendering()  # dollars are no formula
    for axes, name in zip(figure.axes[:: columns + 1], names, strict=True):
        assert axes.get_title().replace("\n", "") == name + "16 vertices"
    titles = [axes.title.get_window_extent() for axes in figure.axes]
    images = [image.get_window_extent() for axes in figure.axes for image in axes.images]
    for title in titles:
        assert figure.bbox.containsx(title.x0)
        assert figure.bbox.containsx(title.x1)
        assert figure.bbox.containsy(title.y1)
        assert not title.count_overlaps(images)


def test_disk_is_turned_to_match_the_view():
    V, F = grid(20, lambda x, y: -0.3 * (x**2 + y**2))
    z = (cdcp(V, F) @ [1, 1j]) * np.exp(2j)
    scene = Scene(V, F, 60)
    straight, turned = scene.disk(cdcp(V, F)), scene.disk(np.column_stack([z.real, z.imag]))
    middle = slice(20, 40)
    assert abs(straight[middle, middle].astype(int) - turned[middle, middle]).max() <= 1
    for image in (scene.by_normal(), turned):  # normals lean to the right on the right
        red = image[middle, middle, 0].astype(float)
        assert red[:, 10:].mean() > red[:, :10].mean() + 10
    np.testing.assert_allclose(scene.extent(cdcp(V, F)), [-1, 1, -1, 1], atol=0.1)
