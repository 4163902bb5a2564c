"""Any surface onto charts."""

from functools import partial
from itertools import combinations

import meshes
import numpy as np
import pytest
import surfaces
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import maximum_filter, minimum_filter

import cdcp_igl
from cdcp_igl.atlas import charts, cones, even
from cdcp_igl.result.packing import Packing, laid_flat
from cdcp_igl.surface.mesh import DiskMesh
from cdcp_igl.surface.triangles import face_areas

onto_disks = partial(cdcp_igl.surface_map, outline="disk")


def assert_consistent(result, V, F):
    """What every surface map promises of the rows of the given faces."""
    assert result.valid
    assert result.uv.shape == (len(F), 3, 2)
    surfaces.assert_glues_back(result.cut, V, F)
    np.testing.assert_array_equal(result.uv_cut[result.cut.F], result.uv)
    mapped = result.face_chart >= 0
    elsewhere = np.isin(F, np.asarray(F)[mapped])  # a face that is left out has its corners there
    np.testing.assert_array_equal(np.isfinite(result.uv).all(axis=2), elsewhere)
    if isinstance(result.charts[0], cdcp_igl.DiskMap):
        assert np.hypot(*result.uv[mapped].reshape(-1, 2).T).max() <= 1 + 1e-12
    assert set(result.face_chart[mapped]) == set(range(len(result.charts)))
    assert result.shares.sum() == pytest.approx(1)


def test_what_filled_a_hole_leaves_no_fans_at_one_vertex():
    """Where a cut ends at the hole, and the part that has it is parted on."""
    assert cdcp_igl.surface_map(*surfaces.voxels(5, size=4, missing=8)).valid


def test_outlines_that_meet_only_where_a_hole_is_filled():
    """One side of the cut there is no part of the surface, and is no end to part it between."""
    V, F = surfaces.voxels(224)
    pierced = F[~np.isin(F, np.arange(0, len(V), 35)).any(axis=1)]
    assert cdcp_igl.surface_map(V, pierced).valid


@settings(max_examples=5)
@given(surfaces.random_voxels(3), st.integers(0, 1000), st.sampled_from([0, 0.3]))
def test_flipped_faces_are_mapped_as_the_others(mesh, seed, share):
    V, F = mesh
    flipped = np.random.default_rng(seed).random(len(F)) < share
    given = np.where(flipped[:, None], F[:, ::-1], F)
    result = onto_disks(V, given)
    assert_consistent(result, V, given)
    assert (result.face_chart >= 0).all()
    (a, b), (c, d) = ((result.uv[:, k] - result.uv[:, 0]).T for k in (1, 2))
    up = (a * d > b * c) ^ flipped
    assert len(np.unique([result.face_chart, up], axis=1).T) == len(result.charts)
    assert share or up.all()


@pytest.mark.parametrize("outline", ["free", "disk"])
def test_parts_are_compared_with_those_that_may_be_like_them(monkeypatch, outline):
    """And not each with all others: of 4,000 leaves that took a minute."""
    compared, made_like = list[bool](), charts._made_like

    def counting(*args):
        made = made_like(*args)
        compared.append(made is not None)
        return made

    monkeypatch.setattr(charts, "_made_like", counting)
    V = np.random.default_rng(0).normal(size=(120, 3))
    V = np.vstack([V, 2 * V + 20])
    F = np.arange(len(V)).reshape(-1, 3)
    result = cdcp_igl.surface_map(V, F, outline=outline, merge=False)
    assert len(result.charts) == len(F) == 80
    assert sum(compared) >= len(F) / 2  # scaled copies, or any face onto a disk
    assert len(compared) < 2 * len(F)


