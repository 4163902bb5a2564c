import meshes
import numpy as np
import pytest

import cdcp_igl

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


def test_disk_map_reports_the_distortion_of_its_uv():
    result = cdcp_igl.disk_map(V, F)
    degrees = cdcp_igl.angle_distortion(V, F, result.uv)
    assert result.distortion.mean == pytest.approx(degrees.mean(), abs=1e-9)
    assert result.distortion.sd == pytest.approx(degrees.std(), abs=1e-9)
    assert result.distortion.max == pytest.approx(degrees.max(), abs=1e-9)


def test_nan_in_uv_is_no_zero():
    bad = UV.copy()
    bad[3] = np.nan
    with pytest.raises(cdcp_igl.MeshError, match=r"NaN .* in uv .*") as raised:
        cdcp_igl.angle_distortion(V, F, bad)
    assert "clean" not in raised.value.remedy


def linear(matrix):
    return V[:, :2] @ np.transpose(matrix)


def test_dilatation_on_a_surface():
    """By the singular values of the affine map of each face in an orthonormal frame."""
    found = cdcp_igl.quasi_conformal_dilatation(V, F, UV)
    for face, K in zip(F, found, strict=True):
        e = (V[face[1:]] - V[face[0]]).T
        coordinates = np.linalg.qr(e).R
        sigma = np.linalg.svd((UV[face[1:]] - UV[face[0]]).T @ np.linalg.inv(coordinates))[1]
        assert pytest.approx(sigma[0] / sigma[1], rel=1e-9) == K


def test_conformal_factor_of_a_moebius_transformation_is_exact():
    z = V[:, :2] @ [1, 1j] / 40
    w = 0.3 + 0.4j
    moved = (z - w) / (1 - np.conj(w) * z)
    found = cdcp_igl.conformal_factor(V[:, :2] / 40, F, np.column_stack([moved.real, moved.imag]))
    derivative = (1 - abs(w) ** 2) / (1 - np.conj(w) * z) ** 2
    np.testing.assert_allclose(found, np.log(abs(derivative)), atol=1e-12)


@pytest.mark.parametrize("dtype", [np.int8, np.int64, np.float32])
def test_conformal_factor_of_any_type_of_number(dtype):
    square = np.array([[-128, -128], [0, -128], [0, 0], [-128, 0]], dtype=dtype)
    u = cdcp_igl.conformal_factor(square, [[0, 1, 2], [0, 2, 3]], square)
    np.testing.assert_allclose(u, 0, atol=1e-15)


def test_conformal_factor_depends_on_the_unit():
    u = cdcp_igl.conformal_factor(V, F, UV)
    np.testing.assert_allclose(cdcp_igl.conformal_factor(10 * V, F, UV), u - np.log(10))


def test_area_distortion():
    flat = V[:, :2]
    np.testing.assert_allclose(
        cdcp_igl.area_distortion(flat, F, linear([[3, 1], [0, 2]])), 0, atol=1e-12
    )
    quarter = cdcp_igl.area_distortion(
        [[0, 0], [1, 0], [1, 1], [0, 1]],
        [[0, 1, 2], [0, 2, 3]],
        [[0, 0], [1, 0], [1, 1], [0, 3]],
    )
    np.testing.assert_allclose(quarter, np.log([0.5, 1.5]))


def test_flipped_and_collapsed_faces_look_bad():
    flat = V[:, :2]
    for bad in (flat * [-1, 1], flat * [1, 0]):
        assert np.isposinf(cdcp_igl.quasi_conformal_dilatation(flat, F, bad)).all()
        assert np.isneginf(cdcp_igl.area_distortion(flat, F, bad)).all()
    point = np.zeros_like(flat)
    assert np.isposinf(cdcp_igl.quasi_conformal_dilatation(flat, F, point)).all()
    assert np.isneginf(cdcp_igl.conformal_factor(flat, F, point)).all()
