"""What every method of the table promises, and what they are made of."""

import pickle
from dataclasses import replace

import igl
import meshes
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import cdcp_igl
from cdcp_igl import (
    MapError,
    MeshError,
    angle_distortion,
    area_distortion,
    free_map,
    quasi_conformal_dilatation,
    sphere_map,
)
from cdcp_igl.algorithm import Steps, algorithm_1
from cdcp_igl.datasets import paraboloid, spherical_cap, spheroid, square
from cdcp_igl.libigl import double_areas
from cdcp_igl.reference import (
    METHODS,
    abf,
    arap,
    beltrami_coefficient,
    cem,
    double_cover,
    flash,
    harmonic,
    pgcp,
    ricci,
    sem,
    slim,
)
from cdcp_igl.reference.beltrami import generalized_laplacian, linear_beltrami_solver
from cdcp_igl.reference.certified import certified_disk_map, checked_free_map
from cdcp_igl.reference.doubled import double_cover_trace, doubled_faces, doubled_laplacian
from cdcp_igl.solve.factored import FactoredSurface
from cdcp_igl.solve.laplacian import cotangent_laplacian
from cdcp_igl.steps.center import central_face
from cdcp_igl.steps.trace import boundary_trace
from cdcp_igl.surface.mesh import DiskMesh
from cdcp_igl.surface.topology import Topology
from cdcp_igl.verdict.certificate import certify, certify_sphere


def saddle():
    """A bent square."""
    V, F, _ = square(4)
    V[:, 2] = V[:, 0] * V[:, 1] / 2
    return V, F


def rough():
    """A square with random heights."""
    V, F, _ = square(4)
    V[:, 2] = 3 * np.random.default_rng(0).random(len(V))
    return V, F


def star(arms, radius, shift):
    """A fan between long and short spokes: obtuse at the boundary, weights negative."""
    t = 2 * np.pi * np.arange(arms) / arms
    r = np.where(np.arange(arms) % 2, radius, 1)
    rim = np.column_stack([r * np.cos(t), r * np.sin(t)])
    V = np.vstack([rim, [shift * radius, shift * radius / 2]])
    return V, np.array([[i, (i + 1) % arms, arms] for i in range(arms)])


DISK_METHODS = [name for name, method in METHODS.items() if method.boundary != "sphere"]
methods = pytest.mark.parametrize("name", DISK_METHODS)


@methods
def test_result(name):
    method = METHODS[name]
    V, F = saddle()
    given = V.copy(), F.copy()
    uv = method.function(V, F)
    assert np.array_equal(V, given[0])
    assert np.array_equal(F, given[1])
    assert uv.shape == (len(V), 2)
    assert uv.dtype == np.float64
    assert np.array_equal(method.function(V, F), uv)

    mesh = DiskMesh(V, F)
    certificate = certify(mesh, uv)
    assert len(certificate.flipped) == 0
    assert certificate.valid == (method.boundary == "disk")
    if method.boundary == "disk":
        assert uv[mesh.loop[0]] == pytest.approx([1, 0], abs=1e-12)


@methods
def test_renumbered_rows_follow_v(name):
    V, F = saddle()
    order = np.random.default_rng(0).permutation(len(V))
    uv = METHODS[name].function(V[order], np.argsort(order)[F])
    mean = angle_distortion(V[order], np.argsort(order)[F], uv).mean()
    assert mean < (20 if name == "sem" else 15)  # which keeps areas
    assert angle_distortion(V, F, uv[np.argsort(order)]).mean() == pytest.approx(mean)