def test_duplicates_have_the_images_of_their_twins():
    """Also along a cut, where each vertex has several."""
    V, F = surfaces.sphere()
    result = onto_disks(V, np.vstack([F, np.roll(F, 1, axis=1)]))
    one, other = np.split(result.uv, 2)
    left_out = result.face_chart.reshape(2, -1).argmin(axis=0)
    assert set(left_out) <= {0, 1}
    np.testing.assert_array_equal(np.roll(one, 1, axis=1), other)
    single = onto_disks(V, F)
    assert len(result.cut.edges) == len(single.cut.edges)


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"mobius": "area", "refine": 2, "center": "heat", "align": [1, 0, 0]},
        {"solver": "scipy"},
    ],
)
def test_a_disk_is_mapped_as_by_disk_map(options):
    V, F = meshes.grid()
    result = onto_disks(V, F, scale_variation=np.inf, **options)
    expected = cdcp_igl.disk_map(V, F, **options)
    assert result.changes == ()
    assert_consistent(result, V, F)
    np.testing.assert_array_equal(result.uv, expected.uv[F])
    assert result.distortion.mean == pytest.approx(expected.distortion.mean)


@pytest.fixture(scope="module")
def long_tube():
    """Filled at one end it would crowd, but the cut grows to the end."""
    V, F = surfaces.tube(n=80, k=16, length=16)
    return V, F, onto_disks(V, F)


def test_refinement_comes_after_growth(long_tube):
    V, F, plain = long_tube
    refined = onto_disks(V, F, refine=6)
    np.testing.assert_array_equal(refined.cut.edges, plain.cut.edges)
    assert refined.distortion.mean < plain.distortion.mean
    assert refined.charts[0].refinement.steps == 6


# -- what is repaired ------------------------------------------------------------------


def sphere_as_a_grid():
    """One meridian is there twice, and each pole in a row of vertices."""
    x, y, F = meshes.cells(7, 13)
    r, t = np.sin(np.pi * y / 6).round(12), np.pi * (x % 12) / 6
    return np.column_stack([r * np.cos(t), r * np.sin(t), np.cos(np.pi * y / 6)]), F


V, F = surfaces.sphere()
CUBES = surfaces.skin(np.eye(2, dtype=bool)[None])  # which touch in an edge


@pytest.mark.parametrize(
    ("mesh", "disks", "n_cut"),
    [
        (surfaces.soup(V, F), 1, 11),
        (surfaces.soup(*surfaces.torus()), 1, 20),
        (surfaces.soup(V, np.vstack([F, F[:, ::-1]])), 1, 11),  # each face twice
        (surfaces.soup(*CUBES), 2, 4),
        (sphere_as_a_grid(), 1, 6),
    ],
    ids=["sphere", "torus", "two sides", "cubes", "grid"],
)
def test_seams_are_sewn(mesh, disks, n_cut):
    """Vertices of equal coordinates are one, but where sheets only touch."""
    result = onto_disks(*mesh)
    assert (result.valid, len(result.charts), len(result.cut.edges)) == (True, disks, n_cut)
    assert result.changes[0].startswith("merged")
    np.testing.assert_array_equal(result.cut.V[result.cut.F], mesh[0][mesh[1]])
    np.testing.assert_array_equal(result.uv_cut[result.cut.F], result.uv)


def test_seams_stay_if_that_is_asked_for():
    V, F = surfaces.soup(*CUBES)
    assert len(onto_disks(V, F, merge=False).charts) == len(F)


def test_everything_at_once_is_said():
    (V, F), (W, G) = surfaces.torus(), surfaces.tube(n=8)
    n = len(V)
    F = np.vstack([F, G + n, F[5], [[0, 0, 1]], [[n, n + 1, n + 1]]])
    V = np.vstack([V, W, [[np.nan, 0, 0]]])  # which no face uses
    F[7] = F[7, ::-1]
    result = onto_disks(V, F)
    assert_consistent(result, V, F)
    assert result.changes == (
        "left out 2 faces with a repeated corner",
        "left out 1 face that repeated another",
        "reversed 1 face",
        "filled 1 hole",
        f"cut open along {len(result.cut.edges)} edges",
    )
    np.testing.assert_array_equal(np.flatnonzero(result.face_chart < 0), len(F) - 3 + np.arange(3))
    assert "surface map of 363 faces onto 2 disks: valid" in str(result)


