"""What a map keeps: angles, lengths, areas, or anything between."""

import json

import meshes
import numpy as np
import pytest
from commands import invoke
from numpy.testing import assert_allclose, assert_array_equal
from surfaces import skin

import cdcp_igl
from cdcp_igl.arrays import as_complex, coordinates
from cdcp_igl.descent import energies
from cdcp_igl.descent.descent import keeping, way_to_flip
from cdcp_igl.descent.energies import SymmetricDirichlet, resized
from cdcp_igl.descent.scaffold import triangulated_around
from cdcp_igl.descent.targets import Disk, Outline
from cdcp_igl.descent.tradeoff import measured
from cdcp_igl.scale.one_file import Settings
from cdcp_igl.surface.mesh import DiskMesh
from cdcp_igl.surface.triangles import face_areas, flipped_faces, oriented_areas
from cdcp_igl.verdict.outline import certify_outline


@pytest.fixture(scope="module")
def bent():
    """A bumpy disk, and a map of it that stretches and flips no face."""
    V, F, _ = cdcp_igl.datasets.spherical_cap(5)
    V = V + 0.05 * np.random.default_rng(0).standard_normal(V.shape)
    f = as_complex(cdcp_igl.free_map(V, F).uv)
    return DiskMesh(V, F), f * (1.5 + 0.2j) + 0.3 * f.conj() + 0.1 * f**2


@pytest.mark.parametrize("k", [1, 0.1, 2])
@pytest.mark.parametrize("t", [0, 0.02, 0.5, 0.7, 1])
def test_energy_is_that_of_the_singular_values(bent, t, k):
    mesh, f = bent
    K = cdcp_igl.quasi_conformal_dilatation(mesh.scaled, mesh.F, coordinates(f))
    area = face_areas(mesh.scaled, mesh.F)
    s, q = np.log(K), np.log(oriented_areas(f, mesh.F)[0] / 2 / area)
    low, high = np.cosh(k * s), np.cosh(k * q)
    e = low * (1 - 2 * t + 2 * t * high) if t <= 0.5 else high * (2 * t - 1 + (2 - 2 * t) * low)
    expected = np.average((e - 1) / k**2, weights=area)
    assert_allclose(SymmetricDirichlet.of(mesh, t, k).value(f), expected, rtol=1e-12)
    if (t, k) == (0.5, 1):  # symmetric Dirichlet
        squares = np.exp([q + s, q - s])
        assert_allclose(4 * e, (squares + 1 / squares).sum(axis=0), rtol=1e-10)


@pytest.mark.parametrize("t", [0, 0.3, 0.9])
def test_slope_and_curvature_are_those_of_differences(bent, t, monkeypatch):
    monkeypatch.setattr(energies, "_clamped", lambda *block: block)  # the Hessian as it is
    mesh, f = bent
    energy, h = SymmetricDirichlet.of(mesh, t), 1e-3
    dz = as_complex(0.05 * np.random.default_rng(1).standard_normal((len(f), 2)))
    before, here, after = (energy.value(f + x * dz) for x in (-h, 0, h))
    quadratic = energy.quadratic(f, whole=True)
    slope, bend = (np.vdot(x, dz).real for x in (quadratic.gradient(), quadratic.times(dz)))
    assert_allclose(slope, (after - before) / (2 * h), rtol=1e-4)
    assert_allclose(bend, (after - 2 * here + before) / h**2, rtol=1e-4)


def test_a_step_to_the_first_flip_flips_one_face(bent):
    mesh, f = bent
    step = as_complex(np.random.default_rng(2).standard_normal((len(f), 2)))
    way = way_to_flip(mesh.F, f, step)
    assert len(flipped_faces(f + 0.999999 * way * step, mesh.F)[0]) == 0
    assert len(flipped_faces(f + 1.000001 * way * step, mesh.F)[0]) == 1
    assert way_to_flip(mesh.F, f, 2j * f) == np.inf  # turned and grown


@pytest.mark.parametrize("t", [0.02, 0.5, 0.99])
def test_what_is_flat_stays(t):
    V, F, _ = cdcp_igl.datasets.square(6)
    mesh = DiskMesh(V, F)
    descent = keeping(mesh, as_complex(mesh.scaled[:, :2]), t)
    assert_allclose(coordinates(descent.f), mesh.scaled[:, :2], atol=1e-12)
    assert descent.stopped
    assert descent.steps == 0
    assert_allclose(cdcp_igl.free_map(V, F, keep=t, align=[1, 0, 0]).uv, V[:, :2], atol=1e-12)


