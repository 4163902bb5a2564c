"""The certificate of anybody's map, on layouts whose overlaps are known exactly."""

import json
from itertools import combinations

import numpy as np
import pytest
from commands import invoke
from scipy.io import savemat
from surfaces import torus

import cdcp_igl
from cdcp_igl import certify
from cdcp_igl.io import read_texture, write_map
from cdcp_igl.libigl import grid_faces
from cdcp_igl.verdict import any_map, outline

SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
TWO = np.array([[0, 1, 2], [0, 2, 3]])


def square(x=0, y=0):
    return SQUARE + np.array([x, y]), TWO


def side_by_side(*charts):
    """One surface in space, and its images, of layouts ``(uv, F)`` each."""
    n = np.cumsum([0, *(len(uv) for uv, _ in charts)])
    uv = np.concatenate([uv for uv, _ in charts])
    F = np.concatenate([F + k for k, (_, F) in zip(n, charts, strict=False)])
    return np.column_stack([uv, np.repeat(np.arange(len(charts)), np.diff(n))]), F, uv


def strip(left, right):
    """A strip of quads between two rows of points."""
    k, n = np.arange(len(left) - 1), len(left)
    F = np.concatenate(
        [np.column_stack([k, k + n, k + 1]), np.column_stack([k + 1, k + n, k + n + 1])]
    )
    return np.concatenate([left, right]).astype(float), F


def ring(inner, outer, turns=1, n=8):
    """An annulus that is cut open, or, of two turns, lies on itself without crossing itself."""
    angle = np.linspace(0, 2 * np.pi * turns, n * turns + 1)
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    return strip(outer * circle, inner * circle)


RING, POINTED = ring(3, 4), np.array([[2, 0.5], [1, 0.5], [2, 0.2]])
CASES = {  # layouts side by side: flipped faces, overlaps, charts on one another
    "a square": ([square()], 0, False, []),
    "touching along an edge": ([square(), square(1, 0)], 0, False, []),
    "touching along half an edge": ([square(), square(1, 0.5)], 0, False, []),
    "touching at a corner": ([square(), square(1, 1)], 0, False, []),
    "a corner on an edge": ([square(), (POINTED, TWO[:1])], 0, False, []),
    "a mirrored one beside": ([square(), (SQUARE * [-1, 1], TWO)], 0, False, []),
    "shifted": ([square(), square(0.5, 0.5)], 0, True, None),
    "shifted along an edge": ([square(), square(0.5, 0)], 0, True, None),
    "stacked": ([square(), square()], 0, True, None),
    "stacked, one of them mirrored": ([square(), (SQUARE[::-1], TWO)], 0, True, None),
    "one inside another": ([(4 * SQUARE - 1, TWO), (SQUARE + 0.25, TWO)], 0, False, [[1, 0]]),
    "a corner at an edge from inside": ([(4 * SQUARE, TWO), square()], 0, True, None),
    "in a hole": ([RING, square()], 0, False, []),
    "a ring that is cut": ([RING], 0, False, []),
    "around a hole": ([RING, (9 * SQUARE - 4.5, TWO)], 0, False, [[0, 1]]),
    "two turns": ([ring(3, 4, 2)], 0, True, None),
    "a folded face": ([([*SQUARE[:3], [0.9, 0.2]], TWO)], 1, None, None),
    "a collapsed face": ([([*SQUARE[:3], [0.5, 0.5]], TWO)], 1, None, None),
}  # fmt: skip


@pytest.mark.parametrize("turned", [False, True], ids=["", "turned"])
@pytest.mark.parametrize("name", CASES)
def test_layouts(name, turned):
    layouts, flipped, overlap, stacked = CASES[name]
    V, F, uv = side_by_side(*((np.array(uv, float), np.array(F)) for uv, F in layouts))
    if turned:  # by a quarter, which is exact
        uv = np.column_stack([-uv[:, 1], uv[:, 0]])
    found = certify(V, F, uv)
    assert len(found.flipped) == flipped
    assert found.charts == len(layouts)
    assert found.valid == (not flipped and not overlap and not stacked)
    assert overlap is None or bool(len(found.overlapping)) == overlap
    assert stacked is None or found.stacked.tolist() == stacked
    # However the images are given, corner by corner and at any scale.
    again = certify(V, F, 2.0**-20 * uv[F])
    assert again.report() == found.report() | {"least_density": again.least_density}
    assert again.least_density == 2.0**-20 * found.least_density


