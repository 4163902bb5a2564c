import os
import subprocess
import sys
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest

from cdcp_igl import disk_map
from cdcp_igl.plot import picture
from cdcp_igl.viewpoint import viewpoint

DATA = os.environ.get("CDCP_IGL_DATA")


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
        view = viewpoint(V, F)
        np.testing.assert_allclose(view @ view.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(view) > 0


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
    code = "import sys, cdcp_igl.plot; print('matplotlib.pyplot' in sys.modules)"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert result.stdout == "False\n"


@pytest.mark.skipif(not DATA, reason="CDCP_IGL_DATA is not set")
def test_the_lion_shows_its_face():
    with np.load(Path(DATA) / "chinese_lion_17334.npz") as mesh:
        view = viewpoint(mesh["V"], mesh["F"].astype(np.int64))
    assert view[1, 1] > 0.5
    assert view[2, 2] > 0
