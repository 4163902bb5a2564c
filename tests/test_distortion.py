"""Distortion of angles and areas, and whether a valid map is conformal."""

import json
import logging

import igl
import meshes
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import cdcp_igl
from cdcp_igl import datasets
from cdcp_igl.arrays import coordinates
from cdcp_igl.reference import harmonic
from cdcp_igl.surface.mesh import DiskMesh
from cdcp_igl.verdict.conformality import dilatation, explained_errors, judge
from cdcp_igl.verdict.distortion import angle_errors

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


# -- whether a valid map is conformal --------------------------------------------------


EXACT = [datasets.ellipse, datasets.square, datasets.paraboloid]


def explained(mesh, f):
    return explained_errors(mesh, f, np.arange(len(mesh.F)))


def means(V, F, uv):
    """Mean angle error, and that which the scale explains, in radians."""
    mesh, f = DiskMesh(V, F), uv @ [1, 1j]
    return abs(angle_errors(mesh, f)).mean(), abs(explained(mesh, f)).mean()


@pytest.mark.parametrize("known", EXACT)
def test_the_scale_explains_the_errors_of_exact_maps(known):
    left = []
    for n in (10, 20, 40):
        V, F, uv = known(n)
        mesh, f = DiskMesh(V, F), uv @ [1, 1j]
        errors = angle_errors(mesh, f)
        inner = ~mesh.on_boundary[F].any(axis=1)
        left.append(abs(errors - explained(mesh, f))[inner].mean())
        assert judge(mesh, f, np.degrees(abs(errors)))
    assert np.log2(left[0] / left[2]) / 2 > 1.5


@settings(max_examples=20)
@given(st.integers(0, 1000))
def test_a_discrete_conformal_equivalence_is_explained_exactly(seed):
    """A Möbius transformation of a plane mesh changes lengths by factors at the vertices."""
    V, F, _ = datasets.ellipse(6)
    rng = np.random.default_rng(seed)
    w = 0.1 * (rng.normal() + 1j * rng.normal())
    z = V[:, :2] @ [1, 1j] / 4
    f = z / (1 - w * z)
    mesh = DiskMesh(V, F)
    np.testing.assert_allclose(angle_errors(mesh, f), explained(mesh, f), atol=1e-12)


def test_shear_is_not_explained():
    V, F, _ = datasets.ellipse(10)
    error, of_scale = means(V, F, V[:, :2] * [1, 2])
    assert error > np.radians(10)
    assert of_scale < np.radians(1)
    mesh, f, degrees = DiskMesh(V, F), V[:, 0] + 2j * V[:, 1], np.full(F.shape, np.degrees(error))
    assert judge(mesh, f, degrees / 3).sheared
    assert judge(mesh, f, degrees / 3, known=np.degrees(error) / 3)  # nor would refinement add any


def test_faces_inscribed_in_the_circle_count():
    result = cdcp_igl.disk_map(*meshes.corridor(6, 1))
    assert result.distortion.mean > 12
    assert not result.conformal
    assert "flip the ears" in str(result)


@pytest.mark.parametrize("name", ["chinese_lion_17334", "human_face_17157", "human_brain_48463"])
def test_arc_length_is_not_conformal(name, real_mesh, map_of):
    V, F = real_mesh(name)
    uv = harmonic(V, F)
    error, of_scale = means(V, F, uv)
    assert 1.8 * of_scale < error < 9 * of_scale
    mesh, f = DiskMesh(V, F), uv @ [1, 1j]
    verdict = judge(mesh, f, np.degrees(abs(angle_errors(mesh, f))))
    assert verdict.sheared
    assert not verdict
    assert "the scale explains" in str(verdict)
    assert "cdcp_igl.cut" in str(verdict)
    assert map_of(name).conformal


def test_coarse_faces_are_no_shear():
    """A strip two faces wide: all that the map does to angles comes from its change of scale."""
    V, F = meshes.corridor(6, 4)
    result = cdcp_igl.disk_map(V, F, refine=0)
    assert result.valid
    assert result.distortion_of_free_faces.mean > 12
    assert not result.conformal
    assert not result.conformality.sheared
    assert result.boundary.name == "geodesic"
    assert "as the faces are large" in result.conformality.reasons[0]
    assert cdcp_igl.disk_map(*meshes.corridor(6, 16)).conformal


@pytest.mark.parametrize(("sides", "height"), [(3, 4), (4, 1), (5, 3), (6, 9)])
def test_where_faces_are_said_to_be_large_smaller_ones_help(sides, height):
    V, F = meshes.prism(sides, height)
    result, finer = cdcp_igl.disk_map(V, F), cdcp_igl.disk_map(*igl.upsample(V, F, 1))
    assert "as the faces are large" in result.conformality.reasons[0]
    assert finer.distortion.mean < 0.6 * result.distortion.mean


@settings(max_examples=20)
@given(st.floats(1, 1e6), st.floats(0, 7), st.integers(2, 100))
def test_dilatation_of_a_linear_map(stretch, angle, needles):
    """It is the quotient of the singular values, whatever the faces are like."""
    V, F, _ = datasets.ellipse(6)
    V = V * [needles, 1, 1]
    mesh, z = DiskMesh(V, F), np.exp(1j * angle) * (V[:, :2] @ [1, 1j])
    f = z.real * stretch + 1j * z.imag
    assert dilatation(mesh, f, np.arange(len(F))) == pytest.approx(stretch, rel=1e-6)


@pytest.mark.parametrize("length", [1e4, 1e6])
def test_needles_hide_what_is_done_to_them(length):
    """Faces so much longer than wide that their angles hardly change where they are stretched."""
    V, F = meshes.grid(30, 30)
    V = V[:, :2] * [length, 1]
    f = 5 * V[:, 0] + 1j * V[:, 1]
    degrees = cdcp_igl.angle_distortion(V, F, coordinates(f))
    assert degrees.mean() < 1
    verdict = judge(DiskMesh(V, F), f, degrees)
    assert not verdict
    assert "stretched 5 times" in str(verdict)
    assert "remesh" in str(verdict)


@pytest.mark.parametrize("length", [1, 10])
def test_needles_need_not_be_stretched(length):
    V, F = meshes.corridor(1, 30)
    assert cdcp_igl.disk_map(V * [length, 1], F).conformal


def test_the_result_says_so(caplog):
    V, F = meshes.corridor(400, 2)
    with caplog.at_level(logging.INFO, "cdcp_igl"):
        result = cdcp_igl.disk_map(V, F)
    assert str(result).startswith(f"disk map of {len(V):,} vertices: valid, NOT CONFORMAL")
    assert "the boundary began by arc length" in str(result)
    report = result.report()
    assert json.loads(json.dumps(report)) == report
    assert report["valid"]
    assert report["conformal"] is False
    assert any("crowding" in reason for reason in report["not_conformal_because"])
    assert report["remedies"]
    assert any(record.levelno == logging.WARNING for record in caplog.records)
    assert any("rejected" in record.message for record in caplog.records)


def test_a_good_map_says_nothing_and_others_only_if_they_are_asked(caplog, capfd):
    cdcp_igl.cdcp(*meshes.corridor(60, 4))
    caplog.clear()
    with caplog.at_level(logging.INFO, "cdcp_igl"):
        cdcp_igl.cdcp(*datasets.spherical_cap(10)[:2])
    assert not caplog.records
    assert capfd.readouterr() == ("", "")
