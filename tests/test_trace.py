"""The boundary trace of the double cover, by eq. (18) and by its conjugate; the centre."""

import meshes
import numpy as np
import pytest
from igl import internal_angles
from scipy.optimize import least_squares
from surfaces import capped_tube

from cdcp_igl import datasets, disk_map
from cdcp_igl.certificate import is_around
from cdcp_igl.datasets import spherical_cap
from cdcp_igl.solve.factored import FactoredSurface
from cdcp_igl.steps.center import central_face
from cdcp_igl.steps.circle import whitened_geodesic_map
from cdcp_igl.steps.mobius import mobius_transformation
from cdcp_igl.steps.trace import boundary_trace, conjugate_trace, face_dipole
from cdcp_igl.surface.mesh import DiskMesh

TRACES = [conjugate_trace, boundary_trace]
EXACT = [datasets.spherical_cap, datasets.ellipse, datasets.square, datasets.paraboloid]
RESOLUTIONS = (10, 20, 40, 80)
POLES = 0.2 * np.exp(1j * np.arange(1, 7))  # off the centre, where no symmetry helps


def apart(f, g):
    """Largest distance of two maps of the boundary, up to a Möbius transformation."""

    def difference(parameters):
        x, y, angle = parameters
        return mobius_transformation(f, x + 1j * y) * np.exp(1j * angle) - g

    start = [0, 0, np.angle(np.vdot(f, g))]
    fitted = least_squares(lambda p: difference(p).view(float), start, xtol=1e-14, ftol=1e-14)
    return abs(difference(fitted.x)).max()


def on_the_circle(exact, resolution, pole, traces):
    """The boundary by the exact map with the pole at 0, and by each of the traces."""
    V, F, uv = exact(resolution)
    z, surface = uv @ [1, 1j], FactoredSurface.of(DiskMesh(V, F))
    face = int(abs(z[F].mean(axis=1) - pole).argmin())
    known = mobius_transformation(z, z[F[face]].mean())[surface.mesh.loop]
    return [known, *(whitened_geodesic_map(trace(surface, face)) for trace in traces)]


def rate(errors):
    """Order of convergence, from edges of one length to those of half of it and so on."""
    return np.log2(errors[0] / errors[-1]) / (len(errors) - 1)


@pytest.mark.parametrize("trace", TRACES)
def test_trace_is_clockwise(trace):
    z = trace(FactoredSurface.of(DiskMesh(*meshes.grid())), 33)
    assert (z.conj() * np.roll(z, -1)).imag.sum() < 0


@pytest.mark.parametrize("trace", TRACES)
@pytest.mark.parametrize("exact", EXACT)
def test_second_order_against_exact_maps(exact, trace):
    errors = [apart(*on_the_circle(exact, n, POLES[0], [trace])) for n in RESOLUTIONS]
    assert errors[-1] < 1e-3
    assert rate(errors) > 1.8


# At the corners of a square both are of a lower order, and not the same one.
ORDERS = {datasets.spherical_cap: 1.8, datasets.ellipse: 1.8, datasets.square: 1.4}


@pytest.mark.parametrize(("exact", "order"), ORDERS.items())
def test_order_of_the_conjugate_against_the_double_cover(exact, order):
    errors = []
    for n in RESOLUTIONS:
        maps = [on_the_circle(exact, n, pole, TRACES) for pole in POLES]
        errors.append(np.mean([apart(conjugate, cover) for _, conjugate, cover in maps]))
    assert errors[-1] < 5e-4
    assert rate(errors) > order


def test_the_conjugate_trace_closes():
    surface = FactoredSurface.of(DiskMesh(*datasets.paraboloid(12)[:2]))
    z = conjugate_trace(surface, 100)
    steps = np.roll(z, -1) - z
    # Its last step is not computed, but what is left: it must be as long as those beside it.
    assert abs(steps[-1]) == pytest.approx(abs(steps[-2]), rel=0.2)


