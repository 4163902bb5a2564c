"""Whitening, the geodesic algorithm, Theodorsen's method and the fallbacks."""

from functools import partial

import meshes
import numpy as np
import pytest

import cdcp_igl
from cdcp_igl.circle.fallback import map_to_circle
from cdcp_igl.circle.geodesic import geodesic_map
from cdcp_igl.circle.spread import spread
from cdcp_igl.circle.theodorsen import theodorsen_map
from cdcp_igl.circle.whiten import whiten
from cdcp_igl.dipole import boundary_trace
from cdcp_igl.distortion import plane_angles
from cdcp_igl.extension import harmonic_extension
from cdcp_igl.factor import Factor
from cdcp_igl.injectivity import flipped_faces, increments
from cdcp_igl.laplacian import cotangent_laplacian
from cdcp_igl.mesh import DiskMesh


def circle(n):
    return np.exp(2j * np.pi * np.arange(n) / n)


# Exterior maps zeta -> z of the unit circle with pole at infinity; zeta = 1 / w clockwise.
CURVES = {
    "circle": lambda zeta: 2 * zeta + 0.3,
    "ellipse": lambda zeta: 1.3 * zeta + 0.3 / zeta,
    "hypotrochoid": lambda zeta: zeta + 0.25 / zeta**2,
    "lopsided": lambda zeta: zeta + 0.1j / zeta + 0.12 / zeta**3,
}


def error_up_to_rotation(f, w):
    turn = f @ w.conj() / len(w)
    return abs(f - turn / abs(turn) * w).max()


@pytest.mark.parametrize("curve", CURVES.values(), ids=CURVES.keys())
def test_geodesic_algorithm_converges_on_known_curves(curve):
    errors = [
        error_up_to_rotation(geodesic_map(curve(circle(n).conj())), circle(n))
        for n in (100, 200, 400)
    ]
    assert errors[0] < 2e-3
    assert errors[0] / errors[2] > 4**1.8 or errors[2] < 1e-12  # second order


@pytest.mark.parametrize("curve", CURVES.values(), ids=CURVES.keys())
def test_theodorsen_converges_on_known_curves(curve):
    errors = [
        error_up_to_rotation(theodorsen_map(curve(circle(n).conj())), circle(n)) for n in (100, 400)
    ]
    assert errors[0] < 5e-3
    assert errors[0] / errors[1] > 4 or errors[1] < 1e-10


@pytest.mark.parametrize("curve", CURVES.values(), ids=CURVES.keys())
def test_the_two_methods_agree_on_polygons(curve):
    z = whiten(curve(circle(300).conj() * np.exp(0.2j * np.sin(3 * np.arange(300)) / 20)))
    assert error_up_to_rotation(geodesic_map(z), theodorsen_map(z)) < 5e-3


def test_coincident_points_are_spread_by_chord_length():
    w = circle(200)
    z = CURVES["ellipse"](w.conj())
    crowded = np.insert(z, 50, z[50] + 1e-11 * np.array([3, 2, 1]) * (z[49] - z[50]))
    f = geodesic_map(crowded)
    assert (increments(f) > 0).all()
    assert increments(f).sum() == pytest.approx(2 * np.pi)
    assert error_up_to_rotation(np.delete(f, [50, 51, 52]), w) < 3e-3


def test_fewest_points():
    f = geodesic_map(circle(3).conj())
    assert (increments(f) > 0).all()
    assert increments(f).sum() == pytest.approx(2 * np.pi)


@pytest.mark.parametrize("curve", CURVES.values(), ids=CURVES.keys())
def test_whitening_makes_the_moments_of_inertia_equal(curve):
    z = curve(circle(400).conj())
    white = whiten(5 * np.exp(1j) * (1.5 * z.real + 1j * z.imag) + 7)
    after = np.roll(white, -1)
    cross = (white.conj() * after).imag
    assert cross.sum() / 2 == pytest.approx(-np.pi)  # still clockwise
    assert abs((cross * (white + after)).sum()) < 1e-12
    assert abs((cross * (white**2 + white * after + after**2)).sum()) < 1e-3


def test_whitening_takes_an_ellipse_to_a_circle():
    z = CURVES["ellipse"](circle(400).conj())
    np.testing.assert_allclose(abs(whiten(z)), 1, atol=1e-3)


def test_theodorsen_refuses_what_is_not_star_shaped():
    t = 2 * np.pi * np.arange(400) / 400
    spiral = np.exp(-1j * (t + 2.5 * np.sin(t) ** 2)) * (1.2 + np.cos(t))
    assert theodorsen_map(spiral) is None