def test_a_klein_bottle_is_cut_where_its_orientation_turns_over():
    """Whatever is left out, and the other components as ever."""
    (V, F), (W, G) = surfaces.torus(), surfaces.klein_bottle()
    result = cdcp_igl.surface_map(np.vstack([V, W]), np.vstack([[0, 0, 1], F, G + len(V)]))
    assert result.valid
    assert any("one-sided" in change for change in result.changes)
    assert (result.face_chart[1:] >= 0).all()
    with pytest.raises(cdcp_igl.MeshError, match="one-sided"):
        cdcp_igl.cut(W, G)


@settings(max_examples=20, deadline=None)
@given(st.lists(st.floats(0.1, 3), min_size=1, max_size=12), st.booleans())
def test_loose_triangles_are_mapped_by_similarities(angles, turned):
    corners = [[[0, 0], [1, 0], [np.cos(angle), np.sin(angle)]] for angle in angles]
    V = np.vstack([corner + np.array([3 * k, 0]) for k, corner in enumerate(corners)])
    F = np.arange(len(V)).reshape(-1, 3)
    F[1::2] = np.roll(F[1::2, ::-1] if turned else F[1::2], 1, axis=1)
    result = onto_disks(V, F, merge=False)
    assert_consistent(result, V, F)
    assert result.distortion.max < 1e-6
    np.testing.assert_allclose(np.hypot(*result.uv.T), 1, atol=1e-12)


@pytest.mark.parametrize(("outline", "size"), [("disk", 1), ("free", 3)])
def test_parts_that_are_alike_have_the_same_map(outline, size):
    V, F = surfaces.sphere(rings=8, around=8)
    random = np.random.default_rng(0)
    V += 0.02 * random.normal(size=V.shape)  # no symmetry, of which the last digit would choose
    turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)  # no reflection
    parts, count = [V, 3 * V @ turn + 20, V * [1, 1, 2] - 20], len(F)
    F = np.vstack([F + k * len(V) for k in range(3)])
    for opened in (np.ones(len(F), bool), np.arange(len(F)) % count > 0):  # closed; with a hole
        result = cdcp_igl.surface_map(np.vstack(parts), F[opened], outline=outline)
        assert_consistent(result, np.vstack(parts), F[opened])
        one, other, stretched = np.split(result.uv, 3)
        np.testing.assert_allclose(other, size * one, rtol=1e-12, atol=1e-14)
        assert result.charts[1].timings == {}
        assert abs(stretched - one).max() > 0.01
        alone = cdcp_igl.surface_map(parts[1], F[:count][opened[:count]], outline=outline)
        assert result.charts[1].distortion.mean == pytest.approx(alone.distortion.mean, rel=1e-3)


# -- holes and growth ------------------------------------------------------------------


def punched(V, F, holes):
    """Take out three round holes of a share of the faces each."""
    rng = np.random.default_rng(0)
    middle = V[F].mean(axis=1)
    boundary = DiskMesh(V, F).on_boundary
    inner = np.flatnonzero(~boundary[F].any(axis=1))
    gone = np.zeros(len(F), dtype=bool)
    for center in rng.choice(inner, 3, replace=False):
        distance = np.linalg.norm(middle - middle[center], axis=1)
        gone |= distance < np.quantile(distance, holes)
    return V, F[~gone]


@pytest.mark.parametrize("holes", [0.001, 0.01, 0.05])
def test_filled_holes_distort_less_than_cuts_to_them(holes, real_mesh):
    V, F = punched(*real_mesh("face_1180_ears"), holes)
    filled = onto_disks(V, F)
    cut = onto_disks(V, F, fill=False)
    assert len(filled.cut.edges) == 0 < len(cut.cut.edges)
    assert filled.distortion.mean < cut.distortion.mean


def test_a_hole_at_the_end_of_a_branch_is_filled_and_cut_through(long_tube):
    V, F, grown = long_tube
    whole = onto_disks(V, F, scale_variation=np.inf)
    assert len(whole.cut.edges) == 0 < len(grown.cut.edges)
    assert grown.scale_variation < whole.scale_variation / 2


