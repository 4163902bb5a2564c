"""Every map by every method of its result: what one of them can, all can, or say why not."""

import json
import pickle
from contextlib import nullcontext

import numpy as np
import pytest
from matplotlib import image
from meshes import grid
from surfaces import pierced_sphere

import cdcp_igl
from cdcp_igl import parts_map
from cdcp_igl.result.base import Result
from cdcp_igl.result.bijection import Bijection

SHEET = grid(12, 15)
DOME = cdcp_igl.datasets.spherical_cap(8)[:2]
BALL = cdcp_igl.datasets.spheroid(2, 2)[:2]


def in_parts(V, F, **options):
    return parts_map(options.pop("folder"), **options)


# What makes each, with what it needs.
MAPS = {
    "DiskMap": (cdcp_igl.disk_map, DOME, {}),
    "FreeMap": (cdcp_igl.free_map, DOME, {}),
    "RectangleMap": (cdcp_igl.rectangle_map, SHEET, {"corners": [0, 14, 179, 165]}),
    "AnnulusMap": (cdcp_igl.annulus_map, pierced_sphere(), {}),
    "SphereMap": (cdcp_igl.sphere_map, BALL, {}),
    "SurfaceMap": (cdcp_igl.surface_map, BALL, {}),
    "PartsMap": (in_parts, SHEET, {}),
}


