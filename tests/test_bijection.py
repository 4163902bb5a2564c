"""Points, fields, images and meshes carried through a map, and two maps registered."""

import logging
from dataclasses import replace
from fractions import Fraction
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from meshes import TRIANGLE, corridor, fan, grid, strip
from surfaces import pierced_sphere, ring, sphere

import cdcp_igl
from cdcp_igl.arrays import coordinates
from cdcp_igl.result.landmarks import Automorphism, landmark_automorphism
from cdcp_igl.verdict.certificate import certify_sphere


@pytest.fixture(scope="module")
def cap():
    V, F, _ = cdcp_igl.datasets.spherical_cap(30, angle=100)
    return V, F, cdcp_igl.disk_map(V, F)


def points_of(kind, F, k, rng):
    """Random points of the faces, of their edges, or the corners."""
    face = rng.integers(len(F), size=k)
    barycentric = rng.dirichlet([1, 1, 1], k)
    if kind == "edges":
        barycentric[np.arange(k), rng.integers(3, size=k)] = 0
        barycentric /= barycentric.sum(axis=1, keepdims=True)
    if kind == "vertices":
        barycentric = np.eye(3)[rng.integers(3, size=k)]
    return face, barycentric


def weights(F, n, face, barycentric):
    """A sparse row of vertex weights a point: the same, whichever face an edge is seen from."""
    from scipy.sparse import csr_matrix

    rows = np.repeat(np.arange(len(face)), 3)
    return csr_matrix((barycentric.ravel(), (rows, F[face].ravel())), (len(face), n))


# Each with the error of its images and of its weights, at most.
SMALL = {"triangle": TRIANGLE, "fan": fan(), "strip": strip(), "grid": grid()}
MAPS = {
    **{name: (partial(cdcp_igl.disk_map, *mesh), 1e-12, 1) for name, mesh in SMALL.items()},
    "cap": (lambda: cdcp_igl.disk_map(*cdcp_igl.datasets.spherical_cap(30)[:2]), 1e-15, 1e-12),
    "spheroid": (
        *(lambda: cdcp_igl.sphere_map(*cdcp_igl.datasets.spheroid(3, 2)[:2]), 1e-14, 1e-12),
    ),
    # With faces of 1e-31 at points of 1e-20, where rounding takes the last digits of weights.
    "crowded sphere": (lambda: cdcp_igl.sphere_map(*sphere(30, 12, 160)), 1e-14, 1),
    "ring": (
        *(lambda: cdcp_igl.annulus_map(*ring(20, 40, lambda s: (0.3**s, 0 * s))[:2]), 1e-14, 1e-12),
    ),
    "ring around 1e-43": (
        lambda: cdcp_igl.annulus_map(*ring(200, 12, lambda s: (1 + 0 * s, 100 * s))[:2]),
        *(1e-14, 1e-12),
    ),
    "filled": (lambda: cdcp_igl.annulus_map(*pierced_sphere()), 1e-14, 1e-12),  # two of four holes
}


@pytest.mark.parametrize("name", MAPS)
def test_points_there_and_back(name):
    made, away, off = MAPS[name]
    result = made()
    V, F = result._surface()
    for kind in ("faces", "edges", "vertices"):
        face, barycentric = points_of(kind, F, 5000, np.random.default_rng(3))
        image = result.apply(face, barycentric)
        found, found_barycentric = result.invert(image)
        assert found_barycentric.min() >= 0
        assert abs(result.apply(found, found_barycentric) - image).max() < away
        there = weights(F, len(V), face, barycentric)
        assert abs(there - weights(F, len(V), found, found_barycentric)).max() < off
        assert abs(result.interpolate(V, image) - there @ V).max() < 100 * off
        if kind == "faces" and off < 1:
            assert (found == face).mean() > 0.999  # rounding moves a few across an edge
    if name == "filled":
        filled = coordinates(result._f)[result.mesh.F[len(F) :]].mean(axis=1)
        assert (result.invert([*filled, [0, 0], [2, 0]])[0] == -1).all()


CROWDED = {
    "corridor": lambda: cdcp_igl.disk_map(*corridor(22, 2)),
    "wide corridor": lambda: cdcp_igl.disk_map(*corridor(22, 6)),
    "free": lambda: cdcp_igl.free_map(*corridor(22)),
    "ring": lambda: cdcp_igl.annulus_map(*ring(60, 12, lambda s: (1 + 0 * s, 22 * s))[:2]),
    "charts": lambda: cdcp_igl.surface_map(*sphere(30, 12, 100)),
}


