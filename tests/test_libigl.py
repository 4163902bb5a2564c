"""What comes out of libigl, and what must be more exact: cotangents, areas, angles of slivers."""

import igl
import meshes
import mpmath
import numpy as np
import pytest

import cdcp_igl
from cdcp_igl import libigl
from cdcp_igl.distortion import angle_distortion
from cdcp_igl.surface.mesh import DiskMesh
from cdcp_igl.surface.triangles import corner_cotangents, degenerate_faces, face_areas


def test_the_main_path_computes_with_libigl(monkeypatch):
    """Cotangents, areas, boundary loop and reported angles."""
    V, F, _ = cdcp_igl.datasets.spherical_cap(10)
    called = []

    def spied(name, function):
        return lambda *arguments: called.append(name) or function(*arguments)

    names = ("squared_edge_lengths", "doublearea", "edges_to_path", "internal_angles")
    for name in names:
        monkeypatch.setattr(igl, name, spied(name, getattr(igl, name)))
    cdcp_igl.disk_map(V, F)
    assert set(called) == set(names)


def test_the_reported_angles_are_libigls(monkeypatch):
    V, F, _ = cdcp_igl.datasets.spherical_cap(10)
    angles = igl.internal_angles
    monkeypatch.setattr(igl, "internal_angles", lambda V, F: np.zeros_like(angles(V, F)))
    assert cdcp_igl.disk_map(V, F).distortion.mean == pytest.approx(60)


@pytest.mark.parametrize("seed", range(4))
def test_a_path_follows_its_edges_wherever_they_are_listed(seed):
    rng = np.random.default_rng(seed)
    loop = rng.permutation(100)[:12]
    edges = np.column_stack([loop, np.roll(loop, -1)])[rng.permutation(12)]
    path = libigl.path(edges)
    np.testing.assert_array_equal(np.roll(path, -path.argmin()), np.roll(loop, -loop.argmin()))


def test_the_loop_has_the_surface_on_its_left():
    V, F = meshes.grid()
    for faces in (F, F[:, ::-1]):
        loop = DiskMesh(V, faces).loop
        sides = {(a, b) for f in faces.tolist() for a, b in zip(f, f[1:] + f[:1], strict=True)}
        assert sides.issuperset(zip(loop.tolist(), np.roll(loop, -1).tolist(), strict=True))


def test_a_grid_is_counterclockwise_seen_with_the_first_row_below():
    F = libigl.grid_faces(4, 3)
    x, y = np.meshgrid(np.arange(4.0), np.arange(3.0))
    assert (libigl.double_areas(np.column_stack([x.ravel(), y.ravel()]), F) == 1).all()


def test_a_vertex_without_area_has_no_normal():
    V = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 5, 5]])
    normals = libigl.vertex_normals(V, np.array([[0, 1, 2]]))
    np.testing.assert_array_equal(normals[:3], [[0, 0, 1]] * 3)
    assert np.isnan(normals[3]).all()


# -- slivers, against arithmetic with 50 digits ----------------------------------------


EPS = np.finfo(float).eps
COUNT = 40  # placements of each shape
SHAPES = {  # by their small angle
    "cap": lambda angle: [[0, 0, 0], [1, 0, 0], [0.5, 0.5 * np.tan(angle), 0]],
    "needle": lambda angle: [[0, 0, 0], [1, 0, 0], [np.cos(angle), np.sin(angle), 0]],
}


def placed(shape, angle):
    """One sliver in many places, turned and scaled, its corners in another order."""
    rng = np.random.default_rng(0)
    corners = []
    for _ in range(COUNT):
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        moved = SHAPES[shape](angle) @ turn * rng.uniform(0.3, 0.6) + rng.uniform(-0.4, 0.4, 3)
        corners.append(np.roll(moved, rng.integers(3), axis=0))
    return np.vstack(corners), np.arange(3 * COUNT).reshape(-1, 3)


def exact(triangles):
    """Cotangents (m, 3), areas (m,) and angles (m, 3) of triangles (m, 3, 3) as they are."""
    cotangents, areas, angles = [], [], []
    with mpmath.workdps(50):
        for triangle in triangles.tolist():
            corner = [mpmath.matrix(point) for point in triangle]
            ahead = [corner[k - 2] - corner[k] for k in range(3)]
            back = [corner[k - 1] - corner[k] for k in range(3)]
            a, b = ahead[0], back[0]
            normal = [a[k - 2] * b[k - 1] - a[k - 1] * b[k - 2] for k in range(3)]
            double_area = mpmath.norm(normal)
            products = [mpmath.fdot(x, y) for x, y in zip(ahead, back, strict=True)]
            cotangents.append([product / double_area for product in products])
            areas.append(double_area / 2)
            angles.append([mpmath.atan2(double_area, product) for product in products])
        return tuple(np.array(values, dtype=object) for values in (cotangents, areas, angles))


def error(computed, expected):
    """Absolute errors, rounded once."""
    with mpmath.workdps(50):
        return np.vectorize(lambda a, b: float(abs(mpmath.mpf(a) - b)))(computed, expected)


@pytest.mark.parametrize("exponent", [1, 3, 5, 8])
@pytest.mark.parametrize("shape", SHAPES)
def test_slivers_lose_no_more_digits_than_their_shape_takes(shape, exponent):
    """Rounded differences of coordinates alone move a corner by EPS, an angle by EPS / angle."""
    angle = 10.0**-exponent
    V, F = placed(shape, angle)
    cotangents, areas, angles = exact(V[F])
    lost = EPS / angle
    computed = corner_cotangents(V, F)
    size = abs(cotangents).astype(float)
    largest = size.max(axis=1, keepdims=True)
    large = size > largest / 3
    errors = error(computed, cotangents)
    assert (errors[large] / size[large]).max() < lost
    # Those of a needle's right angles are differences of squares of lengths near 1.
    assert errors[~large].max(initial=0) < 4 * lost
    assert (error(face_areas(V, F), areas) / areas.astype(float)).max() < lost
    collapsed = np.zeros((len(V), 2))  # all of its angles count as 0
    degrees = angle_distortion(V, F, collapsed)
    assert error(np.radians(degrees), angles).max() < 8 * EPS


def test_lengths_alone_lose_the_area_of_a_cap():
    """Why cotangents are not those of `igl.cotmatrix`, which takes areas by Heron's formula."""
    V, F = placed("cap", 1e-6)
    cotangents, _, _ = exact(V[F])
    size = abs(cotangents).astype(float)
    ours = error(corner_cotangents(V, F), cotangents) / size
    herons = error(2 * igl.cotmatrix_entries(V, F), cotangents) / size
    assert ours.max() < 1e-9
    assert herons.max() > 1e-6


def test_faces_without_area_have_no_cotangents_and_are_found():
    V = np.array([[0.0, 0, 0], [1, 1, 1], [3, 3, 3], [0, 0, 0], [0, 1, 0]])
    F = np.array([[0, 1, 2], [0, 3, 1], [0, 1, 4], [0, 3, 0]])
    assert degenerate_faces(corner_cotangents(V, F)).tolist() == [0, 1, 3]