def twice_areas(corners):
    """Of faces with whole corners (m, 3, 2)."""
    i, j, k = corners.transpose(1, 2, 0)
    return (j - i)[0] * (k - i)[1] - (j - i)[1] * (k - i)[0]


def apart(one, other):
    """Whether an edge of one face, or of the other, has all of the other at its side or on it."""
    return any(
        (twice_areas(np.array([[p[k - 1], p[k], r] for r in q])) <= 0).all()
        for p, q in ((one, other), (other, one))
        for k in range(3)
    )


def test_random_layouts_overlap_where_two_faces_do():
    rng, seen = np.random.default_rng(1), []
    shapes = TWO[:1], TWO, np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1]])
    while len(seen) < 150:
        charts = []
        while len(charts) < 2 + len(seen) % 2:
            F = shapes[rng.integers(3)]
            uv = rng.integers(0, 6, (F.max() + 1, 2))
            if (twice_areas(uv[F]) > 0).all():
                charts.append((uv, F))
        V, F, uv = side_by_side(*charts)
        overlap = not all(apart(*pair) for pair in combinations(uv[F], 2))
        if overlap and sum(seen) > 80:
            continue
        seen.append(overlap)
        assert certify(V, F, uv).valid == (not overlap), (uv.tolist(), F.tolist())
    assert 0 < sum(seen) < len(seen) - 20


def test_an_outline_that_goes_around_twice():
    angle = np.linspace(0, 4 * np.pi, 17)[:-1]
    rim = np.column_stack([np.cos(angle), np.sin(angle)]) * (1 + angle / 40)[:, None]
    k = np.arange(16)
    F = np.column_stack([np.full(16, 16), k, (k + 1) % 16])
    V = np.column_stack([np.cos(angle / 2), np.sin(angle / 2)])
    found = certify(np.vstack([V, [0, 0]]), F, np.vstack([rim, [0, 0]]))
    assert (len(found.flipped), found.winding.tolist(), found.valid) == (0, [2], False)


def test_a_slit_that_touches_itself():
    uv = np.array([[x, y] for y in range(5) for x in range(5)], float)
    V, F, middle = uv, grid_faces(5, 5), 12
    # Open from the middle to the left: the vertices there are twice on the surface.
    cut = np.flatnonzero((uv[:, 1] == uv[middle, 1]) & (uv[:, 0] < uv[middle, 0]))
    above = uv[F].mean(axis=1)[:, 1] > uv[middle, 1]
    copies = np.arange(len(V))
    copies[cut] = len(V) + np.arange(len(cut))
    slit = np.where(above[:, None], copies[F], F)
    found = certify(np.vstack([V, V[cut]]), slit, np.vstack([uv, uv[cut]]))
    assert (found.valid, found.charts, found.winding.tolist()) == (True, 1, [1])
    # A hole of a surface turns backwards.
    hole = certify(V, F[~(middle == F).any(axis=1)], uv)
    assert (hole.valid, sorted(hole.winding.tolist())) == (True, [-1, 1])


def test_bow_tie():
    uv = np.array([[0, 0], [1, 1], [1, 0], [0, 1.0]])
    found = certify(SQUARE, TWO, uv)
    assert (found.valid, found.winding.tolist(), len(found.flipped)) == (False, [0], 1)
    assert found.overlapping.tolist() == [[0, 1]]


@pytest.mark.parametrize("corner_by_corner", [False, True])
def test_what_the_library_says_of_its_maps(corner_by_corner):
    V, F, _ = cdcp_igl.datasets.spherical_cap(8)
    result = cdcp_igl.free_map(V, F)
    found = certify(V, F, result.uv[F] if corner_by_corner else result.uv)
    assert found.valid
    assert vars(found.angles) == pytest.approx(vars(result.distortion))
    area = result.area_distortion()
    assert found.areas.sd == pytest.approx(area.std())
    assert found.lost == result.lost_in_single_precision()[0]
    assert json.loads(json.dumps(found.report()))["charts"] == 1
    for text in (f"{found}", repr(found), found._repr_html_()):
        assert "valid" in text
    lost = certify(V, F, 1e9 + 1e-3 * result.uv)
    assert lost.lost == len(F)
    assert lost.lost_share == pytest.approx(1)


