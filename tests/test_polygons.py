"""Polygons of any shape become triangles that cover them once, whichever corner comes first."""

import re

import meshes
import numpy as np
import pytest

import cdcp_igl
from cdcp_igl.io import read_polygons
from cdcp_igl.surface.filling import MOST_CORNERS

SQUARE = [[0.25 * i, 0, 0] for i in range(5)] + [[1, 0.5, 0], [1, 1, 0], [0, 1, 0], [0, 0.3, 0]]
DART = [[0, 0, 0], [4, 4, 0], [0, 1, 0], [-4, 4, 0]]
L = [[2, 0, 0], [2, 1, 0], [1, 1, 0], [1, 2, 0], [0, 2, 0], [0, 0, 0]]


def simple_polygon(seed):
    """5 to 60 corners, with collinear runs, in a tilted plane: its corners, normal and area."""
    rng = np.random.default_rng(seed)
    order, P = list(range(k := rng.integers(5, 30))), rng.normal(size=(k, 2))

    def turns(a, b, c):
        (ux, uy), (vx, vy) = P[order[b]] - P[order[a]], P[order[c]] - P[order[a]]
        return ux * vy - uy * vx

    crossing = True
    while crossing:  # taken out by reversal, which makes it shorter
        crossing = False
        for i in range(k - 1):
            for j in range(i + 2, k - (i == 0)):
                a, b, c, d = i, i + 1, j, (j + 1) % k
                if turns(a, b, c) * turns(a, b, d) < 0 and turns(c, d, a) * turns(c, d, b) < 0:
                    order[b : j + 1] = order[b : j + 1][::-1]
                    crossing = True
    P = P[order]
    for at in rng.integers(0, len(P), rng.integers(0, 5)):
        share = np.sort(rng.uniform(size=(rng.integers(1, 6), 1)), axis=0)
        P = np.insert(P, at + 1, P[at] + share * (P[(at + 1) % len(P)] - P[at]), axis=0)
    x, y = P.T
    area = (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    axes[:, 2] *= np.sign(np.linalg.det(axes)) * np.sign(area)
    axes[:, 1] *= np.sign(area)
    return np.column_stack([x, y * np.sign(area), 0 * x])[:: int(np.sign(area))] @ axes.T


def frame(holes=3):
    """A tilted square with square holes, each with a bridge to it: V, and the one polygon."""
    V, outer, ring = [[0, 0], [8, 0], [8, 4], [0, 4]], [0], []
    for k in range(holes):
        low, n = 1 + 2 * k, len(V)
        V += [[low, 1], [low, 3], [low + 1, 3], [low + 1, 1]]
        ring += [n, n + 1, n + 2, n + 3, n, 0]
    tilt = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0][:, :2]
    return np.array(V, float) @ tilt.T, [*outer, 1, 2, 3, 0, *ring[:-1]], 32.0 - 2 * holes


def written(path, V, polygon):
    """The file of one polygon, of any type that has polygons."""
    rows = "".join(f"{x!r} {y!r} {z!r}\n" for x, y, z in V.tolist())
    corners = " ".join(map(str, polygon))
    if path.suffix == ".obj":
        rows = re.sub("^", "v ", rows.rstrip(), flags=re.MULTILINE)
        path.write_text(f"{rows}\nf {' '.join(str(v + 1) for v in polygon)}\n")
    elif path.suffix == ".off":
        path.write_text(f"OFF {len(V)} 1 0\n{rows}{len(polygon)} {corners}\n")
    else:
        axes = "".join(f"property double {axis}\n" for axis in "xyz")
        path.write_text(
            f"ply\nformat ascii 1.0\nelement vertex {len(V)}\n{axes}element face 1\n"
            f"property list int int vertex_indices\nend_header\n{rows}{len(polygon)} {corners}\n"
        )
    return path


def assert_covers(V, F, polygon):
    """All triangles look as the polygon does, have an area, and together have its area."""
    corners = V[polygon] - V[polygon[0]]
    whole = np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)
    areas = np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]) @ whole
    size = np.linalg.norm(whole)
    assert len(F) == len(polygon) - 2
    assert areas.min() > 1e-10 * size
    np.testing.assert_allclose(areas.sum() / size, size, rtol=1e-12)
    assert cdcp_igl.check(V, F).defects == () or len(set(polygon)) < len(polygon)