def test_a_tiny_boundary_is_cut_on_before_the_first_map():
    seen = []
    V, F = surfaces.sphere(rings=20, around=20, stretch=3)
    result = onto_disks(V, F[1:], progress=lambda phase, _: seen.append(phase))
    assert seen.count("factor") == 1
    assert result.scale_variation < 1


def test_growing_evens_out_the_scale():
    """Two spikes at right angles: one path cannot reach all three tips."""
    V, F = surfaces.sphere(rings=40, around=40)
    radius = 1 + 4 * sum(np.exp(8 * (V @ tip - 1)) for tip in np.eye(3))
    V = V * radius[:, None]
    once = onto_disks(V, F, scale_variation=np.inf)
    grown = onto_disks(V, F, scale_variation=0.5)
    assert grown.scale_variation < once.scale_variation
    assert grown.cut.length > once.cut.length
    area = face_areas(V, F)
    distortions = [cdcp_igl.area_distortion(r.cut.V, r.cut.F, r.uv_cut) for r in (once, grown)]
    before, after = (np.average(np.square(d), weights=area) for d in distortions)
    assert after < before


def test_scale_variation_does_not_depend_on_the_moebius_transformation():
    V, F = surfaces.torus()
    by_angle, by_area = (
        onto_disks(V, F, mobius=mobius, scale_variation=np.inf, refine=0)
        for mobius in ("angle", "area")
    )
    assert by_angle.scale_variation == pytest.approx(by_area.scale_variation, rel=1e-6)


# -- packing ---------------------------------------------------------------------------


@settings(max_examples=25)
@given(
    st.lists(st.tuples(*[st.floats(1e-3, 1e3)] * 2), min_size=1, max_size=40),
    st.integers(100, 3000),
    st.floats(0, 4),
    st.booleans(),
)
def test_triangles_are_packed_apart(sizes, size, padding, rotate):
    outlines = [np.array([0, width, width / 3 + 1j * height]) for width, height in sizes]
    factor, move = Packing(size, padding, rotate=rotate).places(outlines)
    assert rotate or (factor == factor[0].real).all()
    np.testing.assert_allclose(abs(factor), abs(factor[0]))
    placed = [size * (a * z + b) for a, b, z in zip(factor, move, outlines, strict=True)]
    ends = [(z.real, z.imag) for z in placed]
    assert np.min(ends) > padding - 1e-6
    assert np.max(ends) < size - padding + 1e-6
    # Two triangles that far apart, across or up, are so across one of their edges, or an axis.
    across = [1j * (np.roll(z, -1) - z) for z in placed]
    for i, j in combinations(range(len(placed)), 2):
        ways = np.concatenate([across[i], across[j], [1, 1j]])
        one, other = ((ways.conj()[:, None] * placed[k]).real for k in (i, j))
        gaps = np.maximum(one.min(1) - other.max(1), other.min(1) - one.max(1))
        assert (gaps / (abs(ways.real) + abs(ways.imag))).max() > padding - 1e-6


@pytest.mark.parametrize("outline", ["free", "disk"])
@pytest.mark.parametrize(("size", "padding"), [(400, 5), (150, 2), (64, 1)])
def test_no_texel_is_nearer_to_two_charts_than_the_padding(outline, size, padding):
    V, F = surfaces.voxels(0, size=4, share=0.15)
    result = cdcp_igl.surface_map(V, F, outline=outline)
    assert len(result.charts) > 3
    t = np.arange(25) / 24
    u, v = (way.ravel() for way in np.meshgrid(t, t))
    weights = np.array([1 - u - v, u, v])[:, u + v <= 1 + 1e-9]
    texels = size * np.einsum("fkx,kn->fnx", result.packed(size, padding), weights)
    assert texels.min() > padding - 1e-6
    assert texels.max() < size - padding + 1e-6
    column, row = np.floor(texels).astype(int).reshape(-1, 2).T
    chart = np.repeat(result.face_chart, weights.shape[1])
    low, high = np.full((size, size), len(F)), np.full((size, size), -1)
    np.minimum.at(low, (row, column), chart)
    np.maximum.at(high, (row, column), chart)
    low, high = minimum_filter(low, padding), maximum_filter(high, padding)
    assert np.array_equal(low[high >= 0], high[high >= 0])


