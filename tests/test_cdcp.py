"""The whole algorithm: published values, invariances, errors, convergence to known maps."""

import pickle

import meshes
import numpy as np
import pytest
import surfaces
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import cdcp_igl
from cdcp_igl import datasets
from cdcp_igl.reference import METHODS
from cdcp_igl.solve.laplacian import cotangent_laplacian
from cdcp_igl.surface.mesh import DiskMesh

# Mean and SD of the angular distortion in degrees that an independent prototype reached.
PROTOTYPE = {
    "nefertiti_299": (2.5002, 3.3465),
    "camelhead_11381": (1.4846, 1.5441),
    "chinese_lion_17334": (1.4198, 2.0479),
    "human_face_17157": (1.2091, 1.8332),
    "stanford_bunny_31593": (1.0294, 1.5209),
    "human_brain_48463": (1.4575, 1.5892),
    "left_hand_53054": (1.2121, 1.3092),
    "itokawa_93920": (0.4585, 0.9865),
    "gcanyon_216196": (0.4200, 0.6879),
    "nefertiti_750281": (0.1969, 0.3085),
}

# Where the trace of the conjugate problem, of the same order as eq. (18), has a higher mean and a
# lower SD (34 boundary vertices), or the other way round (a boundary in steps); by the way to the
# conformal barycentre, which costs a mean up to 0.3 % here.
MORE = {"nefertiti_299": (1.012, 0.966), "itokawa_93920": (1.000, 1.018)}

# Table 1 of the paper, for the models that are the paper's own.
TABLE_1 = {
    "chinese_lion_17334": (1.42, 2.05),
    "stanford_bunny_31593": (1.03, 1.52),
    "human_brain_48463": (1.46, 1.59),
}


@pytest.mark.parametrize("name", PROTOTYPE)
def test_values_of_the_prototype(map_of, name):
    result = map_of(name)
    mean, sd = PROTOTYPE[name]
    more_mean, more_sd = MORE.get(name, (1.005, 1.005))
    assert result.distortion.mean <= more_mean * mean
    assert result.distortion.sd <= more_sd * sd
    assert len(result.certificate.flipped) == 0
    assert result.certificate.boundary_error < 1e-12
    assert result.boundary.name == "geodesic"


@pytest.mark.parametrize("options", [{}, {"preset": "paper"}], ids=str)
@pytest.mark.parametrize("name", TABLE_1)
def test_table_1(map_of, name, options):
    result = map_of(name, **options)
    mean, sd = TABLE_1[name]
    assert result.distortion.mean == pytest.approx(mean, abs=0.01)
    assert result.distortion.sd == pytest.approx(sd, abs=0.01)
    assert result.certificate.valid
    if options:
        assert (result.center.method, result.mobius.method) == ("heat", "nelder-mead")


V, F = meshes.grid(9, 11)
Z = cdcp_igl.cdcp(V, F) @ [1, 1j]


def same_up_to_rotation(z, w, atol=1e-9):
    turn = np.vdot(w, z)
    np.testing.assert_allclose(z, w * turn / abs(turn), atol=atol)


@settings(max_examples=30)
@given(
    st.integers(0, 2**32 - 1),
    st.floats(-12, 12).map(lambda x: 10**x),
    st.floats(0, 100),
)
def test_equivariance(seed, scale, offset):
    """Rigid motions, scalings, renumbering and cyclic corners change nothing."""
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(V))
    renumbered = np.argsort(order)[F][rng.permutation(len(F))]
    shift = rng.integers(0, 3, len(F))
    faces = np.take_along_axis(renumbered, (np.arange(3) + shift[:, None]) % 3, axis=1)
    moved = Rotation.random(random_state=seed % 1000).apply(V) + offset * rng.normal(size=3)
    z = cdcp_igl.cdcp(scale * moved[order], faces) @ [1, 1j]
    same_up_to_rotation(z, Z[order])


def test_deterministic():
    np.testing.assert_array_equal(cdcp_igl.cdcp(V, F), cdcp_igl.cdcp(V, F))


