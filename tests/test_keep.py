"""What a map keeps: angles, lengths, areas, or anything between."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import cdcp_igl
from cdcp_igl.arrays import as_complex, coordinates
from cdcp_igl.refine import balance
from cdcp_igl.refine.balance import Energy, balanced, resized, way_to_flip
from cdcp_igl.refine.targets import Disk, Outline
from cdcp_igl.surface.mesh import DiskMesh
from cdcp_igl.surface.triangles import face_areas, flipped_faces, oriented_areas


@pytest.fixture(scope="module")
def bent():
    """A bumpy disk, and a map of it that stretches and flips no face."""
    V, F, _ = cdcp_igl.datasets.spherical_cap(5)
    V = V + 0.05 * np.random.default_rng(0).standard_normal(V.shape)
    f = as_complex(cdcp_igl.free_map(V, F).uv)
    return DiskMesh(V, F), f * (1.5 + 0.2j) + 0.3 * f.conj() + 0.1 * f**2


@pytest.mark.parametrize("k", [1, 0.1, 2])
@pytest.mark.parametrize("t", [0, 0.02, 0.5, 0.7, 1])
def test_energy_is_that_of_the_singular_values(bent, t, k):
    mesh, f = bent
    K = cdcp_igl.quasi_conformal_dilatation(mesh.V, mesh.F, coordinates(f))
    area = face_areas(mesh.V, mesh.F)
    s, q = np.log(K), np.log(oriented_areas(f, mesh.F)[0] / 2 / area)
    low, high = np.cosh(k * s), np.cosh(k * q)
    e = low * (1 - 2 * t + 2 * t * high) if t <= 0.5 else high * (2 * t - 1 + (2 - 2 * t) * low)
    expected = np.average((e - 1) / k**2, weights=area)
    assert_allclose(Energy.of(mesh, t, k).value(f), expected, rtol=1e-12)
    if (t, k) == (0.5, 1):  # symmetric Dirichlet
        squares = np.exp([q + s, q - s])
        assert_allclose(4 * e, (squares + 1 / squares).sum(axis=0), rtol=1e-10)


@pytest.mark.parametrize("t", [0, 0.3, 0.9])
def test_slope_and_curvature_are_those_of_differences(bent, t, monkeypatch):
    monkeypatch.setattr(balance, "_clamped", lambda *block: block)  # the Hessian as it is
    mesh, f = bent
    energy, h = Energy.of(mesh, t), 1e-3
    dz = as_complex(0.05 * np.random.default_rng(1).standard_normal((len(f), 2)))
    before, here, after = (energy.value(f + x * dz) for x in (-h, 0, h))
    quadratic = energy.quadratic(f, whole=True)
    slope, bend = (np.vdot(x, dz).real for x in (quadratic.gradient(), quadratic.times(dz)))
    assert_allclose(slope, (after - before) / (2 * h), rtol=1e-4)
    assert_allclose(bend, (after - 2 * here + before) / h**2, rtol=1e-4)


def test_a_step_to_the_first_flip_flips_one_face(bent):
    mesh, f = bent
    step = as_complex(np.random.default_rng(2).standard_normal((len(f), 2)))
    way = way_to_flip(mesh.F, f, step)
    assert len(flipped_faces(f + 0.999999 * way * step, mesh.F)[0]) == 0
    assert len(flipped_faces(f + 1.000001 * way * step, mesh.F)[0]) == 1
    assert way_to_flip(mesh.F, f, 2j * f) == np.inf  # turned and grown


@pytest.mark.parametrize("t", [0.02, 0.5, 0.99])
def test_what_is_flat_stays(t):
    V, F, _ = cdcp_igl.datasets.square(6)
    mesh = DiskMesh(V, F)
    f, descent = balanced(mesh, 3 * as_complex(mesh.V[:, :2]), np.arange(len(V)), t)
    assert_allclose(coordinates(f), mesh.V[:, :2], atol=1e-12)
    assert descent.done


@pytest.mark.parametrize("target", [Outline(), Disk()])
def test_balance_lowers_the_energy_and_flips_nothing(bent, target):
    mesh, f = bent
    sliding = isinstance(target, Disk)
    if sliding:
        f = as_complex(cdcp_igl.disk_map(mesh.V, mesh.F).uv)
    order = mesh.interior if sliding else np.arange(len(f))
    for t in (0.02, 0.5, 0.99):
        energy = Energy.of(mesh, t, target=target)
        g, descent = balanced(mesh, f, order, t, target)
        assert descent.value == energy.value(g) < energy.value(f if sliding else resized(energy, f))
        assert target.certificate(mesh, g, target.flipped(mesh.F, g)).valid
        # Nothing small lowers it much more.
        slope = target.tangential(mesh, g, energy.quadratic(g, whole=True).gradient())
        assert abs(slope).max() < 0.02