def test_charts_of_any_surface_and_faces_in_none():
    V, F = torus()
    made = cdcp_igl.surface_map(V, F, outline="free")
    found = certify(V, F, made.packed())
    assert (found.valid, found.charts) == (True, len(made.charts))
    uv = made.packed()
    uv[3] = np.nan
    assert certify(V, F, uv).report()["unmapped_faces"] == 1
    uv[4, 0, 0] = np.inf
    found = certify(V, F, uv)
    assert (found.valid, found.not_finite.tolist(), found.face_chart[3:5].tolist()) == (
        False,
        [4],
        [-1, -1],
    )


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".glb", ".npz"])
def test_a_face_without_area_covers_nothing(tmp_path, suffix):
    """An edge is split on one side only: the map of such a file is what `certify` calls valid."""
    V, F, _ = cdcp_igl.datasets.spheroid(1)
    (a, b, c), new = F[0], len(V)
    V = np.vstack([V, (V[a] + V[b]) / 2])
    F = np.vstack([F[1:], [[a, new, c], [new, b, c], [a, b, new]]])
    source, out = tmp_path / "solid.obj", tmp_path / f"map{suffix}"
    cdcp_igl.io.write_map(source, V, F, V[:, :2])
    assert invoke("map", "--cut", source, out).exit_code == 0
    done = invoke("certify", out)
    assert done.exit_code == 0, done.output


def test_only_a_face_without_area_may_be_at_one_place():
    V = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0, 0]])
    F = np.array([[0, 4, 3], [4, 1, 2], [4, 2, 3], [0, 1, 4]])
    uv = V[F, :2]
    assert certify(V, F, uv).flipped.tolist() == [3]
    uv[3] = 7
    found = certify(V, F, uv)
    assert (found.valid, found.report()["unmapped_faces"]) == (True, 1)
    uv[2] = 7
    assert certify(V, F, uv).flipped.tolist() == [2]


def test_many_charts_on_one_another(monkeypatch):
    """As the leaves of a tree share a texture: of 10,000, all pairs took more than the memory."""
    inside = [(size * (SQUARE - 0.5), TWO) for size in 1.5 ** -np.arange(30.0)]
    layout = side_by_side(*inside, *[square(3, 3)] * 20, *(square(0, k) for k in range(9, 20)))
    found = certify(*layout).stacked
    expected = {*combinations(range(30, 50), 2)} | {(j, i) for i, j in combinations(range(30), 2)}
    assert {*map(tuple, found.tolist())} >= expected
    assert found.max() < 50
    monkeypatch.setattr(outline, "MOST_NEAR", 7)
    np.testing.assert_array_equal(certify(*layout).stacked, found)
    monkeypatch.setattr(any_map, "MANY", 20)
    some = certify(*layout)
    assert 20 < len(some.stacked) < len(found) / 2
    assert not some.valid
    assert {*map(tuple, some.stacked.tolist())} < {*map(tuple, found.tolist())}


def test_spheres():
    V, F, _ = cdcp_igl.datasets.spheroid(2)
    points = cdcp_igl.sphere_map(V, F).points
    found = certify(V, F, points)
    assert (found.valid, found.winding.tolist(), found.mirrored.tolist()) == (True, [1], [])
    assert certify(V, F, -points).mirrored.tolist() == [0]
    twice = np.vstack([V, V]), np.vstack([F, F + len(V)]), np.vstack([points, points])
    assert certify(*twice).stacked.tolist() == [[0, 1]]
    points[[0, 5]] = points[[5, 0]]
    assert len(certify(V, F, points).flipped)
    for uv, why in (
        (2 * points, "unit sphere"),
        (points[:5], "shape"),
        (points[:, :2] * np.nan, "no face"),
    ):
        with pytest.raises(ValueError, match=why):
            certify(V, F, uv)
    with pytest.raises(ValueError, match="boundary"):
        certify(V, F[1:], points)