@pytest.mark.parametrize("name", CROWDED)
def test_points_of_crowded_maps_are_off_by_rounding(name):
    """Points of needles at the boundary, too, which rounding may take off the image."""
    result = CROWDED[name]()
    _, F = result._surface()
    rng = np.random.default_rng(2)
    image = np.concatenate(
        [
            result.apply(*points_of(kind, F, k, rng))
            for kind, k in (("faces", 20_000), ("edges", 50_000), ("vertices", 5000))
        ]
    )
    face, barycentric = result.invert(image)
    assert barycentric.min() >= 0
    assert abs(result.apply(face, barycentric) - image).max() < 16 * 2.0**-53 * abs(image).max()


def contain(corners, points):
    """Whether cones over triangles (k, 3, 3) contain points (k, 3), in exact arithmetic."""
    for triangle, point in zip(corners, points, strict=True):
        *edges, p = ([Fraction(x) for x in row] for row in (*triangle.tolist(), point.tolist()))
        for a, b in zip(edges, edges[1:] + edges[:1], strict=True):
            normal = [a[k - 2] * b[k - 1] - a[k - 1] * b[k - 2] for k in range(3)]
            yield sum(x * y for x, y in zip(normal, p, strict=True)) >= 0


@pytest.mark.parametrize("stretch", [20, 80, 120, 160, 200])
def test_points_lie_in_their_faces_on_crowded_spheres(stretch):
    """Many faces of long surfaces are far below rounding on the sphere."""
    result = cdcp_igl.sphere_map(*sphere(30, 12, stretch))
    _, F = result._surface()
    rng = np.random.default_rng(3)
    for kind in ("faces", "edges", "vertices"):
        points = result.apply(*points_of(kind, F, 2000, rng))
        points = np.concatenate([points, points.astype(np.float32)])
        points /= np.linalg.norm(points, axis=1)[:, None]
        face, barycentric = result.invert(points)
        assert barycentric.min() >= 0
        assert abs(result.apply(face, barycentric) - points).max() < 1e-14
        rows = rng.permutation(len(points))[:300]
        unit = points / np.linalg.norm(points, axis=1)[:, None]
        assert all(contain(result.points[F[face[rows]]], unit[rows]))


def test_every_direction_has_a_place_on_a_sphere():
    V, F, exact = cdcp_igl.datasets.spheroid(3, 2)
    result = cdcp_igl.sphere_map(V, F)
    directions = 7 * np.random.default_rng(4).normal(size=(50, 40, 3))
    found = result.apply(*result.invert(directions))
    lengths = np.linalg.norm(directions, axis=2)[..., None]
    assert abs(found - directions / lengths).max() < 1e-15
    with pytest.raises(ValueError, match="bijection"):
        replace(result, certificate=certify_sphere(F, -exact)).invert([1, 0, 0])


@pytest.mark.parametrize("name", ["femur_2411", "maze_6120"])
def test_points_of_crowded_maps(real_mesh, name):
    V, F = real_mesh(name)
    result = cdcp_igl.disk_map(V, F, refine=0)
    uv = result.apply(*points_of("faces", F, 50_000, np.random.default_rng(2)))
    face, barycentric = result.invert(uv)
    assert barycentric.min() >= 0
    assert abs(result.apply(face, barycentric) - uv).max() < 1e-12


def test_every_point_of_the_disk_has_a_place_and_no_other(cap):
    _, _, result = cap
    rng = np.random.default_rng(3)
    z = np.sqrt(rng.random(20_000)) * np.exp(2j * np.pi * rng.random(20_000))
    z = np.concatenate([z, np.exp(2j * np.pi * rng.random(20_000))])
    uv = np.column_stack([z.real, z.imag])
    face, barycentric = result.invert(uv)
    assert face.min() >= 0
    found = result.apply(face, barycentric)
    away = np.linalg.norm(found - uv, axis=1)
    # Beyond a chord the nearest point is its foot: at right angles, at most the sagitta away.
    chords = np.diff(result.uv[np.append(result.mesh.loop, result.mesh.loop[0])], axis=0)
    beyond = away > 1e-15
    assert beyond.any()
    assert away.max() <= 1 - np.sqrt(1 - (np.linalg.norm(chords, axis=1).max() / 2) ** 2) + 1e-15
    assert ((barycentric[beyond] == 0).sum(axis=1) >= 1).all()
    outside, nan = result.invert(1.001 * np.column_stack([np.cos([0, 1]), np.sin([0, 1])]))
    assert (outside == -1).all()
    assert np.isnan(nan).all()


