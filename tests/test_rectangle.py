"""Maps onto rectangles: moduli that are known, what moduli obey, and what is refused."""

import numpy as np
import pytest
from commands import invoke
from hypothesis import given, settings
from hypothesis import strategies as st
from meshes import TWO_TRIANGLES, corridor, fan, grid, strip
from scipy.integrate import quad
from scipy.spatial import Delaunay
from surfaces import capped_tube

import cdcp_igl
from cdcp_igl.maps.rectangle import along_side
from cdcp_igl.surface.mesh import DiskMesh
from cdcp_igl.surface.triangles import face_areas
from cdcp_igl.verdict.certificate import certify_rectangle

REAL = ["camelhead_11381", "femur_2411", "human_face_17157", "nefertiti_299"]


def unit_square(n, seed=None):
    """A grid of 2 n^2 triangles, vertices inside moved by a quarter of the spacing at most."""
    V, F = corridor(1, n)
    if seed is not None:
        inside = abs(V - n / 2).max(axis=1) < n / 2
        shift = np.random.default_rng(seed).uniform(-0.25, 0.25, V.shape)
        V = V + shift * inside[:, None]
    return *(V / n).T, F, [0, n, (n + 1) ** 2 - 1, (n + 1) * n]


def quarters(V, F):
    """Four corners that part the boundary into sides of equally many edges."""
    loop = DiskMesh(V, F).loop
    return loop[np.arange(4) * len(loop) // 4]


def assert_on_sides(result):
    """The map is valid; the boundary lies on the rectangle, to the last bit, around it once."""
    assert result.valid
    u, v = result.uv[result.mesh.loop].T
    assert ((u == 0) | (u == result.width) | (v == 0) | (v == 1)).all()
    corners = [[0, 0], [result.width, 0], [result.width, 1], [0, 1]]
    np.testing.assert_array_equal(result.uv[list(result.corners)], corners)
    area = 0.5 * np.sum(u * np.roll(v, -1) - v * np.roll(u, -1))
    assert area == pytest.approx(result.width, rel=1e-12)


@pytest.mark.parametrize("width", [0.01, 3.7])
def test_a_rectangle_is_mapped_to_itself(width):
    x, y, F, corners = unit_square(12, seed=0)
    result = cdcp_igl.rectangle_map(np.column_stack([5 * width * x, 5 * y]), F, corners)
    assert result.modulus == pytest.approx(width, rel=1e-12)
    assert result.modulus_bounds == pytest.approx((width, width), rel=1e-11)
    assert abs(result.uv - np.column_stack([width * x, y])).max() < 1e-12 * max(1, width)
    assert result.distortion.max < 1e-6


def test_an_annulus_sector_converges_at_second_order():
    """log maps the sector of angle a with radii 1 and R to a rectangle, a by log R."""
    R, a, errors, away = 2.0, 1.2, [], []
    for n in (8, 16, 32):
        x, y, F, corners = unit_square(n)
        r, t = R**y, a * (1 - x)  # t decreases, so that faces stay counterclockwise
        V = np.column_stack([r * np.cos(t), r * np.sin(t)])
        result = cdcp_igl.rectangle_map(V, F, corners)
        low, high = result.modulus_bounds
        assert low < result.modulus < high
        errors.append(abs(result.modulus - a / np.log(R)))
        exact = np.column_stack([x * a / np.log(R), y])
        away.append(abs(result.uv - exact).max())
    for sequence in (errors, away):
        assert 3.7 < sequence[0] / sequence[1] < 4.3
        assert 3.7 < sequence[1] / sequence[2] < 4.3
    assert errors[-1] < 2e-4


@settings(max_examples=30)
@given(st.integers(0, 20), st.sampled_from([0, 1, 2, 3]))
def test_turning_the_corners_inverts_the_modulus(seed, turn):
    """And moves nothing else; the bounds change places. Scale and rotation do not matter."""
    V, F = grid(6, 8, seed=seed)
    loop = DiskMesh(V, F).loop
    corners = [0, 7, 47, 40]
    one = cdcp_igl.rectangle_map(V, F, corners)
    Q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    Q *= np.linalg.det(Q)
    other = cdcp_igl.rectangle_map(1e6 * V @ Q.T, F, np.roll(corners, -turn))
    if turn % 2:
        assert other.modulus == pytest.approx(1 / one.modulus, rel=1e-10)
        assert other.modulus_bounds[0] == pytest.approx(1 / one.modulus_bounds[1], rel=1e-10)
    else:
        assert other.modulus == pytest.approx(one.modulus, rel=1e-10)
    assert set(loop[np.isin(loop, corners)]) == set(other.corners)


@pytest.mark.parametrize("name", REAL)
def test_refinement_slides_along_the_sides_and_moves_the_width(real_mesh, name):
    V, F = real_mesh(name)
    plain, better = (cdcp_igl.rectangle_map(V, F, quarters(V, F), refine=k) for k in (0, 3))
    assert plain.width == pytest.approx(plain.modulus, rel=1e-15)
    assert_on_sides(better)
    assert better.refinement.steps == 3
    assert better.distortion.mean < 0.95 * plain.distortion.mean
    assert better.conformal
    assert (better.modulus, better.modulus_bounds) == (plain.modulus, plain.modulus_bounds)
    assert 0 < abs(better.width / plain.width - 1) < 0.03


@pytest.mark.parametrize("name", REAL)
def test_scans_with_corners_at_the_quarters_of_the_boundary(real_mesh, name):
    V, F = real_mesh(name)
    result = cdcp_igl.rectangle_map(V, F, quarters(V, F))
    assert_on_sides(result)
    # As good as the map onto the disk, but for the faces around the corners.
    disk = cdcp_igl.disk_map(V, F)
    assert result.distortion.mean < disk.distortion.mean + 1 + 300 / len(V)
    low, high = result.modulus_bounds
    assert 1 <= high / low < 1.2
    assert result.modulus**2 == pytest.approx(low * high)


def test_small_disks():
    V, F = TWO_TRIANGLES
    assert_on_sides(cdcp_igl.rectangle_map(V, F, [0, 1, 2, 3]))
    V, F = fan(9)
    for corners in ([0, 1, 2, 4], [1, 2, 3, 4], [1, 3, 6, 8]):  # in any place of the loop
        result = cdcp_igl.rectangle_map(V, F, corners)
        assert result.corners == tuple(corners)
        assert_on_sides(result)


def test_what_a_chord_cuts_off_is_named():
    V, F = strip(8)  # every edge inside is a chord
    loop = DiskMesh(V, F).loop
    with pytest.raises(ValueError, match=r"edges inside join two vertices of side \d.*\d+-\d+"):
        cdcp_igl.rectangle_map(V, F, loop[[0, 1, 2, 3]])


@pytest.mark.parametrize("corners", [[0, 1, 2, 3], [0, 6, 12, 18]])
def test_a_long_tube_with_one_end(corners):
    """No Möbius transformation may take the spot elsewhere; an embedding has no flipped face."""
    V, F = capped_tube(24, 100)
    result = cdcp_igl.rectangle_map(V, F, DiskMesh(V, F).loop[corners])
    assert_on_sides(result)
    assert (result.laplacian, result.repair.n_moved) == ("mean value", 0)
    assert result.conformal
    again = cdcp_igl.rectangle_map(V, F, DiskMesh(V, F).loop[corners])
    np.testing.assert_array_equal(again.uv, result.uv)


def test_what_is_no_bijection_is_not_returned():
    """The spot is smaller than the distance of two doubles."""
    V, F = capped_tube(5, 500)
    with pytest.raises(cdcp_igl.MapError, match=r"rectangle: [\d,]+ flipped") as caught:
        cdcp_igl.rectangle_map(V, F, quarters(V, F))
    result = caught.value.result
    assert not result.valid
    assert not result.conformal
    assert result.report()["certificate"]["flipped_faces"] == list(result.certificate.flipped)


def test_the_certificate_is_of_the_coordinates():
    V, F = grid()
    result = cdcp_igl.rectangle_map(V, F, [0, 7, 47, 40])
    mesh, f = result.mesh, result.uv @ [1, 1j]
    row, column = np.arange(8), 8 * np.arange(6)
    sides = [row, 7 + column, 47 - row, 40 - column]

    def certificate(f):
        return certify_rectangle(mesh, sides, f)

    assert certificate(f).valid
    assert certificate(f).winding_number == 1
    assert certificate(f.conj() + 1j).winding_number == -1
    assert len(certificate(f.conj()).flipped) == len(F)
    assert certificate(f + 0.25).boundary_error == 0.25
    assert not certificate(f + 0.25).valid
    swapped = f.copy()
    swapped[[1, 2]] = f[[2, 1]]
    assert not certificate(swapped).boundary_monotone
    assert not certificate(np.where(f == 0, np.nan, f)).finite
    inside = np.where(mesh.on_boundary, f, f.mean())
    assert len(certificate(inside).flipped) > 0
    assert certificate(inside).winding_number == 1


# -- where the sides cannot slide ------------------------------------------------------


def scattered(seed, n=200):
    """Points at random in a square, with obtuse faces along its sides."""
    points = np.random.default_rng(seed).random((n, 2))
    F = Delaunay(points).simplices
    a, b, c = points[F].transpose(1, 0, 2)
    clockwise = (b - a)[:, 0] * (c - a)[:, 1] < (b - a)[:, 1] * (c - a)[:, 0]
    F[clockwise] = F[clockwise, ::-1]
    return points, F


@pytest.mark.parametrize("seed", [1, 4, 6])
def test_a_side_that_turns_back_is_placed_by_the_map_onto_the_disk(seed, caplog):
    V, F = scattered(seed)
    result = cdcp_igl.rectangle_map(V, F, quarters(V, F))
    assert result.boundary == "disk map"
    assert_on_sides(result)
    low, high = result.modulus_bounds
    assert low < result.modulus < high
    assert result.distortion.mean < 12
    assert ("not conformal" in caplog.text) == (not result.conformal)
    assert result.report()["conformal"] == result.conformal


@pytest.mark.parametrize("angles", [[-2.5, -0.5, 0.7, 2.2], [0.1, 0.2, 3, 3.3]])
def test_arcs_come_to_lie_along_sides_as_schwarz_and_christoffel_say(angles):
    """The speed along the circle is the product of the corners' distances^(-1/2)."""
    corners = np.exp(1j * np.array(angles))

    def length(start, end):
        def speed(t):
            return np.prod(abs(np.exp(1j * t) - corners) ** -0.5)

        return quad(speed, start, end, limit=200)[0]

    for side in range(4):
        start, end = angles[side], [*angles, angles[0] + 2 * np.pi][side + 1]
        for t in np.linspace(start, end, 5)[1:-1]:
            [along] = along_side(np.exp([1j * t]), np.roll(corners, -side))
            assert along == pytest.approx(length(start, t) / length(start, end), abs=1e-8)
        ends = along_side(corners[[side, (side + 1) % 4]], np.roll(corners, -side))
        np.testing.assert_allclose(ends, [0, 1], atol=1e-15)


def test_edges_between_vertices_of_a_side_are_split_if_that_is_asked_for(tmp_path):
    """Rows stay; halves come last, and the map is that of the surface with them."""
    V, F = strip(8)
    corners = DiskMesh(V, F).loop[[0, 1, 2, 3]].tolist()
    result = cdcp_igl.rectangle_map(V, F, corners, split=True)
    assert_on_sides(result)
    (n, k), mesh = (len(V), len(result.split)), result.mesh
    np.testing.assert_array_equal(mesh.V[:n], V)
    np.testing.assert_allclose(mesh.V[n:], V[result.split].mean(axis=1))
    assert (mesh.F.shape, k > 3) == ((len(F) + 2 * k, 3), True)
    assert face_areas(mesh.V, mesh.F).sum() == pytest.approx(face_areas(V, F).sum())
    np.testing.assert_array_equal(result.to_given(result.uv), result.uv[:n])
    part = cdcp_igl.submesh(np.vstack([V, V]), F + n, vertices=np.arange(n, 2 * n))
    of_part = cdcp_igl.rectangle_map(part, corners, split=True)
    np.testing.assert_array_equal(of_part.to_given(of_part.uv)[n:], result.uv[:n])

    np.savez(tmp_path / "strip.npz", V=V, F=F)
    text = ",".join(map(str, corners))
    done = invoke("map", tmp_path / "strip.npz", tmp_path / "o.npz", "--rectangle", text, "--split")
    assert (done.exit_code, f"split {k} edges" in done.output) == (0, True)
    with np.load(tmp_path / "o.npz") as arrays:
        written = dict(arrays)
    np.testing.assert_array_equal(written["uv"], result.uv)
    np.testing.assert_array_equal(written["F"], mesh.F)