@pytest.mark.parametrize("target", [Outline(), Disk()])
def test_balance_lowers_the_energy_and_flips_nothing(bent, target):
    mesh, f = bent
    sliding = isinstance(target, Disk)
    if sliding:
        f = as_complex(cdcp_igl.disk_map(mesh.scaled, mesh.F).uv)
    for t in (0.02, 0.5, 0.99):
        energy = SymmetricDirichlet.of(mesh, t, target=target)
        start = f if sliding else resized(energy, f)
        g = keeping(mesh, start, t, target).f
        assert energy.value(g) < energy.value(start)
        assert target.certificate(mesh, g, target.flipped(mesh.F, g)).valid
        # Nothing small lowers it much more.
        slope = target.tangential(mesh, g, energy.quadratic(g, whole=True).gradient())
        assert abs(slope).max() < 0.02


@pytest.fixture(scope="module")
def hill():
    V, F, _ = cdcp_igl.datasets.spherical_cap(8)
    return V * [1, 1.5, 2] + 0.1 * np.sin(2 * V[:, [1, 2, 0]]), F  # not symmetric


@pytest.mark.parametrize("make", [cdcp_igl.free_map, cdcp_igl.disk_map])
def test_what_is_said_of_a_map_is_what_was_asked_for(hill, make):
    angles, lengths, areas = (make(*hill, keep=keep) for keep in ("angles", "lengths", "areas"))
    assert_array_equal(angles.uv, make(*hill, refine=0).uv)
    assert angles.kept is None
    assert "keeps" not in str(angles)
    assert lengths.valid
    assert lengths.verdict == "valid"
    assert lengths.kept.dirichlet < min(angles_kept(angles).dirichlet, areas.kept.dirichlet)
    assert areas.kept.texels < lengths.kept.texels < angles_kept(angles).texels
    assert angles.distortion.mean < lengths.distortion.mean < areas.distortion.mean
    assert "keeps lengths (0.5)" in repr(lengths)
    assert "0.99" in str(areas)
    report = lengths.report(flat=True)
    assert report["kept_keep"] == 0.5
    assert report["conformal"] is None
    assert report["kept_texels"] == lengths.kept.texels
    assert "NOT CONFORMAL" not in lengths.view_html()


def angles_kept(result):
    return measured(result.mesh, result._f, 0, result._target, 0)


def test_what_a_conformal_disk_crowds_together_is_drawn_apart():
    corridor = meshes.corridor(20)
    plain = cdcp_igl.disk_map(*corridor, mobius="area")
    energy = SymmetricDirichlet.of(plain.mesh, 0.5, target=Disk())
    from_there = energy.value(keeping(plain.mesh, as_complex(plain.uv), 0.5, Disk()).f)
    result = cdcp_igl.disk_map(*corridor, keep="lengths")
    assert result.valid
    assert energy.value(as_complex(result.uv)) < 1e-6 * from_there


def test_limbs_that_a_free_conformal_map_crowds_together_are_drawn_apart():
    """Two prongs, less a face of one; from the conformal map alone the energy was above 1e9."""
    solid = np.zeros((3, 1, 25), dtype=bool)
    solid[..., 0] = solid[::2] = True
    V, F = skin(solid)
    result = cdcp_igl.free_map(V, np.delete(F, 100, axis=0), keep="lengths")
    assert result.valid
    assert result.kept.dirichlet < 20


def test_lengths_are_those_of_the_surface_and_scale_with_it(hill):
    V, F = hill
    result = cdcp_igl.free_map(V, F, keep="lengths")
    assert abs(result.area_ratio - 1) < 0.1
    assert_allclose(cdcp_igl.free_map(1000 * V, F, keep="lengths").uv, 1000 * result.uv, atol=1e-6)
    K = cdcp_igl.quasi_conformal_dilatation(V, F, result.uv)
    assert_allclose(result.kept.stretch, K.max(), rtol=1e-9)
    ratio = np.exp(cdcp_igl.area_distortion(V, F, result.uv)) * result.area_ratio
    low, high = K * ratio, ratio / K
    e = (low + high + 1 / low + 1 / high) / 4
    assert_allclose(np.average(e, weights=face_areas(V, F)), result.kept.dirichlet, rtol=1e-3)