def test_charts_without_padding_do_not_overlap_by_rounding():
    for seed in range(3):
        V, F = surfaces.voxels(seed, size=4, share=0.15)
        texture = cdcp_igl.surface_map(V, F).packed(padding=0)
        assert cdcp_igl.certify(V, F, texture).valid
        assert 0 <= texture.min() < texture.max() <= 1


@pytest.mark.parametrize("count", [1, 2, 3, 5, 10, 100])
def test_packing_is_not_wasteful(count):
    factor, _ = Packing().places([np.array([0, 1, 1 + 1j, 1j])] * count)
    assert count * abs(factor[0]) ** 2 > 0.44


def test_charts_lie_in_the_bays_of_others():
    """Two brackets and a square."""
    bracket = np.array([0, 4, 4 + 1j, 1 + 1j, 1 + 4j, 4j])
    factor, _ = Packing().places([bracket, bracket, np.array([0, 2, 2 + 2j, 2j])])
    assert 18 * abs(factor[0]) ** 2 > 0.5  # of their boxes, 18 / 64 at most


def test_texels_by_the_unit_of_the_surface():
    V, F = surfaces.torus()
    result = cdcp_igl.surface_map(1000 * V, F, size=512, padding=2)
    report, most = result.report(), result.texels_per_unit
    assert report["packing"] == {
        **{"size": 512, "padding": 2, "density": None, "rotate": True},
        **{"fill": result.fill, "texels_per_unit": most},
    }
    assert "packing" in str(result)
    packed = result.packed(density=most / 2)
    assert 0 < packed.min() < packed.max() < 1
    u, v = np.moveaxis(np.diff(packed, axis=1), 1, 0)
    area = abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]).sum() / 2
    assert 512 * np.sqrt(area / face_areas(1000 * V, F).sum()) == pytest.approx(most / 2)
    for options in ({"density": 2 * most}, {"density": most, "size": 256}):
        with pytest.raises(ValueError, match="density must be at most"):
            result.packed(**options)


@pytest.mark.parametrize("smaller", [20, 1e4, 1e12])
def test_charts_that_take_a_small_part_of_the_square(smaller):
    squares = [k * np.array([0, 1, 1 + 1j, 1j]) for k in (1, 2, 3)]
    most = Packing().size * abs(Packing().places(squares)[0][0])
    factor, move = Packing(density=most / smaller).places(squares)
    np.testing.assert_allclose(abs(factor), most / smaller / Packing().size)
    places = factor[:, None] * squares + move[:, None]
    low, high = places.real.min(axis=1), places.real.max(axis=1)
    apart = Packing().padding / Packing().size * (1 - 1e-9)
    assert min(low.min(), places.imag.min()) >= apart
    assert high.max() < 3.5 / smaller + 0.01
    for i, j in ((0, 1), (0, 2), (1, 2)):
        gap = abs(np.subtract.outer(places[i], places[j])).min()
        assert gap >= apart


def test_charts_lie_where_they_were_if_they_are_not_turned():
    V, F = surfaces.torus()
    result = cdcp_igl.surface_map(V, F, rotate=False)
    there = (result.packed(), result.uv)
    np.testing.assert_allclose(*(d / abs(d).max() for d in map(partial(np.diff, axis=1), there)))


@given(st.floats(0, 7), st.floats(1, 50))
def test_a_turned_rectangle_is_laid_flat(angle, width):
    z = np.exp(1j * angle) * np.array([0, width, width + 1j, 1j])
    flat = laid_flat(z) * z
    np.testing.assert_allclose([np.ptp(flat.real), np.ptp(flat.imag)], [width, 1], rtol=1e-6)