def test_order_and_orientation_of_the_faces_do_not_matter():
    V, F, uv = side_by_side(RING, square())
    assert certify(V, F[::-1], uv).valid
    turned = F.copy()
    turned[2] = turned[2, ::-1]  # it is in a chart of its own
    found = certify(V, turned, uv)
    assert (found.valid, found.charts) == (True, 4)


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".glb", ".npz", ".vtk", ".vtp"])
def test_texture_coordinates_of_files_and_exit_codes(tmp_path, suffix):
    V, F, uv = side_by_side(RING, square())
    good, bad, none = (tmp_path / f"{name}{suffix}" for name in ("good", "bad", "none"))
    write_map(good, V, F, uv[F] / 8, disk=True)
    V_read, F_read, texture = read_texture(good)
    np.testing.assert_allclose(texture, uv[F] / 8, atol=1e-7)
    np.testing.assert_allclose(V_read[F_read], V[F], atol=1e-7)
    done = invoke("certify", good)
    assert (done.exit_code, done.stderr) == (0, "")
    assert "in 2 charts: valid" in done.stdout
    write_map(bad, V, F, np.vstack([uv[:-4], 9 * uv[-4:] - 4.5]), disk=True)
    done = invoke("certify", good, bad, "--json")
    assert done.exit_code == 3
    assert [row["valid"] for row in json.loads(done.stdout)] == [True, False]
    none.write_bytes(b"nothing")
    assert invoke("certify", bad, none).exit_code == 2


@pytest.mark.parametrize("at_corners", [False, True])
@pytest.mark.parametrize("suffix", [".npz", ".mat"])
def test_maps_among_other_arrays(tmp_path, suffix, at_corners):
    """As NumPy and MATLAB keep them; faces that count from 1 name the same rows."""
    V, F, uv = cdcp_igl.datasets.spherical_cap(4)
    path = tmp_path / f"a{suffix}"
    given = {"V": V, "F": F + 1, "uv": uv[F] if at_corners else uv, "more": np.eye(3)}
    np.savez(path, **given) if suffix == ".npz" else savemat(path, given)
    for array, other in zip(read_texture(path), (V, F, uv[F]), strict=True):
        np.testing.assert_array_equal(array, other)
    assert invoke("certify", path).exit_code == 0
    for wrong, why in (
        (uv[:-1], "not those of its faces"),
        (uv + 1j, "uv must be"),
        (V, "uv must"),
    ):
        np.savez(tmp_path / "b.npz", V=V, F=F, uv=wrong)
        with pytest.raises(cdcp_igl.MeshError, match=why):
            read_texture(tmp_path / "b.npz")
    np.savez(tmp_path / "b.npz", V=V, F=F)
    with pytest.raises(cdcp_igl.MeshError, match="no texture"):
        read_texture(tmp_path / "b.npz")


@pytest.mark.parametrize("outline", ["free", "disk"])
def test_charts_that_a_file_has_around_0(tmp_path, outline):
    V, F = torus(12, 8)
    F = np.vstack([F, F + len(V), F + 2 * len(V)])
    V = np.vstack([V, 2 * V, V * [1, 1, 2]])
    np.savez(tmp_path / "a.npz", V=V, F=F)
    invoke("map", "--cut", "--outline", outline, tmp_path / "a.npz", tmp_path / "b.npz")
    with np.load(tmp_path / "b.npz") as saved:
        charts = int(saved["face_chart"].max()) + 1
        assert not cdcp_igl.certify(V, F, saved["uv"]).valid
    done = invoke("certify", tmp_path / "b.npz")
    assert charts > 2
    assert f"in {charts} charts: valid" in done.stdout


def test_files_without_texture_coordinates(tmp_path):
    for text, why in (("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "no texture"),
                      ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/1 2/1 3/1\n", "not there")):  # fmt: skip
        (tmp_path / "a.obj").write_text(text)
        with pytest.raises(cdcp_igl.MeshError, match=why):
            read_texture(tmp_path / "a.obj")
    (tmp_path / "a.off").write_text("OFF 3 1 0 0 0 0 1 0 0 0 1 0 3 0 1 2")
    with pytest.raises(cdcp_igl.MeshError, match="of no type"):
        read_texture(tmp_path / "a.off")