def test_reversed_faces_give_the_mirror_image():
    z = cdcp_igl.cdcp(V, F[:, ::-1]) @ [1, 1j]
    same_up_to_rotation(z.conj(), Z)  # the geodesic algorithm goes around the other way, too


def test_interior_is_harmonic():
    mesh = DiskMesh(V, F)
    result = cdcp_igl.disk_map(V, F, mobius=None, refine=0)
    flux = cotangent_laplacian(mesh).matrix() @ result.uv
    assert abs(flux[mesh.interior]).max() < 1e-12
    assert abs(flux[mesh.loop]).max() > 0.1


def test_invalid_map_is_an_error_that_carries_the_map():
    """A closed tube over a triangle, whose end is smaller than the smallest double."""
    with pytest.raises(cdcp_igl.MapError, match=r"flipped faces .* arc length.*igl\.cut") as raised:
        cdcp_igl.cdcp(*surfaces.capped_tube(3, 400))
    result = raised.value.result
    assert not result.certificate.valid
    assert "NOT VALID" in str(result)
    assert pickle.loads(pickle.dumps(raised.value)).result.uv.shape == (1201, 2)
    crowded = "arc length: it crowds the mean values too much for double precision"
    assert {"harmonic measure: no certificate", crowded} <= set(result.boundary.rejected)


def test_errors_survive_pickling():
    with pytest.raises(cdcp_igl.MeshError) as raised:
        cdcp_igl.cdcp(V, F[:, [0, 0, 1]])
    copy = pickle.loads(pickle.dumps(raised.value))
    assert str(copy) == str(raised.value)
    np.testing.assert_array_equal(copy.indices, raised.value.indices)


@pytest.mark.parametrize(
    ("mesh", "refine"),
    [((V, F), 0), ((V, F), 4), (meshes.corridor(60), 0)],
    ids=["plain", "refined", "several attempts"],
)
def test_progress_and_timings(mesh, refine):
    seen = []
    result = cdcp_igl.disk_map(*mesh, refine=refine, progress=lambda *step: seen.append(step))
    phases, fractions = zip(*seen, strict=True)
    assert set(phases) == {*result.timings, "done"}
    assert list(fractions) == sorted(fractions)
    assert (fractions[0], seen[-1]) == (0, ("done", 1))
    assert list(result.timings)[-1] == "distortion"
    assert len({fraction for phase, fraction in seen if phase == "refine"}) == refine + (refine > 0)
    assert all(seconds >= 0 for seconds in result.timings.values())


def test_distortion_with_and_without_inscribed_faces(real_mesh, map_of):
    V, F = real_mesh("face_1180_ears")
    result = map_of("face_1180_ears")
    assert result.boundary.name == "harmonic measure"
    assert result.boundary.rejected == ("geodesic: the trace turns back",)
    mesh = DiskMesh(V, F)
    degrees = cdcp_igl.angle_distortion(V, F, result.uv)
    on_boundary = np.isin(F, mesh.loop)
    assert len(result.certificate.flipped) == 0
    assert result.distortion.mean <= 5.65
    assert degrees[~on_boundary.any(axis=1)].mean() <= 1.30
    free = degrees[~on_boundary.all(axis=1)]
    assert result.distortion_of_free_faces.mean == pytest.approx(free.mean())
    assert result.distortion_of_free_faces.max == pytest.approx(free.max())
    assert result.distortion_of_free_faces.mean < result.distortion.mean
    assert "of free faces" in str(result)
    assert ", without those with all corners on the circle" in str(result)
    report = result.report()["angular_distortion_of_free_faces_degrees"]
    assert report["mean"] == result.distortion_of_free_faces.mean


@pytest.mark.parametrize("mesh", [meshes.TRIANGLE, meshes.strip(), meshes.fan()])
def test_distortion_where_no_face_or_every_face_is_free(mesh):
    result = cdcp_igl.disk_map(*mesh)
    assert result.distortion_of_free_faces == result.distortion
    assert "of free faces" not in str(result)


# -- convergence to maps known in closed form, up to the Möbius group ------------------


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
        fitted = powers @ np.linalg.lstsq(powers, z, rcond=None)[0]
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