@methods
def test_input_that_is_no_disk(name):
    V, F = saddle()
    inside = (len(V) // 2 == F).any(axis=1).argmax()
    with pytest.raises(MeshError) as error:
        METHODS[name].function(V, np.delete(F, inside, axis=0))
    assert error.value.defect == "several boundary loops"


@pytest.mark.parametrize("name", sorted(set(METHODS) - set(DISK_METHODS)))
def test_methods_of_closed_surfaces(name):
    V, F, _ = spheroid(3, 1.5)
    V[:, 0] *= 1 + V[:, 1] / 9  # one face is the most regular
    given, method = V.copy(), METHODS[name].function
    P = method(V, F)
    np.testing.assert_array_equal(V, given)
    assert certify_sphere(F, P).valid
    assert angle_distortion(V, F, P).mean() < 1.5
    order = np.random.default_rng(0).permutation(len(V))
    renumbered = method(V[order], np.argsort(order)[F])
    np.testing.assert_allclose(renumbered, P[order], atol=1e-9)
    with pytest.raises(MeshError, match="boundary"):
        method(*saddle())


def test_flash_converges_to_the_conformal_map():
    """But for the Möbius transformation that lays all vertices over their exact images."""
    errors = []
    for levels in (2, 3, 4):
        V, F, exact = spheroid(levels, 1.5)
        result, every = sphere_map(V, F), np.arange(len(V))
        found = replace(result, points=flash(V, F))
        points = found.register(replace(result, points=exact), np.column_stack([every, every]))
        errors.append(np.linalg.norm(points - exact, axis=1).max())
    assert errors[0] / errors[2] > 5
    assert errors[2] < 0.01


TRIANGLE = [[0, 0], [1, 0], [0.4, 0.8]], [[0, 1, 2]]


@pytest.mark.parametrize("name", sorted(set(DISK_METHODS) - {"cem", "pgcp", "ricci", "sem"}))
def test_a_single_triangle(name):
    V, F = TRIANGLE
    uv = METHODS[name].function(V, F)
    assert len(certify(DiskMesh(V, F), uv).flipped) == 0


@pytest.mark.parametrize(
    ("method", "surface", "message"),
    [
        (cem, TRIANGLE, "no interior vertex"),
        (pgcp, TRIANGLE, "no interior vertex"),
        (sem, TRIANGLE, "no interior vertex"),
        (ricci, TRIANGLE, "no boundary vertex can go to infinity"),
        (ricci, meshes.grid(5, 6), "2 faces break the triangle inequality"),  # the ears
        (ricci, rough(), "not flat after"),
        (pgcp, rough(), "The parts cannot be joined"),
        (abf, rough(), "2 angles are not positive"),
    ],
)
def test_surfaces_that_a_method_cannot_map(method, surface, message):
    with pytest.raises(MapError, match=message):
        method(*surface)


def test_discrete_conformal_equivalence_keeps_length_cross_ratios():
    V, F, _ = paraboloid(6)
    uv = ricci(V, F)
    twins = Topology(F, len(V)).twins
    m = len(F)

    def log_cross_ratios(points):
        length = np.linalg.norm(points[np.roll(F, -1, axis=1)] - points[F], axis=2).T.ravel()
        return sum(
            np.log(length[(side + m) % (3 * m)] / length[(side + 2 * m) % (3 * m)])
            for side in twins
        )

    assert log_cross_ratios(uv) == pytest.approx(log_cross_ratios(V), abs=1e-6)
    V, F, exact = spherical_cap(8)  # the stereographic projection is an inversion
    turn = np.vdot(exact @ [1, 1j], ricci(V, F) @ [1, 1j])
    assert ricci(V, F) @ [1, 1j] == pytest.approx(exact @ [1, 1j] * turn / abs(turn), abs=1e-4)


@pytest.mark.parametrize("linear", [False, True])
def test_angle_based_flattening_comes_as_near_as_the_exact_map(linear):
    for resolution in (6, 12, 24):
        V, F, exact = spherical_cap(resolution)
        distortion = angle_distortion(V, F, abf(V, F, linear=linear))
        assert distortion.mean() < 1.001 * angle_distortion(V, F, exact).mean()


def test_each_method_that_keeps_lengths_has_the_least_of_its_energy():
    V, F, _ = spherical_cap(8)
    V = V * [1, 1.5, 2] + 0.1 * np.sin(2 * V[:, [1, 2, 0]])
    sheet, squares, _ = square(8)
    rolled = np.column_stack([np.sin(sheet[:, 0]), sheet[:, 1], np.cos(sheet[:, 0])])

    def energies(method, V, F):
        uv = method(V, F)
        K, area = quasi_conformal_dilatation(V, F, uv), double_areas(V, F)
        ratio = double_areas(uv, F) / area
        one, other = np.sqrt(ratio * K), np.sqrt(ratio / K)
        rigid = (one - 1) ** 2 + (other - 1) ** 2
        symmetric = (one**2 + other**2 + one**-2 + other**-2) / 4 - 1
        return np.average([rigid, symmetric], axis=1, weights=area)

    def ours(V, F):
        return free_map(V, F, keep="lengths").uv

    of_arap, of_slim, of_ours = (energies(method, V, F) for method in (arap, slim, ours))
    assert of_arap[0] < 0.999 * of_slim[0]
    assert of_slim[1] < 0.999 * of_arap[1]
    assert of_ours[1] == pytest.approx(of_slim[1], rel=1e-3)
    for method in (arap, slim):
        assert energies(method, rolled, squares).max() < 1e-9
        assert method(1000 * V, F) == pytest.approx(1000 * method(V, F), abs=1e-6)


def test_stretch_energy_evens_areas():
    errors = []
    for resolution in (6, 12):
        V, F, _ = spherical_cap(resolution)
        errors.append(abs(area_distortion(V, F, sem(V, F))).mean())
    assert errors[1] < 0.6 * errors[0]
    assert errors[1] < 0.05 * abs(area_distortion(V, F, harmonic(V, F))).mean()


@pytest.mark.parametrize("name", ["fdcp", "ldcp"])
def test_a_map_that_is_no_bijection_comes_with_the_error(name):
    mesh = star(8, 0.1, 0.1)
    with pytest.raises(MapError) as error:
        METHODS[name].function(*mesh)
    result = pickle.loads(pickle.dumps(error.value)).result
    assert not result.certificate.valid
    assert result.uv.shape == mesh[0].shape


def test_cotangents_flip_faces_of_slivers(real_mesh):
    V, F = real_mesh("cthead_115491")
    with pytest.raises(MapError) as error:
        harmonic(V, F)
    assert len(error.value.result.certificate.flipped) > 1000


@pytest.mark.parametrize("name", ["abf", "lscm", "spectral", "bff"])
def test_free_boundary_maps_leave_a_plane_mesh_as_it_is(name):
    V, F = saddle()
    plane = V[:, :2] * [1, 3]
    assert angle_distortion(plane, F, METHODS[name].function(plane, F)).max() < 1e-5


def test_flips_are_no_error_with_a_free_boundary():
    mesh = DiskMesh(*saddle())
    f = mesh.scaled[:, 0] + 1j * mesh.scaled[:, 1]
    f[10] += 1
    uv = checked_free_map(mesh, f)
    assert 0 < len(certify(mesh, uv).flipped) < len(mesh.F)
    with pytest.raises(MapError, match="not a bijection"):
        certified_disk_map(mesh, f)


@pytest.mark.parametrize(("broken", "message"), [(np.nan, "not finite"), (0, "collapsed")])
def test_free_boundary_maps_that_are_none(broken, message):
    mesh = DiskMesh(*saddle())
    with pytest.raises(MapError, match=message) as error:
        checked_free_map(mesh, np.full(len(mesh.scaled), complex(broken)))
    assert error.value.result.uv.shape == (len(mesh.scaled), 2)


# -- Beltrami coefficients, and the double cover ---------------------------------------


PLANE, F, _ = square(2)
PLANE *= 2  # vertices at integers
X, Y, _ = PLANE.T
N = len(PLANE)
GRID = X + 1j * Y

# Less than a fifth of the spacing: no triangle of the jittered grid collapses.
jitters = hnp.arrays(np.float64, (N, 2), elements=st.floats(-0.2, 0.2))
heights = hnp.arrays(np.float64, N, elements=st.floats(-2, 2))


@settings(deadline=None)
@given(
    jitter=jitters,
    height=heights,
    stretch=st.floats(0.02, 50),
    shear=st.floats(-3, 3),
    mirrored=st.booleans(),
)
def test_on_any_chart_the_coefficient_to_the_surface_gives_its_cotangent_laplacian(
    jitter, height, stretch, shear, mirrored
):
    mesh = DiskMesh(np.column_stack([X, Y, height]), F)
    x, y = X + jitter[:, 0], Y + jitter[:, 1]
    p = stretch * x + shear * y + 1j * y
    if mirrored:
        p = p.conj()
    G = generalized_laplacian(p, mesh.F, beltrami_coefficient(p, mesh.F, mesh.scaled))
    L = cotangent_laplacian(mesh).matrix()
    assert abs(G - L).max() <= 1e-9 * abs(L).max()


@pytest.mark.parametrize(
    ("chart", "M", "mu"),
    [
        ((2 - 3j) * GRID, PLANE, 0),  # conformal
        (GRID, PLANE * [3, 1, 1], 1 / 2),  # (K - 1) / (K + 1)
        (GRID, PLANE * [1, 3, 1], -1 / 2),
        # x + sy + iy has w_z = (2 - is)/2, w_zbar = is/2; here s = 2
        (GRID, PLANE + np.outer(Y, [2, 0, 0]), 2j / (2 - 2j)),
        (X + 0j, PLANE, -1),  # collapsed
    ],
)
def test_coefficient_of_an_affine_map(chart, M, mu):
    assert beltrami_coefficient(chart, F, M) == pytest.approx(mu, abs=1e-14)


def test_linear_beltrami_solver_finds_the_affine_map():
    mu = 0.3 - 0.4j
    w = GRID + mu * GRID.conj()
    S = DiskMesh(PLANE, F).loop
    found = linear_beltrami_solver(GRID, F, np.full(len(F), mu), S, w[S])
    assert found == pytest.approx(w, abs=1e-13)


def test_doubled_faces_close_the_surface():
    F2 = doubled_faces(DiskMesh(*meshes.fan(4)))
    assert F2.tolist()[4:] == [[1, 0, 5], [2, 1, 5], [3, 2, 5], [0, 3, 5]]
    assert cdcp_igl.check(np.zeros((6, 3)), F2).defects[0].name == "closed surface"


def test_doubled_laplacian_is_that_of_the_glued_surface(real_mesh):
    mesh = DiskMesh(*real_mesh("nefertiti_299"))
    V2 = np.vstack([mesh.scaled, mesh.scaled[mesh.interior]])
    explicit = -igl.cotmatrix(V2, doubled_faces(mesh))
    L2 = doubled_laplacian(mesh, cotangent_laplacian(mesh).matrix())
    assert abs(L2 - explicit).max() <= 1e-14 * abs(explicit).max()


@pytest.mark.parametrize("name", ["nefertiti_299", "human_face_17157", "chinese_lion_17334"])
def test_theorem_1_both_systems_give_the_same_trace_up_to_shift_and_scale(name, real_mesh):
    surface = FactoredSurface.of(DiskMesh(*real_mesh(name)))
    face = central_face(surface).face
    reduced = boundary_trace(surface, face)  # (18)
    explicit = double_cover_trace(surface, face)  # (17)

    reduced, explicit = reduced - reduced.mean(), explicit - explicit.mean()
    scale = np.vdot(explicit, reduced) / np.vdot(explicit, explicit)
    assert abs(scale * explicit - reduced).max() <= 1e-10 * abs(reduced).max()
    assert scale == pytest.approx(2, abs=1e-10)


@pytest.mark.parametrize("name", ["nefertiti_299", "chinese_lion_17334"])
def test_the_map_is_that_of_cdcp(name, real_mesh):
    V, F = real_mesh(name)
    f = algorithm_1(FactoredSurface.of(DiskMesh(V, F)), Steps(trace=boundary_trace))
    assert abs(double_cover(V, F) @ [1, 1j] - f).max() < 1e-8
