"""Claims of the theory pages that no other test measures."""

from functools import cache

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

from cdcp_igl import angle_distortion
from cdcp_igl.algorithm import Steps, algorithm_1
from cdcp_igl.distortion import angle_errors
from cdcp_igl.solve.factored import FactoredSurface
from cdcp_igl.steps.center import Center, central_face
from cdcp_igl.steps.circle import whiten_trace
from cdcp_igl.steps.trace import boundary_trace, face_dipole
from cdcp_igl.steps.zipper import geodesic_map
from cdcp_igl.surface.mesh import DiskMesh

LION, FACE, BRAIN = "chinese_lion_17334", "human_face_17157", "human_brain_48463"


class Surface:
    """The steps of Algorithm 1, to be put together in other ways."""

    def __init__(self, V, F):
        self.surface = FactoredSurface.of(DiskMesh(V, F))
        self.mesh = self.surface.mesh
        self.face = central_face(self.surface).face
        self.trace = boundary_trace(self.surface, self.face)

    def distortion(self, f_B):
        """Mean angular distortion in degrees of the map with these boundary values."""
        given = Center("given", self.face)
        steps = Steps(lambda _: given, circle=lambda _: f_B)
        _, f, _ = algorithm_1(self.surface, steps)
        return np.degrees(abs(angle_errors(self.mesh, f)).mean())


@pytest.fixture(scope="module")
def steps_of(real_mesh):
    return cache(lambda name: Surface(*real_mesh(name)))


def interior_map(z):
    """Map the *inside* of a closed clockwise curve onto the disk, its centroid to 0."""
    after = np.roll(z, -1)
    cross = (z.conj() * after).imag
    centroid = (cross * (z + after)).sum() / (3 * cross.sum())
    # The inversion takes the inside to the outside, and turns the curve around.
    return geodesic_map((1 / (z - centroid)).conj())


def test_interior_map_of_a_known_curve():
    w = np.exp(2j * np.pi * np.arange(400) / 400)
    f = interior_map(w.conj() + 0.1j * w.conj() ** 4)  # symmetric: the centroid is at 0
    turn = np.vdot(w, f)
    assert abs(f - turn / abs(turn) * w).max() < 1e-4


@pytest.mark.parametrize(
    ("name", "outside", "inside"),
    [(LION, 1.420, 1.436), (FACE, 1.209, 1.421), (BRAIN, 1.458, 4.262)],
)
def test_the_surface_is_the_outside_of_the_trace(name, outside, inside, steps_of):
    steps = steps_of(name)
    exterior, interior = geodesic_map(steps.trace), interior_map(steps.trace)
    assert steps.distortion(exterior) == pytest.approx(outside, abs=0.001)
    assert steps.distortion(interior) == pytest.approx(inside, abs=0.002)


@pytest.mark.parametrize(("name", "first"), [(LION, 2.95e-3), (FACE, 1.10e-2), (BRAIN, 6.66e-2)])
def test_the_error_of_the_trace_is_in_the_first_negative_power(name, first, steps_of):
    """Coefficients of the trace in powers of zeta, the exterior map of its curve."""
    steps = steps_of(name)
    zeta = 1 / geodesic_map(whiten_trace(steps.trace))
    arcs = -np.angle(np.roll(zeta, -1) / zeta)

    def coefficient(k):
        values = steps.trace * zeta**-k
        return ((values + np.roll(values, -1)) / 2 * arcs).sum() / (2 * np.pi)

    b = np.array([abs(coefficient(-k)) for k in (1, 2, 3, 4)]) / abs(coefficient(1))
    assert b[0] == pytest.approx(first, rel=0.01)
    assert b[0] == b.max()
    assert b[1:].max() < 3e-3


@pytest.mark.parametrize(("name", "inside"), [(LION, 17.05), (FACE, 17.89), (BRAIN, 7.69)])
def test_only_the_boundary_values_of_the_pinned_solution_are_of_use(name, inside, steps_of):
    steps = steps_of(name)
    free = np.delete(np.arange(len(steps.mesh.V)), steps.mesh.loop[0])
    h = np.zeros(len(steps.mesh.V), complex)
    L, r = steps.surface.laplacian.matrix(), face_dipole(steps.mesh, steps.face)
    h[free] = spsolve(L[free][:, free].tocsc(), r[free])
    degrees = np.degrees(abs(angle_errors(steps.mesh, h)))
    assert degrees.mean() == pytest.approx(inside, abs=0.01)
    assert steps.distortion(geodesic_map(steps.trace)) < 0.2 * degrees.mean()


@pytest.mark.parametrize(
    ("name", "faces", "before", "after"), [(LION, 1.5, 52.0, 50.7), (BRAIN, 0.26, 5.9, 6.2)]
)
def test_what_refinement_leaves_lies_at_the_boundary(name, faces, before, after, real_mesh, map_of):
    """Faces with a boundary vertex: their share of all faces, and of the squared errors, in %."""
    V, F = real_mesh(name)
    at_boundary = np.isin(F, DiskMesh(V, F).loop).any(axis=1)
    assert 100 * at_boundary.mean() == pytest.approx(faces, rel=0.1)
    for result, share in ((map_of(name), before), (map_of(name, refine=5), after)):
        squares = angle_distortion(V, F, result.uv) ** 2
        assert 100 * squares[at_boundary].sum() / squares.sum() == pytest.approx(share, abs=0.5)