def kinds(base):
    """All classes of results that are no bases of others."""
    for kind in base.__subclasses__():
        yield from kinds(kind)
        if not kind.__subclasses__():
            yield kind


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Each map by its name, once, with the phases that it has reported."""
    found = {}

    def make(name, **options):
        function, (V, F, *_), needed = MAPS[name]
        if name == "PartsMap":
            needed = {"folder": tmp_path_factory.mktemp("parts") / "sheet"}
            cdcp_igl.partition((V, F), needed["folder"], parts=4)
        if name not in found or options:
            found[name] = function(V, F, **needed, **options)
        return V, F, found[name]

    return make


def test_the_table_has_all_maps():
    assert set(MAPS) == {kind.__name__ for kind in kinds(Result)}
    assert all(issubclass(kind, Bijection) for kind in kinds(Result))


@pytest.mark.parametrize("name", MAPS)
def test_points_go_there_and_back(made, name):
    V, F, result = made(name)
    rng = np.random.default_rng(5)
    face = rng.integers(len(F), size=400)
    barycentric = rng.dirichlet([1, 1, 1], 400)
    barycentric[:100] = np.eye(3)[rng.integers(3, size=100)]  # at vertices, so at the rim, too
    there = result.apply(face, barycentric)
    digits = 10.0 ** (6 - np.ceil(np.log10(abs(there).max())))
    for points in (there, there.astype(np.float32), np.round(there * digits) / digits):
        found, weights = result.invert(points)
        assert found.min() >= 0
        assert weights.min() >= 0
        assert abs(result.apply(found, weights) - points).max() < 2e-6 * abs(there).max()
    found, weights = result.invert(there)
    assert abs(result.apply(found, weights) - there).max() < 1e-15 * abs(there).max() * 4
    assert (found == face)[100:].mean() > 0.99
    # The same place of the surface, unless the point lies on a cut.
    where = np.einsum("kc,kcx->kx", barycentric, V[F[face]])
    assert abs(result.interpolate(V, there)[:, : V.shape[1]] - where)[100:].max() < 1e-9
    if there.shape[1] == 2:
        assert (result.invert(there.max(axis=0) + np.array([0.01, 1]))[0] == -1).all()
        assert np.isnan(result.interpolate(V, [1e300, 0])).all()


@pytest.mark.parametrize("unit", [1, 1e-3, 7e5])
@pytest.mark.parametrize("name", [name for name in MAPS if name != "PartsMap"])
def test_the_surface_is_there_in_its_unit(name, unit):
    function, (V, F, *_), options = MAPS[name]
    result = function(unit * V, F, **options)
    np.testing.assert_array_equal(result.V[:, : V.shape[1]], unit * V)
    np.testing.assert_array_equal(result.F, F)


@pytest.mark.parametrize("name", MAPS)
def test_labels_masks_and_gaps_are_no_smooth_fields(made, name):
    V, F, result = made(name)
    rng = np.random.default_rng(6)
    face, barycentric = rng.integers(len(F), size=900), rng.dirichlet([1, 1, 1], 900)
    points = result.apply(face, barycentric)
    label = np.array([3, 17, 40])[rng.integers(3, size=len(V))]
    for labels in (label, label > 10, np.ma.array(label)):
        for found in (result.interpolate(labels, points), result.bake(labels, 64)):
            assert set(np.unique(found)) <= set(np.unique(labels))
    nearest = label[F[face, barycentric.argmax(axis=1)]]
    assert (result.interpolate(label, points) == nearest).mean() > 0.99
    mean = (barycentric * label[F[face]]).sum(axis=1)
    np.testing.assert_allclose(result.interpolate(label, points, method="linear"), mean, 1e-6)
    masked = np.ma.masked_equal(np.where(np.arange(len(V)) == F[7, 0], -9999.0, V[:, 0]), -9999)
    assert np.nanmin(result.interpolate(masked, points)) >= V[:, 0].min()
    assert np.nanmin(result.bake(masked, 64)) >= V[:, 0].min()
    page = result.view_html(fields={"height": masked, "label": label})
    assert '"name": "height", "kind": "values"' in page
    assert '"name": "label", "kind": "labels"' in page
    # What does not count is not read.
    corners = result.apply(np.full(3, 7), np.eye(3))
    values = result.interpolate(masked, corners)
    if name != "SurfaceMap":  # where a point may lie on a cut
        assert np.isnan(values).tolist() == [True, False, False]
    with pytest.raises(ValueError, match="rows"):
        result.interpolate(V[:-1], points)
    with pytest.raises(ValueError, match='"linear", "nearest"'):
        result.interpolate(V, points, method="cubic")


# Of every public method of a result a call; True stands for what it returns where that is any.
CALLS = {
    "apply": lambda result, _: len(result.apply([0, 1], np.eye(3)[:2])) == 2,
    "area_distortion": lambda result, _: np.isfinite(result.area_distortion()).all(),
    "bake": lambda result, _: abs(result.bake(np.ones(result._size()[0]), 32) - 1).max() < 1e-9,
    "interpolate": lambda result, _: (
        result.interpolate(np.ones(result._size()[0]), result.apply(1, [1, 0, 0])) == 1
    ),
    "invert": lambda result, _: result.invert(result.apply(1, [0.3, 0.3, 0.4]))[0] == 1,
    "lost_in_single_precision": lambda result, _: result.lost_in_single_precision()[0] == 0,
    "packed": lambda result, _: (
        result.packed().min() >= -1e-12 and result.packed().max() <= 1 + 1e-12
    ),
    "plot": lambda result, _: len(result.plot()) == 4,
    "report": lambda result, _: json.loads(json.dumps(result.report())) == result.report(),
    "save": lambda result, folder: saved(result, folder),
    "summary": lambda result, _: "valid" in result.summary()[0],
    "view": lambda result, folder: result.view(folder / "a.html").stat().st_size > 10_000,
    "view_html": lambda result, _: result.view_html(title="A").count("<h1>A</h1>") == 1,
}
SURFACES = {".glb", ".npz", ".obj", ".ply"}
# What a map has not, and why.
HOLES = {
    "PartsMap": dict.fromkeys(SURFACES, "its surface is where it came from"),
}


def saved(result, folder):
    """Save a result to each type of file; those that refuse say so."""
    refused = HOLES.get(type(result).__name__, {})
    for suffix in (*SURFACES, ".html", ".json"):
        with (
            pytest.raises(ValueError, match=refused[suffix]) if suffix in refused else nullcontext()
        ):
            result.save(folder / f"map{suffix}")
        assert (folder / f"map{suffix}").exists() == (suffix not in refused)
    return True


@pytest.mark.parametrize("call", CALLS)
@pytest.mark.parametrize("name", MAPS)
def test_every_method_of_every_map(made, tmp_path, name, call):
    assert CALLS[call](made(name)[2], tmp_path)


def test_the_table_has_all_methods():
    of_all = vars(Result) | vars(Bijection)
    del of_all["pattern"]  # of free outlines only, and refused for others
    assert {name for name, x in of_all.items() if callable(x) and name[0] != "_"} == set(CALLS)


@pytest.mark.parametrize("name", MAPS)
def test_an_image_is_saved_with_the_surface(made, tmp_path, name):
    V, _, result = made(name)
    colours = np.clip(result.bake(abs(V), 32), 0, 1)
    for suffix in (".glb", ".obj", ".ply", ".svg", ".json"):
        shows = suffix in (".glb", ".obj") and name != "PartsMap"
        with nullcontext() if shows else pytest.raises(ValueError, match=r"image|\.npy"):
            result.save(tmp_path / f"map{suffix}", image=colours)
        assert (tmp_path / f"map{suffix}").exists() == shows
    if name == "PartsMap":
        return
    png = (tmp_path / "map.png").read_bytes()
    assert png in (tmp_path / "map.glb").read_bytes()
    assert "map_Kd map.png" in (tmp_path / "map.mtl").read_text()
    read = image.imread(tmp_path / "map.png")[..., :3]
    np.testing.assert_allclose(read, colours, atol=0.5 / 255 + 1e-9)
    result.save(tmp_path / "again.glb", image=tmp_path / "map.png")
    assert (tmp_path / "again.glb").read_bytes() == (tmp_path / "map.glb").read_bytes()


def test_reports_have_one_form(made):
    """What all maps have has the same keys in all reports, and in those of charts."""
    reports = [made(name)[2].report() for name in MAPS]
    reports += made("SurfaceMap")[2].report()["charts"]
    reports.append(cdcp_igl.surface_map(*BALL, outline="free", refine=1).report())
    reports.append(cdcp_igl.sphere_map(*BALL, refine=1).report())
    shapes = [
        {
            key: sorted(report[key]) if isinstance(report[key], dict) else type(report[key])
            for key in ("boundary", "mobius", "repair", "laplacian", "solver", "valid")
        }
        for report in reports
    ]
    assert all(shape == shapes[0] for shape in shapes)
    for record in ("refinement", "lost_in_single_precision", "angular_distortion_degrees"):
        keys = {tuple(report[record]) for report in reports if report[record] is not None}
        assert len(keys) == 1
    common = set.intersection(*(set(report) for report in reports))
    assert {"boundary", "laplacian", "mobius", "repair", "refinement", "solver"} < common


@pytest.mark.parametrize("name", MAPS)
def test_every_map_can_be_refined_and_tells_how_far_it_is(name, tmp_path):
    function, (V, F, *_), needed = MAPS[name]
    told = []
    options = {"progress": lambda phase, fraction: told.append((phase, fraction))}
    if name == "PartsMap":
        options["folder"] = cdcp_igl.partition((V, F), tmp_path / "parts", parts=4)
        assert "no refinement" in " ".join(parts_map.__doc__.split())
    else:
        options |= {"refine": 2, "refine_norm": 1.2, "refine_seconds": 100}
    result = function(V, F, **needed, **options)
    assert told[-1] == ("done", 1)
    fractions = [fraction for _, fraction in told]
    assert fractions == sorted(fractions)
    if name != "PartsMap":
        assert result.report()["refinement"]["norm"] == 1.2


@pytest.mark.parametrize("name", MAPS)
def test_a_map_is_pickled_without_what_it_has_looked_up(made, name):
    _, _, result = made(name)
    points = result.apply([3, 5], [[0.2, 0.3, 0.5]] * 2)
    other = pickle.loads(pickle.dumps(result))
    assert str(other) == str(result)
    np.testing.assert_array_equal(other.invert(points)[0], result.invert(points)[0])