def named(F, turn, k):
    """The triangles by the corners of the polygon that began elsewhere."""
    return {frozenset(face) for face in ((F + turn) % k).tolist()}


@pytest.mark.parametrize("seed", range(40))
def test_a_polygon_is_covered_once_and_the_same_for_every_first_corner(tmp_path, seed):
    V = simple_polygon(seed)
    k, suffix = len(V), (".obj", ".off", ".ply")[seed % 3]
    expected = None
    for turn in range(0, k, 1 + k // 7):
        W = np.roll(V, -turn, axis=0)
        first = read_polygons(written(tmp_path / f"a{suffix}", W, range(k)))[1]
        F = cdcp_igl.io.given.surface_of((V, [np.roll(range(k), -turn).tolist()]))[1]
        assert_covers(V, F, np.arange(k))
        expected = expected or named(F, 0, k)
        assert named(first, turn, k) == named(F, 0, k) == expected


@pytest.mark.parametrize("shape", [SQUARE, DART, L], ids=["points on sides", "dart", "L"])
def test_it_stays_whole_in_the_file_that_is_written(tmp_path, shape):
    k = len(shape)
    for turn in range(k):
        V = np.roll(np.array(shape, float), -turn, axis=0)
        path, out = written(tmp_path / "a.obj", V, range(k)), tmp_path / "out.obj"
        result = cdcp_igl.free_map(path)
        assert_covers(V, result.mesh.F, np.arange(k))
        assert result.distortion.max < 1e-9
        result.save(out)
        assert len(re.findall(r"^f( \d+/\d+)+$", out.read_text(), re.MULTILINE)) == 1


@pytest.mark.parametrize("suffix", [".obj", ".off", ".ply"])
def test_bridges_to_holes(tmp_path, suffix):
    V, polygon, area = frame()
    expected = None
    for turn in range(len(polygon)):
        corners = np.roll(polygon, -turn)
        F = read_polygons(written(tmp_path / f"a{suffix}", V, corners))[1]
        assert_covers(V, F, corners)
        expected = expected or named(F, 0, len(V))
        assert named(F, 0, len(V)) == expected
    assert cdcp_igl.check(V, F).kind == "genus 0, 4 boundary loops"
    a, b = V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]
    assert np.linalg.norm(np.cross(a, b), axis=1).sum() / 2 == pytest.approx(area, rel=1e-12)


def test_a_polygon_of_more_corners_than_are_searched(tmp_path):
    k = 2 * MOST_CORNERS
    t = 2 * np.pi * np.arange(k) / k
    radius = 1 + 0.4 * np.sin(9 * t)
    V = np.column_stack([radius * np.cos(t), radius * np.sin(t), 0.5 * radius * np.cos(t)])
    assert_covers(V, read_polygons(written(tmp_path / "a.off", V, range(k)))[1], np.arange(k))


@pytest.mark.parametrize("turn", range(4))
def test_a_quad_is_cut_by_the_diagonal_of_delaunay_whichever_corner_comes_first(turn):
    x, y, F = meshes.cells(4, 5)
    quads = np.roll(np.column_stack([F[: len(F) // 2], F[len(F) // 2 :, 2]]), turn, axis=1)

    def diagonals(V):
        made = cdcp_igl.io.given.surface_of((V, quads))[1].reshape(-1, 2, 3)
        return np.array([np.intersect1d(*pair) for pair in made])

    flat = np.column_stack([x, y, 0 * x]) * [2.0, 1, 1]
    rotated = flat @ np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    for V in (flat, rotated):  # of rectangles, all alike
        assert len(np.unique(np.diff(diagonals(V)))) == 1
    warped = flat + np.random.default_rng(4).normal(size=flat.shape) / 6
    ends = diagonals(warped)
    other = np.array([np.setdiff1d(*pair) for pair in zip(quads, ends, strict=True)])
    lengths = [np.linalg.norm(np.diff(warped[k], axis=1), axis=2).ravel() for k in (ends, other)]
    assert np.mean(lengths[0] < lengths[1]) > 0.9
    np.testing.assert_array_equal(ends, diagonals(warped[:, [1, 0, 2]] * [1, -1, 1]))