def test_packed_corners_lie_in_the_square_by_area():
    V, F = surfaces.voxels(0, size=4, share=0.15)
    result = onto_disks(V, F)
    assert len(result.charts) > 3
    packed = result.packed()
    assert packed.shape == result.uv.shape
    assert packed.min() >= 0
    assert packed.max() <= 1
    # A similarity of each disk, and the scale of its area is its share on the surface.
    sides = [np.linalg.norm(np.diff(uv, axis=1), axis=2).sum(axis=1) for uv in (packed, result.uv)]
    disks = range(len(result.charts))
    scale = np.array([np.divide(*(s[result.face_chart == k].sum() for s in sides)) for k in disks])
    np.testing.assert_allclose(scale**2 / (scale**2).sum(), result.shares)


# -- charts ----------------------------------------------------------------------------


def test_free_outlines_keep_the_scale_and_the_size():
    V, F = surfaces.torus()
    free, disk = (cdcp_igl.surface_map(V, F, outline=outline) for outline in ("free", "disk"))
    assert_consistent(free, V, F)
    assert (len(free.charts), free.conformal) == (1, True)
    assert free.scale_variation < disk.scale_variation / 2
    assert free.distortion.mean < disk.distortion.mean
    packed = free.packed()
    assert -1e-12 < packed.min() < packed.max() < 1 + 1e-12
    sides = [np.linalg.norm(np.diff(uv, axis=1), axis=2) for uv in (packed, free.uv)]
    np.testing.assert_allclose(sides[0] / sides[1], (sides[0] / sides[1])[0, 0], rtol=1e-9)


def test_a_strip_is_parted_until_its_scale_is_even():
    V, F = meshes.corridor(8, 10)
    charts = {most: onto_disks(V, F, max_charts=most) for most in (1, 2, None)}
    assert [len(result.charts) for result in charts.values()][:2] == [1, 2]
    assert charts[1].scale_variation > charts[2].scale_variation > 1 >= charts[None].scale_variation
    for result in charts.values():
        assert_consistent(result, V, F)
        assert result.face_chart.min() == 0
    assert "asked for: 1" in str(charts[1])
    assert len(cdcp_igl.surface_map(V, F, outline="free").charts) == 1


def test_limbs_are_parted_from_the_rest():
    V, F = surfaces.arms(16, 3)
    result = onto_disks(V, F)
    x, y, _ = V[F].mean(axis=1).T
    assert len(result.charts) == 4
    assert len(set(result.face_chart[[x.argmin(), x.argmax(), y.argmax()]])) == 3
    assert result.scale_variation <= 1
    assert len(onto_disks(V, F, max_charts=3).charts) <= 3


