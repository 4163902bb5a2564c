import meshes
import numpy as np
import pytest

import cdcp_igl
from cdcp_igl.distortion import AngleDistortion

V, F = meshes.grid()
UV = cdcp_igl.cdcp(V, F)


def angles_by_hand(V, F):
    """The angle at each corner from the cosine, in degrees."""
    V = np.asarray(V, float)
    angles = np.empty(F.shape)
    for k in range(3):
        a = V[F[:, (k + 1) % 3]] - V[F[:, k]]
        b = V[F[:, (k + 2) % 3]] - V[F[:, k]]
        cosine = (a * b).sum(axis=1) / np.linalg.norm(a, axis=1) / np.linalg.norm(b, axis=1)
        angles[:, k] = np.degrees(np.arccos(cosine))
    return angles


def test_equation_7():
    expected = abs(angles_by_hand(UV, F) - angles_by_hand(V, F))
    np.testing.assert_allclose(cdcp_igl.angle_distortion(V, F, UV), expected, atol=1e-6)


def test_similarity_is_no_distortion():
    flat = V[:, :2]
    turned = 7 * flat @ [[0, 1], [-1, 0]] + 3
    assert cdcp_igl.angle_distortion(flat, F, turned).max() < 1e-5


def test_flipped_face_is_never_conformal():
    flat = V[:, :2]
    mirrored = flat * [-1, 1]
    degrees = cdcp_igl.angle_distortion(flat, F, mirrored)
    np.testing.assert_allclose(degrees, 2 * angles_by_hand(flat, F), atol=1e-6)


def test_summary():
    degrees = cdcp_igl.angle_distortion(V, F, UV)
    summary = AngleDistortion.of(degrees)
    assert summary == AngleDistortion(degrees.mean(), degrees.std(), degrees.max())
    assert str(summary).startswith("mean ")


def test_disk_map_reports_the_distortion_of_its_uv():
    result = cdcp_igl.disk_map(V, F)
    degrees = cdcp_igl.angle_distortion(V, F, result.uv)
    assert result.distortion.mean == pytest.approx(degrees.mean(), abs=1e-9)
    assert result.distortion.sd == pytest.approx(degrees.std(), abs=1e-9)
    assert result.distortion.max == pytest.approx(degrees.max(), abs=1e-9)


@pytest.mark.parametrize("bad", [UV[:-1], np.column_stack([UV, UV[:, 0]]), UV.ravel()])
def test_shape_of_uv(bad):
    with pytest.raises(ValueError, match="uv"):
        cdcp_igl.angle_distortion(V, F, bad)


def test_nan_in_uv_is_no_zero():
    bad = UV.copy()
    bad[3] = np.nan
    with pytest.raises(cdcp_igl.MeshError, match="NaN"):
        cdcp_igl.angle_distortion(V, F, bad)