@pytest.mark.parametrize("make", [cdcp_igl.free_map, cdcp_igl.disk_map])
def test_turned_and_renumbered_it_is_the_same(hill, make):
    V, F = hill
    how = {"keep": 0.7, "align": [1, 0, 0]}
    uv = make(V, F, **how).uv
    turn = np.linalg.qr(np.random.default_rng(0).standard_normal((3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    turned = make(V @ turn.T, F, keep=0.7, align=turn[:, 0])
    assert_allclose(turned.uv, uv, atol=1e-7 * abs(uv).max())
    order = np.random.default_rng(1).permutation(len(V))
    rows = np.argsort(order)
    renumbered = make(V[order], np.roll(rows[F], 1, axis=1)[::-1], **how)
    assert_allclose(renumbered.uv[rows], uv, atol=1e-7 * abs(uv).max())


@pytest.mark.parametrize("make", [cdcp_igl.free_map, cdcp_igl.disk_map])
def test_a_map_is_continued_from_the_last_one(hill, make):
    at_once = make(*hill, keep=0.7)
    further = make(*hill, keep="lengths").continued(keep=0.7)
    assert further.valid
    assert further.kept.steps < at_once.kept.steps
    assert_allclose(further.uv, at_once.uv, atol=0.02 * abs(at_once.uv).max())
    from_angles = make(*hill, mobius="area") if make is cdcp_igl.disk_map else make(*hill)
    assert_allclose(from_angles.continued(keep=0.7).kept.dirichlet, at_once.kept.dirichlet, 1e-3)


def test_a_bound_on_texel_density_is_held_by_the_least_that_does(hill):
    angles = angles_kept(cdcp_igl.free_map(*hill))
    bound = (1 + angles.texels) / 2
    result = cdcp_igl.free_map(*hill, keep=f"texels<{bound}")
    assert result.kept.texels <= bound
    less = cdcp_igl.free_map(*hill, keep=0.7 * result.kept.keep)
    assert less.kept.texels > bound
    assert cdcp_igl.free_map(*hill, keep=f"texels<{angles.texels + 1}").kept.keep == 0
    with pytest.raises(cdcp_igl.MapError, match="Texel density is within"):
        cdcp_igl.free_map(*hill, keep="texels<1.00001")


@pytest.mark.parametrize(
    "keep",
    ["length", "texels<1", "texels<x", "texels", 1.5, -0.1, np.nan, None, True, [0.5], "nan"],
)
def test_what_is_no_keep_is_refused(hill, keep):
    with pytest.raises(ValueError, match="keep must be"):
        cdcp_igl.free_map(*hill, keep=keep)


@pytest.mark.parametrize(
    "more", [{"refine": 3}, {"boundary_scale": np.ones(9)}, {"corners": {0: 2 * np.pi}}]
)
def test_what_goes_not_with_keep_is_refused(hill, more):
    with pytest.raises(ValueError, match="leave"):
        cdcp_igl.free_map(*hill, keep="lengths", **more)


def test_angles_are_not_continued(hill):
    with pytest.raises(ValueError, match="angles"):
        cdcp_igl.free_map(*hill).continued(keep="angles")


def test_an_outline_is_kept_apart():
    # A ramp that goes around more than once: laid flat, its ends lie on one another.
    V, F, _ = cdcp_igl.datasets.square(20)
    turn, out = 1.3 * np.pi * V[:, 0], 1 - 0.1 * V[:, 1]
    V = np.column_stack([out * np.cos(turn), out * np.sin(turn), 0.02 * turn])
    plain = cdcp_igl.free_map(V, F)
    overlapping = keeping(plain.mesh, plain._f, 0.5).f
    assert not certify_outline(plain.mesh, coordinates(overlapping)).simple
    result = cdcp_igl.free_map(V, F, keep="lengths")
    assert result.valid
    assert result.kept.dirichlet < angles_kept(plain).dirichlet


@pytest.mark.parametrize("gap", [1e-2, 1e-9, 1e-15])
def test_a_scaffold_that_is_thin(gap):
    """Of angles that lengths do not determine, libigl flips edges until the memory is full."""
    f = np.array([0, 1, 1.1 + 0.5j, 1.1 + (0.5 + gap) * 1j, 1 + 1j, 1j])
    ring, S = triangulated_around(f, np.arange(6))
    assert len(flipped_faces(np.append(f, ring), S)[0]) == 0


@pytest.fixture(scope="module")
def two(hill):
    """Disk maps of two surfaces, and pairs of vertices that are near one another on both."""
    V, F = hill
    one, other = cdcp_igl.disk_map(V, F), cdcp_igl.disk_map(V * [1, 1.1, 0.9], F)
    inside = np.flatnonzero(abs(as_complex(one.uv)) < 0.8)
    rows = inside[:: len(inside) // 8][:8]
    return one, other, np.column_stack([rows, rows])


def test_pairs_meet_to_the_last_bit_and_no_face_flips(two):
    one, other, pairs = two
    rim = one.mesh.loop[[0, 9]]
    pairs = np.vstack([pairs, np.column_stack([rim, rim])])
    match = one.match(other, pairs)
    assert match.certificate.valid
    assert_array_equal(match.uv[pairs[:, 0]], other.uv[pairs[:, 1]])
    expected = cdcp_igl.quasi_conformal_dilatation(one.register(other, pairs), one.mesh.F, match.uv)
    assert_allclose(match.stretch, expected, rtol=1e-6)
    height = other.mesh.V[:, 2]
    assert_allclose(match.pull_back(height), other.interpolate(height, match.uv))


def test_a_false_pair_is_found(two):
    one, other, pairs = two
    z = as_complex(other.uv)
    for false in (2, 5):
        wrong = pairs.copy()
        far = z[wrong[false, 1]] + 0.25 * np.exp(1j)
        wrong[false, 1] = abs(z - far).argmin()
        match = one.match(other, wrong)
        assert match.gains.argmax() == false
        assert match.suspects.tolist() == [false]


@pytest.mark.parametrize(
    ("pairs", "said"),
    [
        ([[0, 0]], "two landmarks or more"),
        ([[0, 0], [0, 5]], "two landmarks or more"),
        ([[0, 0], [5, 5], [5, 7]], "in several pairs"),
        ([[0, 0], [3, 10_000]], "vertices of the two surfaces"),
        ([[0.0, 1.0], [2.0, 3.0]], "integers"),
        ("rim", "only one is on the boundary"),
    ],
)
def test_what_are_no_pairs_is_refused(two, pairs, said):
    one, other, _ = two
    if pairs == "rim":
        pairs = [[0, 0], [5, 5], [one.mesh.loop[0], 8]]
    with pytest.raises(ValueError, match=said):
        one.match(other, pairs)


@pytest.mark.parametrize("seed", [8, 14])
def test_pairs_that_press_faces_flat_are_an_error_of_maps(seed):
    """The energy of one that is all but flipped is no number any more."""
    V, F, _ = cdcp_igl.datasets.spherical_cap(4)
    result, rng = cdcp_igl.disk_map(V, F), np.random.default_rng(seed)
    inside = result.mesh.interior
    pairs = np.column_stack([rng.permutation(inside) for _ in range(2)])[:18]
    with pytest.raises(cdcp_igl.MapError, match="do not all meet"):
        result.match(result, pairs)


def test_pins_are_where_they_are_told_to_be(hill):
    plain = cdcp_igl.free_map(*hill, keep="lengths")
    rows = plain.mesh.loop[::12]
    pins = {int(row): 1.2 * plain.uv[row] + [0.3, -1] for row in rows}
    result = cdcp_igl.free_map(*hill, keep="lengths", pins=pins)
    assert result.valid
    assert_array_equal(result.uv[rows], [*pins.values()])
    assert result.kept.dirichlet > plain.kept.dirichlet
    more = result.continued(keep=0.9)
    assert_array_equal(more.uv[rows], result.uv[rows])
    assert more.kept.texels < result.kept.texels
    pinned = cdcp_igl.free_map(*hill, pins={0: (0, 0), 5: (1, 1)})
    assert_array_equal(pinned.uv[[0, 5]], [[0, 0], [1, 1]])
    assert pinned.kept.keep == 0
    plane, F, _ = cdcp_igl.datasets.square(4)
    flipped = cdcp_igl.free_map(plane, F[:, ::-1], pins={0: (0, 0), 4: (3, 0)})
    assert_array_equal(flipped.uv[[0, 4]], [[0, 0], [3, 0]])
    assert flipped.valid


@pytest.mark.parametrize("keep", ["angles", "lengths"])
def test_pins_at_the_places_of_a_map_whose_boundary_was_eased_are_met(keep):
    """Without a scaffold its boundary would overlap itself as soon as it is free again."""
    V, F, _ = cdcp_igl.datasets.square(20)
    turn, out = 2.6 * np.pi * V[:, 0], 1 - 0.1 * V[:, 1]
    V = np.column_stack([out * np.cos(turn), out * np.sin(turn), 0.02 * turn])
    plain = cdcp_igl.free_map(V, F, keep=keep)
    assert plain.boundary != "own lengths"
    rows = np.arange(7, len(V), 71)
    for share in (0, 1e-3):
        moved = plain.uv[rows] + share * np.ptp(plain.uv) * np.cos([[k, 2 * k] for k in rows])
        pins = dict(zip(rows.tolist(), moved, strict=True))
        result = cdcp_igl.free_map(V, F, keep=keep, pins=pins)
        assert result.valid
        assert_array_equal(result.uv[rows], moved)
        if not share and keep == "angles":
            assert_allclose(result.uv, plain.uv, atol=1e-9 * np.ptp(plain.uv))


def test_pins_in_the_shell(hill, tmp_path):
    surface, out, pins = (tmp_path / name for name in ("hill.npz", "out.npz", "pins.txt"))
    np.savez(surface, V=hill[0], F=hill[1])
    pins.write_text("0 0 0\n\n5 1 0.5\n")
    done = invoke("map", "--free", "--pins", pins, surface, out)
    assert done.exit_code == 0, done.output
    assert_array_equal(np.load(out)["uv"][[0, 5]], [[0, 0], [1, 0.5]])
    for text in ("0 0\n", "0 0 0\n0 1 1\n", "a b c\n", "0 0 0\n"):
        pins.write_text(text)
        done = invoke("map", "--free", "--pins", pins, surface, out, "--force")
        assert done.exit_code == 2
        assert "pins" in done.output
    assert invoke("map", "--free", "--pins", tmp_path / "no.txt", surface, out).exit_code == 2


@pytest.mark.parametrize(
    "pins",
    [
        *({}, {0: (0, 0)}, {0: (0, 0), 10_000: (1, 1)}, {0: (0, 0), 1: (0, 0)}, [0, 1], 5),
        *({0: (0, 0), 1: (np.nan, 1)}, {0: (0, 0), 1: (1, 2, 3)}, {0: "a", 1: (1, 1)}, {0.5: "a"}),
        *({0: (0, 0), -1: (1, 1)}, {0: (0, 0), 1: 1}, {True: (0, 0), False: (1, 1)}, {"0": (0, 0)}),
        *({(0, 1): (0, 0), (2, 3): (1, 1)}, {0: (0, 0), 1: (1, 1j)}, {0: (0, 0), 2**70: (1, 1)}),
    ],
)
def test_what_are_no_pins_is_refused(hill, pins):
    with pytest.raises(ValueError, match="pins"):
        cdcp_igl.free_map(*hill, pins=pins)


@pytest.mark.parametrize(
    "more",
    [
        *({"align": [1, 0, 0]}, {"refine": 2}, {"boundary_scale": np.ones(9)}),
        *({"corners": {0: 2 * np.pi}}, {"keep": "texels<2"}),
    ],
)
def test_what_goes_not_with_pins_is_refused(hill, more):
    with pytest.raises(ValueError, match="pins"):
        cdcp_igl.free_map(*hill, pins={0: (0, 0), 5: (1, 1)}, **more)


def test_pins_that_turn_the_map_over_are_refused(hill):
    plain = cdcp_igl.free_map(*hill, keep="lengths")
    a, b, c = plain.mesh.F[100]
    places = {int(v): plain.uv[v] for v in plain.mesh.loop[::6]}
    places |= {int(a): plain.uv[b], int(b): plain.uv[a], int(c): plain.uv[c]}
    with pytest.raises(cdcp_igl.MapError, match="Leave out pins"):
        cdcp_igl.free_map(*hill, keep="lengths", pins=places)


def test_keep_in_the_shell_and_of_charts(hill, tmp_path):
    surface, out, report = (tmp_path / name for name in ("hill.npz", "out.npz", "report.json"))
    np.savez(surface, V=hill[0], F=hill[1])
    done = invoke("map", "--free", "--keep", "lengths", "--report", report, surface, out)
    assert done.exit_code == 0, done.output
    assert json.loads(report.read_text())["kept"]["keep"] == 0.5
    with pytest.raises(ValueError, match="keep must be"):
        Settings(options={"keep": "volumes"})
    charts = cdcp_igl.surface_map(*hill, outline="free", keep="lengths").charts
    assert [chart.kept.keep for chart in charts] == [0.5]