def test_polygons_are_not_parted():
    V, F = meshes.corridor(8, 10)
    polygon = np.tile(np.arange(len(F) // 2), 2)  # the two triangles of a cell
    chart = onto_disks(V, F, polygon_of_face=polygon).face_chart
    assert chart.max() > 0
    np.testing.assert_array_equal(*np.split(chart, 2))


# -- real surfaces ---------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "mean"),
    [
        ("closed_spot_2930", 3.6),
        ("handles_kitten_10000", 1.6),
        ("loops_legohead_4179", 2.5),
        ("defects_bunny_6164", 2.8),
    ],
)
def test_real_surfaces(name, mean, real_mesh):
    V, F = real_mesh(f"any/{name}")
    result = cdcp_igl.surface_map(V, F)
    assert_consistent(result, V, F)
    assert result.distortion.mean < mean


# -- even scale ------------------------------------------------------------------------


def extruded(outline, height):
    """A solid whose outline is convex, its ends fans, in as few triangles as it takes."""
    P, n = np.asarray(outline, dtype=float), len(outline)
    i, j = np.arange(n), np.roll(np.arange(n), -1)
    V = np.vstack([np.column_stack([P, np.full(n, z)]) for z in (0, height)])
    ends = [np.column_stack([0 * i[1:-1], i[1:-1], j[1:-1]])]
    sides = [np.column_stack([i, j, n + j]), np.column_stack([i, n + j, n + i])]
    return V, np.vstack([ends[0][:, ::-1], ends[0] + n, *sides])


def circle(n):
    angle = 2 * np.pi * np.arange(n) / n
    return np.column_stack([np.cos(angle), np.sin(angle)])


TIP = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1]])
SOLIDS = {
    "cube": (extruded([(0, 0), (1, 0), (1, 1), (0, 1)], 1), 1),
    "plank": (extruded([(0, 0), (9, 0), (9, 1), (0, 1)], 0.1), 1),
    "house": (extruded([(0, 0), (2, 0), (2, 1), (1, 2), (0, 1)], 3), 1),
    "prism": (extruded(circle(6), 2), 1),
    "can": (extruded(circle(40), 1), 1),
    "L": (surfaces.skin(np.array([[[1, 1, 1], [1, 0, 0]]], dtype=bool)), 2),
    "frame": (surfaces.skin(np.array([[[1, 1, 1], [1, 0, 1], [1, 1, 1]]], dtype=bool)), 1),
    "cone without a base": (([[0, 0, 9], [1, 0, 0], [0, 1, 0], [-1, -1, 0]], TIP), 1),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_a_solid_comes_out_as_its_net(name):
    (V, F), charts = SOLIDS[name]
    result = cdcp_igl.surface_map(V, F)
    assert_consistent(result, V, F)
    assert len(result.charts) == charts
    assert result.distortion.max < 1e-6
    assert result.texel_density.ratio == pytest.approx(1, abs=1e-9)


@pytest.mark.parametrize("turn", [0, 1])
@pytest.mark.parametrize("size", [1, 1e5])
def test_what_varies_by_rounding_only_is_not_parted(turn, size):
    turned = np.array(
        [[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]]
    )
    for outline, height in ((circle(24), 3), (circle(5), 0.2), ([[0, 0], [1, 0], [1, 1]], 1)):
        V, F = extruded(outline, height)
        result = cdcp_igl.surface_map(size * V @ turned, F, scale_variation=0)
        assert (result.scale_variation, len(result.charts)) == (0, 1)
        assert result.verdict == "valid"


def test_a_tube_is_cut_and_a_plate_is_filled():
    """Whichever distorts less, unless that is said."""
    x, y, F = meshes.cells(12, 25)
    angle = np.pi * (x % 24) / 12
    tube = np.column_stack([np.cos(angle), np.sin(angle), y / 4]), F
    hole = (abs(x[F] - 12) < 4).all(axis=1) & (abs(y[F] - 5) < 3).all(axis=1)
    plate = np.column_stack([x, y, 0 * x]), F[~hole]
    for surface, n_cut in ((tube, 11), (plate, 0)):
        result = cdcp_igl.surface_map(*surface)
        assert (len(result.charts), len(result.cut.edges)) == (1, n_cut)
        assert result.distortion.max < 1e-6
        assert result.texel_density.ratio == pytest.approx(1, abs=1e-9)
    assert cdcp_igl.surface_map(*tube, fill=True).distortion.mean > 0.1


@pytest.mark.parametrize(
    ("name", "most"),
    [
        ("closed_spot_2930", 6),
        ("handles_kitten_10000", 2),
        ("loops_legohead_4179", 2),
        ("defects_bunny_6164", 4),
    ],
)
def test_the_scale_is_even(name, most, real_mesh):
    """Texel density and shares by the coordinates in the square."""
    V, F = real_mesh(f"any/{name}")
    result = cdcp_igl.surface_map(V, F)
    assert_consistent(result, V, F)
    assert result.scale_variation <= 0.2
    assert len(result.charts) <= most
    assert result.distortion.mean < 1.8
    mapped = result.face_chart >= 0
    u, v = np.moveaxis(np.diff(result.packed()[mapped], axis=1), 1, 0)
    in_square, area = abs(np.linalg.det(np.stack([u, v], axis=1))) / 2, face_areas(V, F[mapped])
    density = np.repeat(np.sqrt(in_square / area), np.ceil(area / area.mean() * 100).astype(int))
    low, high = np.quantile(density, [0.05, 0.95])
    assert result.texel_density.ratio == pytest.approx(high / low, rel=0.01)
    assert high / low < 2


def test_charts_of_more_than_a_degree_are_refined_unless_that_is_said():
    V, F = surfaces.sphere(12, 16)
    plain, fine = (
        cdcp_igl.surface_map(V, F, refine=steps, scale_variation=np.inf) for steps in (0, None)
    )
    assert plain.distortion.mean > 1
    assert fine.distortion.mean < 0.95 * plain.distortion.mean
    assert [chart.refinement is None for chart in plain.charts] == [True]
    np.testing.assert_array_equal(fine.cut.edges, plain.cut.edges)


@pytest.mark.parametrize("outline", ["free", "disk"])
def test_only_maps_that_are_kept_are_warned_of(outline, caplog):
    V, F = surfaces.arms(6, 1)
    result = cdcp_igl.surface_map(V, F, outline=outline, fill=True)
    warned = "not conformal" in caplog.text
    assert warned == (not result.conformal)
    assert caplog.text.count("not conformal") == int(warned)


def test_what_is_not_reached_is_said_first():
    V, F = cdcp_igl.datasets.spheroid(4)[:2]
    result = cdcp_igl.surface_map(V, F, scale_variation=0.001, max_charts=1)
    assert "asked for: 0.001 (max_charts)" in str(result).splitlines()[0]
    assert "asked for" not in str(cdcp_igl.surface_map(V, F))


def test_a_chart_without_a_map_is_parted(monkeypatch):
    """As far as there may be more charts."""
    made_of = cones.solve

    def of_few_faces(problem):
        made = made_of(problem)
        if len(made.mesh.F) > 200:
            raise cdcp_igl.MapError("no map", made)
        return made

    monkeypatch.setattr(cones, "solve", of_few_faces)
    V, F = surfaces.sphere()
    result = cdcp_igl.surface_map(V, F)
    assert_consistent(result, V, F)
    assert len(result.charts) > 1
    assert max(len(chart.mesh.F) for chart in result.charts) <= 200
    assert len(cdcp_igl.surface_map(V, F, max_charts=len(result.charts)).charts) == len(
        result.charts
    )
    with pytest.raises(cdcp_igl.MapError, match="no map"):
        cdcp_igl.surface_map(V, F, max_charts=1)


def test_a_chart_that_is_not_conformal_is_parted():
    """A coarse star: in one chart its faces are too large, and the scale varies more."""
    V, F = surfaces.star(1, 72)
    whole = cdcp_igl.surface_map(V, F, max_charts=1)
    assert not whole.conformal
    result = cdcp_igl.surface_map(V, F)
    assert_consistent(result, V, F)
    assert result.conformal
    assert 1 < len(result.charts) < 8
    assert result.scale_variation < whole.scale_variation / 2


@pytest.mark.parametrize("seed", [1, 6, 27])
def test_a_chart_of_large_faces_is_parted_where_its_scale_is_far_from_even(seed):
    """Its draft is even, as that is linear."""
    V, F = surfaces.star(seed, 40)
    whole = cdcp_igl.surface_map(V, F, max_charts=1)
    assert whole.conformal
    assert whole.scale_variation > 0.4
    result = cdcp_igl.surface_map(V, F)
    assert_consistent(result, V, F)
    assert 1 < len(result.charts) < 6
    assert result.scale_variation < whole.scale_variation / 2
    assert result.distortion.mean < whole.distortion.mean


def test_a_surface_of_many_handles_is_parted_before_it_is_cut(monkeypatch):
    """As long as there may be more charts."""
    genera, laid = [], even.open_to_disk

    def opened(component):
        genera.append(component.topology.genus)
        return laid(component)

    monkeypatch.setattr(even, "open_to_disk", opened)
    solid = np.ones((9, 9, 1), dtype=bool)
    solid[1::2, 1::2] = False
    V, F = surfaces.skin(solid)
    V = V + 0.01 * np.random.default_rng(0).normal(size=V.shape)
    result = cdcp_igl.surface_map(V, F)
    assert_consistent(result, V, F)
    assert 0 < max(genera) < 16
    genera.clear()
    assert len(cdcp_igl.surface_map(V, F, max_charts=1).charts) == 1
    assert max(genera) == 16
