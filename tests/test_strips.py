"""Strips many times longer than wide, against their exact conformal map."""

import meshes
import mpmath
import numpy as np
import pytest

import cdcp_igl
from cdcp_igl.rescue.boundary import around
from cdcp_igl.solve.solvers import SOLVERS
from cdcp_igl.surface.mesh import DiskMesh

WIDTH = 20  # cells


def strip(length, width=WIDTH, jitter=0.0):
    """Rectangle `length` times longer than wide, of triangulated cells."""
    V, F = meshes.corridor(length, width)
    V = V / width
    inside = (V.min(axis=1) > 0) & (V[:, 0] < length) & (V[:, 1] < 1)
    noise = np.random.default_rng(0).uniform(-1, 1, V.shape)
    V[inside] += jitter / width * noise[inside]
    return V, F


def exact(V, length):
    """Side (n,) of the nearer end, 1 or -1, and the exact map of the vertices minus that.

    A half-strip of width pi goes to the half-plane by the sine. In the rectangle, whose map
    is the elliptic sine, the other end changes that by a relative exp(-pi length): by 1e-11
    where the length is 8. The half-plane goes to the disk by a Möbius transformation, the end
    to -1 and the middle to 0.
    """
    side = np.where(V[:, 0] > length / 2, 1, -1)
    from_end = length / 2 - abs(V[:, 0] - length / 2)
    across = -side * (0.5 - V[:, 1])
    Z = np.sin(np.pi * (across + 1j * from_end)) / np.sinh(np.pi * length / 2)
    return side, -side * 2 * Z / (Z + 1j)


def exact_distortion(V, F, length):
    """Mean angular distortion of the exact map, in degrees, from relative positions."""
    side, offset = exact(V, length)
    apart = (side[F] != side[F][:, :1]).any(axis=1)
    z = offset[F] + np.where(apart[:, None], side[F], 0)
    angle = np.angle((np.roll(z, 1, axis=1) - z) / (np.roll(z, -1, axis=1) - z))
    return abs(np.degrees(angle - DiskMesh(V, F).angles)).mean()


@pytest.mark.parametrize("length", [8, 14, 20])
def test_as_good_as_the_exact_map_as_far_as_doubles_go(length):
    V, F = strip(length)
    result = cdcp_igl.disk_map(V, F)
    assert result.certificate.valid
    assert result.distortion.mean < 1.02 * exact_distortion(V, F, length)


@pytest.mark.parametrize("solver", SOLVERS)
def test_where_the_last_digit_decides(solver):
    """At 21, the last cells are hardly larger than the distance between doubles."""
    V, F = strip(21)
    result = cdcp_igl.disk_map(V, F, solver=solver)
    assert result.conformal
    assert result.distortion.mean < 1.02 * exact_distortion(V, F, 21)


@pytest.fixture(scope="module")
def jittered():
    V, F = strip(18, jitter=0.2)
    return V, F, cdcp_igl.disk_map(V, F)


@pytest.mark.parametrize(
    "options",
    [
        {"mobius": None},
        {"align": [0, 1, 0], "mobius": "area"},
        {"align": 0, "refine": 2},
        {"center": "heat"},
        {"preset": "paper"},
    ],
    ids=str,
)
def test_with_every_option(options, jittered):
    V, F, plain = jittered
    result = cdcp_igl.disk_map(V, F, **options)
    assert result.certificate.valid
    assert result.certificate.boundary_error < 1e-14
    if options.get("refine"):
        assert result.refinement.steps == 2
        assert result.distortion.mean < plain.distortion.mean - 0.02
    else:
        assert result.distortion.mean < 1.03 * plain.distortion.mean


def test_points_on_the_circle_are_rounded_once():
    """Angles near pi are known to 4e-16 only, which arcs of 1e-15 would show."""
    shares = np.concatenate([np.full(500, 1e-15), np.full(10, 1e-2)] * 2)
    f_B = around(shares)
    mpmath.mp.dps = 30
    total, so_far = mpmath.fsum(shares), mpmath.mpf(0)
    for place, share in zip(f_B, shares, strict=True):
        exact = mpmath.expjpi(2 * so_far / total)
        assert abs(mpmath.mpc(place) - exact) < 1.2e-16
        so_far += mpmath.mpf(share)


def test_any_centre_will_do_for_a_strip():
    """It is moved to where both ends are equally far away."""
    V, F = strip(14)
    for face in (5, len(F) // 5):
        result = cdcp_igl.disk_map(V, F, center=face)
        assert result.boundary.name == "harmonic measure"
        assert result.conformal
        assert result.distortion.mean < 1.03 * exact_distortion(V, F, 14)