class TestFallbacks:
    """Traces that defeat one method after the other."""

    mesh = DiskMesh(*meshes.grid(12, 16))
    L = cotangent_laplacian(mesh)
    extend = staticmethod(partial(harmonic_extension, mesh, L, Factor(mesh, L)))
    n = len(mesh.loop)
    good = CURVES["ellipse"](circle(n).conj())
    crossing = circle(n).real + 1j * (circle(n) ** 2).imag  # figure of eight
    folded = np.where(np.arange(n) % 2, circle(n).conj(), np.roll(circle(n).conj(), 3))

    def run(self, trace, delaunay):
        f, method = map_to_circle(self.mesh, trace, lambda: delaunay, self.extend, whitened=True)
        assert np.isfinite(f).all()
        np.testing.assert_allclose(abs(f), 1, atol=1e-14)
        assert (increments(f) > 0).all()
        assert increments(f).sum() == pytest.approx(2 * np.pi)
        return method

    def test_geodesic_first(self):
        method = self.run(self.good, None)
        assert (method.name, method.rejected, str(method)) == ("geodesic", (), "geodesic")

    def test_delaunay_trace_second(self):
        method = self.run(self.crossing, self.good)
        assert method.name == "geodesic on the intrinsic Delaunay trace"
        assert len(method.rejected) == 1
        assert method.rejected[0].startswith("geodesic: not ")

    def test_the_least_distortion_of_the_later_ones(self):
        V, F, _ = cdcp_igl.datasets.ellipse(12)
        mesh = DiskMesh(V, F)
        L = cotangent_laplacian(mesh)
        factor = Factor(mesh, L)
        trace = boundary_trace(mesh, factor, 0)
        trace[20] = 1.5 * trace[21] - 0.5 * trace[20]  # beyond its neighbour
        maps = {}

        def extend(f_B):
            f = harmonic_extension(mesh, L, factor, f_B)
            maps[abs(plane_angles(f, mesh.F) - mesh.angles).mean()] = f_B
            return f

        f_B, method = map_to_circle(mesh, trace, lambda: trace, extend, whitened=True)
        assert method.name == "Theodorsen"
        assert len(maps) > 2
        np.testing.assert_array_equal(maps[min(maps)], f_B)

    def test_arc_length_last(self):
        method = self.run(0 * self.good, np.full(self.n, complex(np.nan)))
        assert method.name == "arc length"
        assert len(method.rejected) == 6


def test_a_mesh_that_needs_the_delaunay_trace(real_mesh):
    result = cdcp_igl.disk_map(*real_mesh("face_1180_ears"))
    assert result.trace.name == "geodesic on the intrinsic Delaunay trace"
    assert result.distortion.mean < 5.65


def test_crowding_is_an_error_that_says_where(real_mesh):
    V, F = real_mesh("maze_6120")
    with pytest.raises(cdcp_igl.MapError, match=r"Crowding: .* \(vertices \d+, \d+") as raised:
        cdcp_igl.cdcp(V, F)
    assert raised.value.result is None


def corridor(length, width=4):
    """Rectangle `length` times longer than wide."""
    x, y = np.meshgrid(np.arange(width * length + 1), np.arange(width + 1))
    corner = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (
        corner[i : i + width, j : j + width * length].ravel()
        for i, j in ((0, 0), (0, 1), (1, 1), (1, 0))
    )
    F = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return np.column_stack([x.ravel(), y.ravel()]), F


@pytest.mark.parametrize("width", [1, 2, 4])
@pytest.mark.parametrize("length", [6, 12, 16])
def test_a_long_corridor_is_mapped(length, width):
    trace = cdcp_igl.disk_map(*corridor(length, width)).trace
    assert trace.name == "geodesic"
    if length in (6, 16):
        assert (trace.n_spread > 0) == (length == 16)
    assert ("opened" in str(trace)) == (trace.n_spread > 0)


@pytest.mark.parametrize(("length", "width"), [(60, 4), (24, 4), (24, 2), (20, 4)])
def test_until_it_crowds(length, width):
    with pytest.raises(cdcp_igl.MapError, match="Crowding"):
        cdcp_igl.disk_map(*corridor(length, width))


def test_spread_moves_nothing_that_need_not_move():
    mesh = DiskMesh(*corridor(6))
    f = cdcp_igl.cdcp(*corridor(6)) @ [1, 1j]
    assert len(mesh.inscribed) == 2
    g, count = spread(mesh, f, None)
    assert g is f
    assert count == 0


def test_spread_opens_a_collapsed_ear():
    mesh = DiskMesh(*corridor(6))
    ear = mesh.F[mesh.inscribed[0]]
    tip = np.flatnonzero(np.isin(mesh.loop, ear))[1]
    angles = np.linspace(0, 2 * np.pi, len(mesh.loop), endpoint=False)
    angles[[tip - 1, tip + 1]] = angles[tip] + np.array([-1e-10, 1e-10])
    f = np.zeros(len(mesh.V), complex)
    f[mesh.loop] = np.exp(1j * angles)

    def extend(f_B):
        g = f.copy()
        g[mesh.loop] = f_B
        return g

    g, count = spread(mesh, f, extend)
    assert count == 1
    assert abs(g[mesh.loop] - f[mesh.loop]).max() < 1e-6
    uv = np.column_stack([g.real, g.imag])
    assert mesh.inscribed[0] not in flipped_faces(uv, mesh.F)[0]
    assert mesh.inscribed[0] in flipped_faces(np.column_stack([f.real, f.imag]), mesh.F)[0]
