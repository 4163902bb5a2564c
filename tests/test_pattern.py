"""Patterns to cut: true to scale, with numbers where edges meet, read again by other readers."""

import json
import re
from collections import Counter
from xml.etree import ElementTree

import ezdxf
import numpy as np
import pytest
import surfaces
from commands import invoke

from cdcp_igl import cut, datasets, disk_map, free_map, surface_map
from cdcp_igl.io import write_map
from cdcp_igl.surface.triangles import face_areas

SVG = "{http://www.w3.org/2000/svg}"


def grid(rows, columns):
    k = np.arange(rows * columns).reshape(rows, columns)
    i, j, far, up = k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]
    return np.concatenate([np.dstack([i, j, far]), np.dstack([i, far, up])]).reshape(-1, 3)


def half_cylinder():
    """Twelve flat strips, 2 high, with two windows, each within a strip."""
    angle, z = np.meshgrid(np.linspace(0, np.pi, 13), np.linspace(0, 2, 9), indexing="ij")
    V = np.dstack([np.cos(angle), np.sin(angle), z]).reshape(-1, 3)
    F = grid(13, 9)
    place = V[F].mean(axis=1)
    strip = np.arctan2(place[:, 1], place[:, 0]) // (np.pi / 12)
    window = np.isin(strip, [3, 8]) & (abs(place[:, 2] - 1) < 0.5)
    return V, F[~window], 24 * np.sin(np.pi / 24) * 2 - window.sum() * np.sin(np.pi / 24) / 4


def cone():
    """Twelve flat faces around the tip, cut open along an edge."""
    angle = np.arange(12) * np.pi / 6
    V = np.vstack([[0, 0, 2], np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])])
    F = np.column_stack([np.zeros(12, int), np.arange(12) + 1, np.roll(np.arange(12) + 1, -1)])
    return V, F, face_areas(V, F).sum()


def outlines_of(path):
    """Closed polygons, and the numbers at the notches, by other readers."""
    if path.suffix == ".dxf":
        model = ezdxf.readfile(path).modelspace()
        polygons = [np.array(line.get_points("xy")) for line in model.query("LWPOLYLINE")]
        return polygons, [text.dxf.text for text in model.query("TEXT")]
    root = ElementTree.parse(path).getroot()
    polygons = []
    for step in root.find(f"{SVG}g[@id='outlines']"):
        assert step.get("d").endswith(" Z")
        numbers = np.array(re.findall(r"[-+.\de]+", step.get("d").replace("Z", "")), float)
        polygons.append(numbers.reshape(-1, 2) * [1, -1])
    return polygons, [text.text for text in root.iter(f"{SVG}text")]


def length(polygon):
    return np.linalg.norm(np.roll(polygon, -1, axis=0) - polygon, axis=1).sum()


def area(polygons):
    return sum(np.linalg.det(np.stack([p, np.roll(p, -1, axis=0)], 1)).sum() / 2 for p in polygons)


@pytest.mark.parametrize("suffix", ["svg", "dxf"])
@pytest.mark.parametrize(("shape", "outlines", "seams"), [(half_cylinder, 3, 0), (cone, 1, 1)])
def test_what_can_be_unrolled_is_true_to_scale(tmp_path, suffix, shape, outlines, seams):
    V, F, expected = shape()
    if shape is cone:
        result = free_map(*cut(V, F, path=[0, 1])[:2])
    else:
        result = surface_map(V, F, outline="free")
        assert abs(area(result.uv) - expected) < 1e-9  # in the unit of V
    path = tmp_path / f"a.{suffix}"
    pattern = result.pattern(path, unit="m")
    polygons, numbers = outlines_of(path)
    assert len(polygons) == outlines
    assert numbers == ["1", "1"] * seams
    assert (pattern.seams, pattern.report()["outlines"]) == (seams, outlines)
    assert pattern.largest_length_error < 1e-9
    assert abs(sum(map(length, polygons)) - pattern.length_on_surface) < 1e-9
    assert abs(area(polygons) - pattern.area) < 1e-9
    assert abs(area(polygons) - expected) < 1e-9
    if shape is cone:
        assert abs(pattern.area - result.area_ratio * expected) < 1e-9
    if suffix == "dxf":
        assert ezdxf.readfile(path).units == ezdxf.units.M
    else:
        root = ElementTree.parse(path).getroot()
        box = np.array(root.get("viewBox").split(), float)
        np.testing.assert_allclose(float(root.get("width")[:-2]), 1000 * box[2])
        points = np.concatenate(polygons) * [1, -1]
        assert (points >= box[:2]).all()
        assert (points <= box[:2] + box[2:]).all()


