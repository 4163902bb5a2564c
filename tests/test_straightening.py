"""Closed surfaces with a face, a vertex or a 2-ring taken out, and the shear they have."""

from functools import partial

import numpy as np
import pytest
from surfaces import blob

import cdcp_igl
from benchmarks.measure.punctures import RINGS, opened, row_to_open
from cdcp_igl.algorithm import Steps, algorithm_1
from cdcp_igl.distortion import angle_errors
from cdcp_igl.reference import fdcp, harmonic
from cdcp_igl.rescue.straightening import Straightening, common_shear, straighten
from cdcp_igl.solve.factored import FactoredSurface
from cdcp_igl.steps.extension import harmonic_extension
from cdcp_igl.surface.mesh import DiskMesh


def punctured(seed, kind="face"):
    V, F = blob(seed)
    return opened(V, F, kind, row_to_open(np.random.default_rng(seed), V, F, kind))


@pytest.mark.parametrize("kind", RINGS)
@pytest.mark.parametrize("seed", range(3))
def test_closed_surfaces_with_a_puncture(kind, seed):
    V, F = punctured(seed, kind)
    result = cdcp_igl.disk_map(V, F)
    assert result.valid
    assert result.distortion.mean < 6
    for other in ({"mobius": None}, {"refine": 5}, {"mobius": "area"}, {"align": [1, 0, 0]}):
        mean = cdcp_igl.disk_map(V, F, **other).distortion.mean
        assert result.distortion.mean < 1.2 * mean
        assert mean < 1.2 * result.distortion.mean
    others = [cdcp_igl.angle_distortion(V, F, method(V, F)).mean() for method in (fdcp, harmonic)]
    others.append(cdcp_igl.disk_map(V, F, preset="paper").distortion.mean)
    assert result.distortion.mean < 1.02 * min(others)


@pytest.mark.parametrize("seed", range(2))
def test_the_common_shear_is_taken_out(seed):
    V, F = punctured(seed)
    mesh = DiskMesh(V, F)
    surface = FactoredSurface.of(mesh)
    plain, *_ = algorithm_1(surface, Steps())
    before = angle_errors(mesh, plain.f)
    mu, possible = common_shear(mesh, plain.f, 10**6)
    f, account = straighten(mesh, plain.f, partial(harmonic_extension, surface))
    after = angle_errors(mesh, f)
    assert possible > 0.02
    assert account.gain > 0.5 * possible
    assert abs(after).mean() < 0.99 * abs(before).mean()
    assert common_shear(mesh, f, 10**6)[1] < 0.02
    assert account.shear == pytest.approx(abs(mu), rel=0.3)
    np.testing.assert_allclose(abs(f[mesh.loop]), 1, atol=1e-15)


def test_a_given_shear_is_found():
    V, F, _ = cdcp_igl.datasets.ellipse(20)
    mesh, z = DiskMesh(V, F), V[:, :2] @ [1, 1j]
    mu = 0.02 + 0.01j
    found, share = common_shear(mesh, z + mu * z.conj(), 10**6)
    assert found == pytest.approx(mu, abs=5e-4)
    assert share > 0.98


def test_a_long_boundary_is_left_as_it_is():
    V, F, _ = cdcp_igl.datasets.ellipse(20)
    result = cdcp_igl.disk_map(V, F)
    assert result.straightening == Straightening()
    assert str(result.straightening) == "not needed"
    assert "straightening" not in str(result)
    assert result.refinement is None


def test_what_was_straightened_much_is_refined_and_says_so():
    V, F = punctured(7)
    result = cdcp_igl.disk_map(V, F)
    assert result.straightening.gain > 0.2
    assert result.refinement.steps >= 2
    assert "common shear" in str(result)
    assert result.report()["straightening"]["shear"] == result.straightening.shear
    paper = cdcp_igl.disk_map(V, F, preset="paper")
    assert paper.straightening == Straightening()
    assert paper.refinement is None
