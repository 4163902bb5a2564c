"""Surfaces that are closed but for a hole at the end of an arm: a spot of the disk holds them."""

import numpy as np
import pytest
from surfaces import arms

import cdcp_igl
from cdcp_igl.arrays import coordinates
from cdcp_igl.certificate import certify
from cdcp_igl.rescue.boundary import BoundaryMethod, around, harmonic_shares
from cdcp_igl.rescue.candidate import HarmonicMap, Provenance
from cdcp_igl.rescue.recentering import deep_vertex, recentered
from cdcp_igl.solve.factored import FactoredSurface
from cdcp_igl.steps.center import central_face
from cdcp_igl.steps.extension import extended_again, harmonic_extension
from cdcp_igl.steps.mobius import composed, mobius_transformation
from cdcp_igl.surface.mesh import DiskMesh
from cdcp_igl.surface.triangles import flipped_faces


def harmonic_map(V, F):
    """The map before its normalisation, and its surface."""
    surface = FactoredSurface.of(DiskMesh(V, F)).delaunay
    center = central_face(surface)
    f = harmonic_extension(surface, around(harmonic_shares(surface, center.face)))
    done = Provenance(center=center, boundary=BoundaryMethod("harmonic measure"))
    return surface, HarmonicMap(surface, f, done)


@pytest.mark.parametrize(("length", "width"), [(20, 1), (60, 3)])
@pytest.mark.parametrize(
    "options",
    [{}, {"refine": 3}, {"mobius": "area"}, {"mobius": None, "refine": 3}, {"preset": "paper"}],
    ids=str,
)
def test_arms_are_as_conformal_as_short_ones(length, width, options):
    """Their ends are 1e-21 of the disk, and 1e-11 of the spot around the place where they meet."""
    mean = cdcp_igl.disk_map(*arms(length, width), **options).distortion.mean
    short = cdcp_igl.disk_map(*arms(length // 2, width), **(options | {"mobius": "angle"}))
    assert mean < 1.05 * short.distortion.mean


def test_a_transformation_that_loses_what_is_small_is_not_applied():
    V, F = arms(40, 2)
    result = cdcp_igl.disk_map(V, F)
    plain = cdcp_igl.disk_map(V, F, mobius=None)
    assert result.distortion.mean <= plain.distortion.mean
    assert plain.mobius.rejected == ""


def test_the_map_differs_by_a_mobius_transformation():
    """To within the digits that the place of what is small has left."""
    surface, harmonic = harmonic_map(*arms(20, 1))
    mesh, before = surface.mesh, harmonic.f
    assert harmonic.needs_correction
    harmonic = harmonic.corrected(straightened=True)
    assert 0 < abs(harmonic.w) < 1
    np.testing.assert_allclose(
        harmonic.f, mobius_transformation(before, harmonic.w), rtol=0, atol=1e-13
    )
    assert abs(abs(harmonic.f[mesh.loop]) - 1).max() < 1e-15
    lost = flipped_faces(before, mesh.F)[0]
    assert len(lost) > 0
    assert certify(mesh, coordinates(harmonic.f)).valid


def test_extending_again_finds_digits_that_the_solution_has_not():
    """Twice: nothing is found the second time but the rounding of what is there."""
    surface, harmonic = harmonic_map(*arms(20, 1))
    mesh, solved = surface.mesh, harmonic.f
    vertex = deep_vertex(mesh, solved)
    once = extended_again(surface, solved - solved[vertex])
    once -= once[vertex]
    twice = extended_again(surface, once)
    twice -= twice[vertex]
    near = np.argsort(abs(once))[1 : len(once) // 2]
    assert abs(once - (solved - solved[vertex]))[near].max() > 1e-2 * abs(once[near]).min()
    assert (abs(twice - once)[near] / abs(once[near])).max() < 1e-6


def test_ordinary_maps_stay_where_they_are(real_mesh):
    V, F = real_mesh("femur_2411")
    mesh = DiskMesh(V, F)
    f = cdcp_igl.cdcp(V, F) @ [1, 1j]
    assert deep_vertex(mesh, f) is None
    same, w = recentered(mesh, f, lambda f: f)
    assert same is f
    assert w == 0


def test_what_is_small_next_to_the_circle_stays_there():
    """No transformation gives it more digits than it has."""
    V, F = cdcp_igl.datasets.ellipse(10)[:2]
    f = mobius_transformation(cdcp_igl.cdcp(V, F) @ [1, 1j], 1 - 1e-13)
    assert deep_vertex(DiskMesh(V, F), f) is None


def test_what_settles_on_the_circle_stays():
    surface, harmonic = harmonic_map(*arms(20, 1))
    mesh, f = surface.mesh, harmonic.f
    vertex = deep_vertex(mesh, f)
    same, w = recentered(mesh, f, lambda d: d + (1 - f[vertex]))
    assert same is f
    assert w == 0


def test_composed_transformations():
    z, first, second = 0.3 - 0.4j, 0.5 + 0.1j, -0.2 + 0.6j
    both = mobius_transformation(mobius_transformation(z, first), second)
    at_once = mobius_transformation(z, composed(first, second))
    assert abs(both) == pytest.approx(abs(at_once), abs=1e-15)