@pytest.mark.parametrize("suffix", ["svg", "dxf"])
def test_a_hull_is_drawn_as_it_is_mapped(tmp_path, suffix):
    """One side of a boat, which no plate covers without stretching."""
    x, z = np.meshgrid(np.linspace(-1, 1, 17), np.linspace(0, 1, 7), indexing="ij")
    beam = 0.6 * (1 - x**2) * np.sqrt(z + 0.05)
    V, F = np.dstack([3 * x, beam, z + 0.2 * x**2]).reshape(-1, 3), grid(17, 7)
    result, path = free_map(V, F), tmp_path / f"hull.{suffix}"
    pattern = result.pattern(path, unit="m")
    ((polygon,), _) = outlines_of(path)
    assert 1e-9 < pattern.largest_length_error < 0.1
    assert abs(length(polygon) - pattern.length) < 1e-9
    assert abs(abs(area([polygon])) - result.area_ratio * face_areas(V, F).sum()) < 1e-9
    assert abs(abs(area([polygon])) - pattern.area) < 1e-9


def test_edges_that_meet_have_the_same_number():
    """Of a torus in one chart or more, whatever is an edge of an outline has its other side."""
    V, F = surfaces.torus()
    result = surface_map(V, F, outline="free")
    pattern = result.pattern(folds=True)
    numbers = Counter(pattern.lines.numbers.tolist())
    assert set(numbers.values()) == {2}
    assert pattern.seams == len(numbers) > 1
    assert abs(pattern.length_on_surface - 2 * result.cut.length) < 1e-9
    # Notches of a seam are where the same edge of the surface was: in equal lengths on it.
    cut_open, uv = result.cut, result._unfolded()[2]
    middles = pattern.lines.notches[:, 0].reshape(-1, 2, 2)
    edges = np.concatenate([cut_open.F[:, [k, (k + 1) % 3]] for k in range(3)])
    places = uv[edges].mean(axis=1)
    for pair in middles:
        found = [edges[np.linalg.norm(places - place, axis=1).argmin()] for place in pair]
        given = [sorted(cut_open.vertex_index[edge].tolist()) for edge in found]
        assert given[0] == given[1]
    assert len(pattern.lines.folds) == len(F) * 3 // 2 - len(result.cut.edges)


def test_a_pattern_from_the_shell(tmp_path):
    write_map(tmp_path / "cap.obj", *datasets.spherical_cap(6))
    files = [tmp_path / name for name in ("cap.obj", "out.obj", "cap.dxf", "r.json")]
    given, out, drawn, report = files
    more = "--pattern", drawn, "--unit", "in", "--report", report
    done = invoke("map", given, out, "--free", *more)
    assert done.exit_code == 0
    assert "1 outlines" in done.output
    said = json.loads(report.read_text())["pattern"]
    (polygon,), _ = outlines_of(drawn)
    assert abs(length(polygon) - said["length"]) < 1e-9
    for refused in ([], ["--cut", "--disk"], ["--cut", "--outline", "disk"]):
        assert invoke("map", given, out, *more, "--force", *refused).exit_code == 2
    assert invoke("map", given, out, *more, "--force", "--cut").exit_code == 0
    assert invoke("map", given, out, "--free", "--pattern", drawn, "--unit", "ell").exit_code == 2


def test_what_is_no_pattern():
    V, F, _ = datasets.spherical_cap(4)
    for result in (disk_map(V, F), surface_map(V, F, outline="disk")):
        with pytest.raises(ValueError, match="free outline"):
            result.pattern()
    result = free_map(V, F)
    with pytest.raises(ValueError, match=r"\.dxf or \.svg"):
        result.pattern("a.pdf")
    with pytest.raises(ValueError, match="unit must be"):
        result.pattern(unit="ell")
