"""Closed surfaces with a face, a vertex or a 2-ring taken out, and the shear they have."""

from functools import partial

import numpy as np
import pytest

import cdcp_igl
from cdcp_igl.algorithm import Steps, algorithm_1
from cdcp_igl.distortion import angle_errors
from cdcp_igl.rescue.straightening import Straightening, common_shear, straighten
from cdcp_igl.solve.factored import FactoredSurface
from cdcp_igl.steps.extension import harmonic_extension
from cdcp_igl.surface.mesh import DiskMesh


def blob(seed, subdivisions=3):
    """A closed surface: an icosahedron, subdivided, with bumps."""
    t = (1 + np.sqrt(5)) / 2
    V = [(0, s, u * t) for s in (-1, 1) for u in (-1, 1)]
    V = np.array([np.roll(v, k) for k in range(3) for v in V], float)
    edge = np.linalg.norm(V[:, None] - V, axis=2) < 2.1
    F = [
        (i, j, k)
        for i in range(12)
        for j in range(i + 1, 12)
        for k in range(j + 1, 12)
        if edge[i, j] and edge[j, k] and edge[i, k]
    ]
    F = np.array([f if np.linalg.det(V[list(f)]) > 0 else (f[0], f[2], f[1]) for f in F])
    for _ in range(subdivisions):
        ends = np.sort(np.concatenate([F[:, [1, 2]], F[:, [2, 0]], F[:, [0, 1]]]), axis=1)
        edges, which = np.unique(ends, axis=0, return_inverse=True)
        a, b, c = len(V) + which.reshape(3, -1)
        V = np.vstack([V, V[edges].mean(axis=1)])
        i, j, k = F.T
        corners = ([i, c, b], [j, a, c], [k, b, a], [a, b, c])
        F = np.concatenate([np.column_stack(face) for face in corners])
    V /= np.linalg.norm(V, axis=1)[:, None]
    rng = np.random.default_rng(seed)
    bumps = np.cos(4 * V @ rng.normal(size=(3, 4)) + rng.uniform(0, 6, 4)).sum(axis=1)
    return V * (1 + 0.08 * bumps)[:, None], F


def punctured(V, F, rings, seed):
    """Take out a face, a vertex, or a vertex with its neighbours."""
    rng = np.random.default_rng(seed)
    near = np.zeros(len(V), dtype=bool)
    near[rng.integers(len(V))] = True
    if rings == 0:
        left = np.delete(F, rng.integers(len(F)), axis=0)
    else:
        for _ in range(rings - 1):
            near[F[near[F].any(axis=1)]] = True
        left = F[~near[F].any(axis=1)]
    used = np.unique(left)
    return V[used], np.searchsorted(used, left)


@pytest.mark.parametrize("rings", [0, 1, 2])
@pytest.mark.parametrize("seed", range(6))
def test_closed_surfaces_with_a_puncture(rings, seed):
    V, F = punctured(*blob(seed), rings, seed)
    result = cdcp_igl.disk_map(V, F)
    assert result.valid
    assert result.distortion.mean < 6
    for other in ({"mobius": None}, {"refine": 5}, {"mobius": "area"}, {"align": [1, 0, 0]}):
        mean = cdcp_igl.disk_map(V, F, **other).distortion.mean
        assert result.distortion.mean < 1.2 * mean
        assert mean < 1.2 * result.distortion.mean


@pytest.mark.parametrize("seed", range(4))
def test_the_common_shear_is_taken_out(seed):
    V, F = punctured(*blob(seed), 0, seed)
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
    V, F = punctured(*blob(4), 0, 4)
    result = cdcp_igl.disk_map(V, F)
    assert result.straightening.gain > 0.2
    assert result.refinement.steps >= 2
    assert "common shear" in str(result)
    assert result.report()["straightening"]["shear"] == result.straightening.shear
    paper = cdcp_igl.disk_map(V, F, preset="paper")
    assert paper.straightening == Straightening()
    assert paper.refinement is None
