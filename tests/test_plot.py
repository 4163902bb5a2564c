import meshes
import numpy as np
import pytest
from matplotlib.image import imread

import cdcp_igl
from cdcp_igl import datasets
from cdcp_igl.plot import _turned_like, picture


def drawn(tmp_path, V, F):
    figure = picture(V, F, cdcp_igl.disk_map(V, F), name="name")
    figure.savefig(tmp_path / "picture.png")
    return figure, imread(tmp_path / "picture.png")


@pytest.mark.parametrize(
    "mesh",
    [
        meshes.grid(),
        meshes.fan(),
        meshes.TRIANGLE,
        datasets.square(4)[:2],
        datasets.paraboloid(6)[:2],
    ],
    ids=["grid", "fan", "triangle", "square", "paraboloid"],
)
def test_three_panels(tmp_path, mesh):
    figure, image = drawn(tmp_path, *mesh)
    assert len(figure.axes) == 3
    assert "name" in figure.get_suptitle()
    assert "0 flipped faces" in figure.get_suptitle()
    # Ink in each third; the disk fills its own.
    ink = (image[..., :3].min(axis=2) < 0.95).mean(axis=0)
    thirds = np.array_split(ink, 3)
    assert all(third.max() > 0.1 for third in thirds)
    assert thirds[1].max() > 0.5


def test_histogram_shows_shares_of_corners():
    V, F = meshes.grid(12, 12)
    result = cdcp_igl.disk_map(V, F)
    histogram = picture(V, F, result).axes[2]
    total = sum(bar.get_height() for bar in histogram.patches[:60])
    degrees = cdcp_igl.angle_distortion(V, F, result.uv)
    end = histogram.get_xlim()[1]
    assert total == pytest.approx(100 * (degrees <= end).mean())
    assert 98 < total <= 100


def test_disk_is_turned_to_match_the_view():
    # Seen from above, a flat disk and its map are the same picture.
    V, F, _ = datasets.spherical_cap(12, angle=1)
    turned = _turned_like(V[:, :2] @ [[0, 1], [-1, 0]] + 5, cdcp_igl.cdcp(V, F))
    np.testing.assert_allclose(turned, V[:, :2] @ [[0, 1], [-1, 0]] / V[:, 0].max(), atol=0.01)