@pytest.mark.parametrize("corners", [1, 2])
def test_a_face_at_the_boundary_may_carry_the_dipole(corners):
    V, F, _ = datasets.spherical_cap(30)
    surface = FactoredSurface.of(DiskMesh(V, F))
    face = int((surface.mesh.on_boundary[F].sum(axis=1) == corners).argmax())
    assert is_around(whitened_geodesic_map(conjugate_trace(surface, face)))
    assert disk_map(V, F, center=face).valid


def test_a_dipole_far_from_the_boundary_leaves_the_trace_no_digits():
    """The map would change with the last digits of the vertices."""
    V, F = capped_tube()
    result = disk_map(V, F)
    assert result.boundary.name == "harmonic measure"
    assert result.boundary.rejected == (
        "geodesic: the trace is too small for the digits of the dipole",
    )
    noise = 1e-15 * np.random.default_rng(0).normal(size=V.shape)
    assert abs(disk_map(V * (1 + noise), F).uv - result.uv).max() < 1e-8


@pytest.mark.parametrize(
    ("name", "most"), [("femur_2411", 1e-4), ("left_hand_53054", 1e-4), ("face_1180_ears", 1e-6)]
)
def test_maps_do_not_change_with_the_last_digits(name, most, real_mesh, map_of):
    """Not even on a mesh with collapsed faces, whose angles on the disk are noise."""
    V, F = real_mesh(name)
    noise = 1e-15 * np.random.default_rng(0).normal(size=V.shape)
    moved, still = disk_map(V * (1 + noise), F), map_of(name)
    assert abs(moved.uv - still.uv).max() < most
    assert moved.distortion.mean == pytest.approx(still.distortion.mean, abs=1e-6)


@pytest.mark.parametrize("face", [0, 33, 69])
def test_dipole_is_the_gradient_on_its_face(face):
    mesh = DiskMesh(*meshes.grid())
    r = face_dipole(mesh, face)
    assert np.count_nonzero(r) == 3
    assert abs(r.sum()) < 1e-14
    # Applied to a linear function u, it gives |e| (u_x - i u_y) in the frame of the face.
    i, j, k = mesh.F[face]
    e = mesh.V[j] - mesh.V[i]
    length = np.linalg.norm(e)
    height = mesh.V[k] - mesh.V[i] - (mesh.V[k] - mesh.V[i]) @ e / length**2 * e
    x = (mesh.V - mesh.V[i]) @ e / length
    y = (mesh.V - mesh.V[i]) @ height / np.linalg.norm(height)
    assert r @ x == pytest.approx(length)
    assert r @ y == pytest.approx(-1j * length)


# -- the centre ------------------------------------------------------------------------


def center_of(V, F, method, well_shaped=True):
    return central_face(FactoredSurface.of(DiskMesh(V, F)), method, well_shaped=well_shaped)


@pytest.mark.parametrize("method", ["heat", "torsion", "centroid"])
def test_center_of_a_symmetric_cap_touches_the_pole(method):
    V, F, _ = spherical_cap(8)
    center = center_of(V, F, method)
    assert center.method == method
    assert 0 in F[center.face]


def test_slivers_at_the_center_are_avoided():
    # Pull the pole of a flat disk onto a neighbour: the most central faces get thin.
    V, F, _ = spherical_cap(8, angle=1.0)
    V[0] = 0.95 * V[1]
    chosen, literal = (center_of(V, F, "torsion", well_shaped) for well_shaped in (True, False))
    smallest = np.degrees(internal_angles(V, F).min(axis=1))
    assert smallest[literal.face] < 20 < smallest[chosen.face]


def test_given_face():
    center = center_of(*meshes.grid(), np.int32(3))
    assert (center.method, center.face) == ("given", 3)


def test_center_hardly_matters_after_the_moebius_step(map_of):
    others = ({"center": "heat"}, {"center": "centroid"})
    means = [map_of("chinese_lion_17334", **o).distortion.mean for o in ({}, *others)]
    assert np.ptp(means) < 5e-4
