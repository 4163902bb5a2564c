"""Convergence to maps known in closed form, up to the Möbius group."""

import numpy as np
import pytest

import cdcp_igl
from cdcp_igl import datasets
from cdcp_igl.reference import METHODS
from cdcp_igl.surface.mesh import DiskMesh

SURFACES = [datasets.square, datasets.ellipse, datasets.spherical_cap, datasets.paraboloid]


def through_three_points(z, w, at):
    """The Möbius transformation of z that agrees with w in three places."""

    def to_zero_one_infinity(a, b, c):
        return np.array([[b - c, -a * (b - c)], [b - a, -c * (b - a)]])

    (a, b), (c, d) = np.linalg.inv(to_zero_one_infinity(*w[at])) @ to_zero_one_infinity(*z[at])
    return (a * z + b) / (c * z + d)


def cdcp_at_the_center(V, F, w):
    # On symmetric meshes several faces are equally central, and rounding chooses one of them.
    center = int(abs(w[F].mean(axis=1) - (1e-3 + 5e-4j)).argmin())
    return cdcp_igl.cdcp(V, F, center=center)


def error(surface, resolution, method=cdcp_at_the_center, turn=0.0):
    """Root mean square error against the exact map, three boundary points made to agree."""
    V, F, exact = surface(resolution)
    loop = DiskMesh(V, F).loop
    w = exact @ [1, 1j]
    z = method(V, F, w) @ [1, 1j]
    thirds = loop[((np.arange(3) / 3 + turn) * len(loop)).astype(int)]
    return np.sqrt((abs(through_three_points(z, w, thirds) - w) ** 2).mean())


@pytest.mark.parametrize("surface", SURFACES)
def test_error_falls_with_the_square_of_the_mesh_size(surface):
    errors = [error(surface, resolution) for resolution in (12, 24, 48)]
    rate = np.log2(errors[0] / errors[-1]) / 2
    assert rate > 1.8
    assert errors[-1] < 3e-4


@pytest.mark.parametrize(
    ("name", "surface", "order"),
    [
        ("cem", datasets.ellipse, 1.8),
        ("cem", datasets.spherical_cap, 1.9),
        ("heat_flow", datasets.ellipse, 1.4),
        ("heat_flow", datasets.spherical_cap, 1.9),
        ("ricci", datasets.ellipse, 1.9),
        ("ricci", datasets.paraboloid, 1.9),
        ("pgcp", datasets.ellipse, 1.9),
        ("pgcp", datasets.spherical_cap, 1.9),
    ],
)
def test_methods_to_compare_with_converge(name, surface, order):
    def method(V, F, w):
        return METHODS[name].function(V, F)

    turn = 0.03 if name == "pgcp" else 0  # a seam ends at the first vertex, where it is not smooth
    coarse, fine = (error(surface, resolution, method, turn) for resolution in (12, 24))
    assert np.log2(coarse / fine) > order
    assert fine < 5e-3


@pytest.mark.parametrize(
    ("name", "degree"), [("bff", 1), ("bff_disk", 1), ("abf", 19), ("lscm", 19), ("spectral", 19)]
)
def test_free_outlines_converge_to_a_function_of_the_exact_map(name, degree):
    """A holomorphic one, of which a polynomial is enough; where the outline is known, linear."""

    def distance(resolution):
        V, F, exact = datasets.spherical_cap(resolution)
        z = METHODS[name].function(V, F) @ [1, 1j]
        powers = np.vander(exact @ [1, 1j], degree + 1)
        fitted = powers @ np.linalg.lstsq(powers, z)[0]
        return np.linalg.norm(fitted - z) / np.linalg.norm(z - z.mean())

    coarse, fine = distance(12), distance(24)
    assert np.log2(coarse / fine) > 1.9
    assert fine < 2e-3


@pytest.mark.parametrize("surface", SURFACES)
def test_generated_surface_and_its_map_are_valid(surface):
    V, F, uv = surface(9)
    mesh = DiskMesh(V, F)
    assert len(cdcp_igl.check(V, F).ears) == 0
    assert np.hypot(*uv[mesh.loop].T) == pytest.approx(1)
    assert (np.hypot(*uv[mesh.interior].T) < 1).all()
    coarse, fine = (
        cdcp_igl.angle_distortion(V, F, uv).mean() for V, F, uv in (surface(12), surface(24))
    )
    assert fine < 0.6 * coarse < 3  # the exact map, not some other one
