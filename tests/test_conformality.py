"""Whether a valid map is conformal, and that the result says so."""

import json
import logging

import meshes
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import cdcp_igl
from cdcp_igl import datasets
from cdcp_igl.distortion import angle_errors
from cdcp_igl.reference import harmonic
from cdcp_igl.rescue.conformality import dilatation, explained_errors, judge
from cdcp_igl.surface.mesh import DiskMesh

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


def test_a_stereographic_projection_is_explained_exactly():
    V, F, uv = datasets.spherical_cap(10)
    mesh, f = DiskMesh(V, F), uv @ [1, 1j]
    np.testing.assert_allclose(angle_errors(mesh, f), explained(mesh, f), atol=1e-12)


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
    result = cdcp_igl.disk_map(V, F)
    assert result.valid
    assert result.distortion_of_free_faces.mean > 12
    assert not result.conformal
    assert not result.conformality.sheared
    assert result.boundary.name == "geodesic"
    assert "as the faces are large" in result.conformality.reasons[0]
    assert cdcp_igl.disk_map(*meshes.corridor(6, 16)).conformal


@settings(max_examples=20)
@given(st.floats(1, 1e6), st.floats(0, 7), st.integers(2, 100))
def test_dilatation_of_a_linear_map(stretch, angle, needles):
    """It is the quotient of the singular values, whatever the faces are like."""
    V, F, _ = datasets.ellipse(6)
    V = V * [needles, 1, 1]
    mesh, z = DiskMesh(V, F), np.exp(1j * angle) * (V[:, :2] @ [1, 1j])
    f = z.real * stretch + 1j * z.imag
    assert dilatation(mesh, f, np.arange(len(F))) == pytest.approx(stretch, rel=1e-6)


@pytest.mark.parametrize("length", [30, 1e6])
def test_needles_hide_what_is_done_to_them(length):
    """Strips of 30 by 30 cells: the angles of their faces hardly change by arc length."""
    V, F = meshes.corridor(1, 30)
    result = cdcp_igl.disk_map(V * [length, 1], F)
    assert result.boundary.name == "arc length"
    assert result.distortion.mean < 12
    assert not result.conformal
    assert "stretched" in str(result)
    assert "remesh" in str(result)


@pytest.mark.parametrize("length", [1, 10])
def test_needles_need_not_be_stretched(length):
    V, F = meshes.corridor(1, 30)
    assert cdcp_igl.disk_map(V * [length, 1], F).conformal


def test_the_result_says_so(caplog):
    V, F = meshes.corridor(400, 2)
    with caplog.at_level(logging.INFO, "cdcp_igl"):
        result = cdcp_igl.disk_map(V, F)
    assert str(result).startswith(f"disk map of {len(V):,} vertices: valid, NOT CONFORMAL")
    assert "the boundary lies by arc length" in str(result)
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
