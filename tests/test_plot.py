import subprocess
import sys
from io import BytesIO

import numpy as np
import pytest

from cdcp_igl import cdcp, disk_map
from cdcp_igl.plot import picture, side_by_side
from cdcp_igl.plot.viewpoint import choose_viewpoint


def grid(n, height):
    x, y = (c.ravel() for c in np.meshgrid(np.linspace(-1, 1, n), np.linspace(-1, 1, n)))
    V = np.column_stack([x, y, height(x, y)])
    a = np.arange(n * n).reshape(n, n)[:-1, :-1].ravel()
    F = np.vstack([np.column_stack([a, a + 1, a + n + 1]), np.column_stack([a, a + n + 1, a + n])])
    return V, F


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


@pytest.mark.parametrize("columns", [2, 3])
def test_picture(columns):
    V, F = grid(10, lambda x, y: 0 * x)
    V = V[:, :columns]
    figure = picture(V, F, disk_map(V, F), name="flat square")
    assert len(figure.axes) == 3
    assert "flat square, 100 vertices" in figure.get_suptitle()
    assert "0 flipped faces" in figure.get_suptitle()
    file = BytesIO()
    figure.savefig(file)
    assert file.getvalue().startswith(b"\x89PNG")


def test_colours_of_surface_and_disk_agree():
    V, F = nearly_closed_sphere()
    surface, disk, _ = picture(V, F, disk_map(V, F)).axes
    np.testing.assert_array_equal(
        surface.collections[0].get_facecolor(), disk.collections[0].get_facecolor()
    )


def test_histogram_accounts_for_all_corners_but_the_tail():
    V, F = nearly_closed_sphere()
    bars = picture(V, F, disk_map(V, F)).axes[2].containers[0]
    assert 98.5 < sum(bar.get_height() for bar in bars) < 100


def test_viewpoint_is_a_rotation():
    for V, F in (nearly_closed_sphere(), grid(9, lambda x, y: x * y)):
        view = choose_viewpoint(V, F)
        np.testing.assert_allclose(view @ view.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(view) > 0


def test_an_open_surface_is_seen_from_its_outside():
    V, F = grid(9, lambda x, y: 0.2 * x * y)
    np.testing.assert_allclose(choose_viewpoint(V, F), np.eye(3), atol=0.02)
    np.testing.assert_allclose(choose_viewpoint(V, F[:, ::-1])[2], [0, 0, -1], atol=0.02)


def test_a_nearly_closed_surface_stands_on_its_opening():
    right, up, towards = choose_viewpoint(*nearly_closed_sphere())
    assert up[2] > 0.9
    assert abs(towards[2]) < 0.36
    assert abs(right[2]) < 1e-6


def test_pyplot_is_left_alone():
    code = "import sys, cdcp_igl.plot; print('matplotlib.pyplot' in sys.modules)"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert result.stdout == "False\n"


def test_the_lion_shows_its_face(real_mesh):
    V, F = real_mesh("chinese_lion_17334")
    view = choose_viewpoint(V, F.astype(np.int64))
    assert view[1, 1] > 0.5
    assert view[2, 2] > 0


def test_maps_side_by_side():
    V, F = grid(8, lambda x, y: 0.2 * x * y)
    uv = cdcp(V, F)
    figure = side_by_side([(V, F, [("one", 1.5, uv), ("two", np.nan, None)]), (V, F, [])])
    titles = [axes.get_title() for axes in figure.axes]
    assert titles == ["64 vertices", "one  1.500°", "two", "64 vertices", "", ""]
    assert [len(axes.collections) for axes in figure.axes] == [1, 1, 0, 1, 0, 0]
    assert figure.axes[2].texts[0].get_text() == "no map"


def test_disk_is_turned_to_match_the_view():
    V, F = grid(8, lambda x, y: 0.2 * x * y)
    turn = np.exp(2j)
    z = (cdcp(V, F) @ [1, 1j]) * turn
    drawn = [
        side_by_side([(V, F, [("", 0, uv)])]).axes[1].collections[0]._triangulation.x
        for uv in (cdcp(V, F), np.column_stack([z.real, z.imag]))
    ]
    np.testing.assert_allclose(drawn[0], drawn[1], atol=1e-12)
    assert np.corrcoef(drawn[0], V[:, 0])[0, 1] > 0.95