@pytest.mark.parametrize("size", [6, 10, 20, 40])
@pytest.mark.parametrize("hole", [0.15, 0.5])
def test_what_is_rounded_at_the_circles_of_a_ring_is_taken_to_them(size, hole):
    """A walk from circle to circle, around for ever, is cut short."""
    V, F, uv = cdcp_igl.datasets.spherical_cap(size)
    used, G = np.unique(F[np.hypot(*uv.T)[F].min(axis=1) > hole], return_inverse=True)
    result = cdcp_igl.annulus_map(V[used], G.reshape(-1, 3), refine=0)
    for points in (result.uv.astype(np.float32), result.uv.round(6)):
        found = result.apply(*result.invert(points))
        assert abs(found - points).max() < 1e-6
    beyond = result.uv[result.mesh.loops[1]] * (1 - 3e-6 / result.radius)  # in the hole
    assert (result.invert(beyond)[0] == -1).all()


def test_shapes_are_kept(cap):
    V, _, result = cap
    face, barycentric = result.invert(np.zeros((4, 5, 2)))
    assert face.shape == (4, 5)
    assert barycentric.shape == (4, 5, 3)
    assert result.apply(face, barycentric).shape == (4, 5, 2)
    assert result.interpolate(V, np.zeros((4, 5, 2))).shape == (4, 5, 3)
    assert result.interpolate(V[:, 0], [0, 0]).shape == ()
    assert result.invert(np.zeros((0, 2)))[0].shape == (0,)


def test_bake_and_pull_back_are_inverse_at_second_order(cap):
    """Both are linear between samples, so their error falls with the square of the pixel."""
    _, _, result = cap
    inside = np.linalg.norm(result.uv, axis=1) < 0.9
    image = result.bake(result.uv, size=256)
    assert image.shape == (256, 256, 2)
    # The coordinates themselves are linear: the top row is v = 1, the left column u = -1.
    assert abs(image[64, 192] - [0.5 + 1 / 256, 0.5 - 1 / 256]).max() < 1e-13
    assert abs(result.pull_back(image) - result.uv)[inside].max() < 1e-13
    errors = []
    for size in (64, 128):
        x = (2 * np.arange(size) + 1) / size - 1
        samples = np.sin(3 * x)[None, :] * np.cos(2 * -x)[:, None]
        exact = np.sin(3 * result.uv[:, 0]) * np.cos(2 * result.uv[:, 1])
        errors.append(abs(result.pull_back(samples) - exact)[inside].max())
    assert 3.5 < errors[0] / errors[1] < 4.5


def test_a_remeshed_surface_has_the_shapes_of_the_lattice():
    """On a known conformal map, angles change by the first power of the side."""
    V, F, _ = cdcp_igl.datasets.spherical_cap(120, angle=100)
    result = cdcp_igl.disk_map(7 * V, F, mobius="area")
    means = []
    for side in (0.2, 0.1):
        W, G, uv = result.remesh(side)
        assert cdcp_igl.check(W, G).is_disk
        assert abs(np.linalg.norm(W, axis=1) - 7).max() < 0.01  # in the unit of V
        means.append(cdcp_igl.angle_distortion(W, G, uv).mean())
    assert means[1] < 0.6 * means[0] < 3
    assert (np.linalg.norm(uv, axis=1) <= 1 + 1e-15).all()


def test_new_faces_without_area_are_said(caplog):
    """On the disk, the longest edge at the end of a corridor leaves an arc 0.04 high."""
    result = cdcp_igl.disk_map(*corridor(15, 6))
    with caplog.at_level(logging.WARNING, "cdcp_igl"):
        W, G, _ = result.remesh(0.05)
        assert cdcp_igl.check(W, G).is_disk
        assert not caplog.records
        W, G, _ = result.remesh(0.02)
    [defect] = cdcp_igl.check(W, G).defects
    [record] = caplog.records
    assert defect.name == "degenerate face"
    assert record.message.startswith(f"{len(defect.indices)} new faces have no area")


@pytest.mark.parametrize("exponent", [-600, 600])
def test_a_new_mesh_does_not_depend_on_the_unit(exponent):
    V, F, _ = cdcp_igl.datasets.square(8)
    W, G, uv = cdcp_igl.disk_map(V, F).remesh(0.13)
    scaled = cdcp_igl.disk_map(np.ldexp(V, exponent), F).remesh(0.13)
    for array, other in zip((np.ldexp(W, exponent), G, uv), scaled, strict=True):
        np.testing.assert_array_equal(array, other)


def test_a_remeshed_square_keeps_its_corners():
    V, F, _ = cdcp_igl.datasets.square(30)
    V = V - V.min(axis=0)
    result = cdcp_igl.disk_map(V, F)
    W, G, uv = result.remesh(0.13)
    for corner in V.max(axis=0)[:2] * [[0, 0], [1, 0], [1, 1], [0, 1]]:
        assert np.linalg.norm(W[:, :2] - corner, axis=1).min() < 0.005  # of 2
    assert cdcp_igl.check(W, G).is_disk
    lengths = abs(np.diff(np.append(uv, uv[:1], axis=0)[: 1 + round(2 * np.pi / 0.13)], axis=0))
    assert np.linalg.norm(lengths, axis=1).min() > 0.06
    new = cdcp_igl.disk_map(W, G)
    assert new.distortion.mean < 4


# -- registration ----------------------------------------------------------------------

POINTS = st.builds(
    lambda r, t: r * np.exp(1j * t), st.sampled_from([0.1, 0.5, 0.9, 1.0]), st.floats(0, 6)
)


@given(
    st.lists(POINTS, min_size=2, max_size=6),
    st.floats(-3, 3),
    st.floats(0, 0.95),
    st.floats(0, 6),
)
def test_a_known_automorphism_is_found(z, angle, radius, direction):
    z = np.array(z)
    if min(abs(z[:, None] - z + np.eye(len(z))).min(), 1) < 1e-3:
        return
    T = Automorphism.of(angle, radius * np.exp(1j * direction))
    found = landmark_automorphism(z, T(z))
    assert abs(found(z) - T(z)).max() < 1e-7


def test_registration_does_not_depend_on_the_normalisation(cap):
    V, F, result = cap
    other = cdcp_igl.disk_map(V, F, mobius="area", align=[0.3, 1, 0])
    landmarks = np.column_stack([[3, 500, 1200, 2000]] * 2)
    uv = result.register(other, landmarks)
    assert abs(uv - other.uv).max() < 1e-9
    assert abs(other.interpolate(V, uv) - V).max() < 1e-7


def test_a_registration_says_how_far_landmarks_are_and_if_a_mirror_is_nearer(caplog):
    V, F, _ = cdcp_igl.datasets.spherical_cap(12)
    V = V * [150, 100, 50] + 20 * np.sin(V[:, [1]] + 2 * V[:, [0]])
    one, hand = cdcp_igl.disk_map(V, F), cdcp_igl.disk_map(V * [-1, 1, 1], F[:, ::-1])
    pairs = np.column_stack([[3, 40, 120, 200, 300]] * 2)
    same = one.register(one, pairs)
    assert same.residual.max() < 1e-6
    assert np.median(same.mirrored) > 10
    assert not caplog.records
    other = one.register(hand, pairs)
    assert np.median(other.residual) > 10
    assert other.mirrored.max() < 1
    assert "are left and right exchanged" in caplog.text
    x = V[pairs[:, 0]] * [-1, 1, 1]
    off = np.linalg.norm(hand.interpolate(hand.mesh.V, other)[pairs[:, 0]] - x, axis=1)
    np.testing.assert_allclose(off, other.residual, rtol=1e-6)


@pytest.mark.parametrize("landmarks", [[0, -1], [200, 150, 300]])
def test_a_crowded_map_is_registered_with_itself(landmarks):
    """Faces at the ends of a strip are as thin as rounding errors."""
    V, F = corridor(15, 6)
    result = cdcp_igl.disk_map(V, F)
    pairs = np.column_stack([np.arange(len(V))[landmarks]] * 2) % len(V)
    uv = result.register(result, pairs)
    assert abs(uv - result.uv).max() < 1e-13


def test_a_registration_that_cannot_be_certified_is_an_error_with_its_map(cap):
    _, _, result = cap
    here, there = np.array([result.uv[:, 0].argmax(), result.uv[:, 0].argmin()]), [0, 1]
    other = replace(result, _f=np.array([1, 1 - 1e-15 + 4e-8j]))
    with pytest.raises(cdcp_igl.MapError, match="Moved to the landmarks") as raised:
        result.register(other, np.column_stack([here, there]))
    assert not raised.value.result.valid
    assert not np.array_equal(raised.value.result.uv, result.uv)
    assert result.valid
