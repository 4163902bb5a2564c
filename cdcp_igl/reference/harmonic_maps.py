"""Harmonic maps made conformal, or even in area: in turn with the boundary, or by diffusion."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import diags

from ..arrays import Complex, Floats
from ..docstrings import like
from ..errors import MapError
from ..io.given import takes_meshes
from ..solve.laplacian import Laplacian, cotangent_laplacian, sum_opposite
from ..starts.boundary import arc_length_map
from ..steps.mobius import conformal_barycenter, mobius_transformation
from ..surface.mesh import DiskMesh, Mesh
from ..surface.triangles import face_areas, opposite_edges, twice_areas, vertex_areas
from .certified import certified_disk_map
from .dirichlet import Dirichlet, harmonic
from .doubled import doubled_laplacian
from .linear import most_regular_face, to_cube_roots_of_unity

TOLERANCE = 1e-9  # of what a round takes from the conformal energy; the disk has area pi
MAX_ROUNDS = 500  # the Chinese Lion takes 230

STRETCH_ROUNDS = 10  # then the energy of the Chinese Lion is 0.02 % above that of equal areas

TIME_STEP = 1.0  # of the flow; the sheet has the area of the hemisphere
FLOW_TOLERANCE = 1e-8  # of what a step takes from the harmonic energy, near that area, 2 pi
FLOW_STEPS = 200  # the Chinese Lion takes 5


@takes_meshes
@like(harmonic)
def cem(V: ArrayLike, F: ArrayLike) -> Floats:
    """Map a triangulated disk conformally onto the unit disk, Yueh, Lin, Wu and Yau 2017.

    Conformal energy is Dirichlet energy minus area. For a given boundary, the interior minimises
    it; for the interior reflected at the circle, the boundary does. That is then centred and
    pushed back onto the circle, and so in turn until the energy falls no more. MapError if there is
    no interior vertex, or if the energy still falls after 500 rounds.

    References
    ----------
    M.-H. Yueh, W.-W. Lin, C.-T. Wu, S.-T. Yau. An efficient energy minimization for conformal
    parameterizations. J. Sci. Comput. 73, 2017.
    """
    mesh = _with_interior(V, F)
    # A vertex that comes to 0 is reflected to infinity; the energy says so.
    with np.errstate(divide="ignore", invalid="ignore"):
        return certified_disk_map(mesh, _cem(mesh))


def _with_interior(V: ArrayLike, F: ArrayLike) -> Mesh:
    mesh = DiskMesh(V, F)
    if not len(mesh.interior):
        raise MapError("There is no interior vertex from which the boundary could follow")
    return mesh


def _cem(mesh: Mesh) -> Complex:
    B, I = mesh.loop, mesh.interior  # noqa: E741
    L = cotangent_laplacian(mesh).matrix()
    interior_problem, boundary_problem = Dirichlet(L, B), Dirichlet(L, I)

    def conformal_energy(f: Complex) -> float:
        area = (f[B].conj() * np.roll(f[B], -1)).imag.sum() / 2
        return float(np.vdot(f, L @ f).real / 2 - area)

    f = interior_problem.solve(arc_length_map(mesh))
    energy = conformal_energy(f)
    for _ in range(MAX_ROUNDS):
        f = _in_turn(mesh, f, boundary_problem, interior_problem)
        before, energy = energy, conformal_energy(f)
        if not before - energy > TOLERANCE:
            return f / f[B[0]]
    raise MapError(f"The conformal energy still falls after {MAX_ROUNDS} rounds")


def _in_turn(mesh: Mesh, f: Complex, boundary: Dirichlet, interior: Dirichlet) -> Complex:
    """Let the boundary of a map (n,) follow the reflected interior, and the interior follow it."""
    B, I = mesh.loop, mesh.interior  # noqa: E741
    f_B = boundary.solve(f[I] / abs(f[I]) ** 2)[B]
    f_B -= f_B.mean()
    return interior.solve(f_B / abs(f_B))


@takes_meshes
@like(harmonic)
def sem(V: ArrayLike, F: ArrayLike) -> Floats:
    """Map a triangulated disk onto the unit disk, areas kept, Yueh, Lin, Wu and Yau 2019.

    The stretch energy is the sum of squared areas in the image by those on the surface. It is a
    Dirichlet energy with the cotangents of the image, each face weighted by how much it has grown:
    a map is harmonic for these weights, in turn with the boundary as in `cem`, and the weights are
    those of the map. Ten rounds, while the energy falls. MapError if there is no interior
    vertex.

    References
    ----------
    M.-H. Yueh, W.-W. Lin, C.-T. Wu, S.-T. Yau. A novel stretch energy minimization algorithm for
    equiareal parameterizations. J. Sci. Comput. 78, 2019.
    """
    mesh = _with_interior(V, F)
    with np.errstate(divide="ignore", invalid="ignore"):
        f = _sem(mesh)
        return certified_disk_map(mesh, f / f[mesh.loop[0]])


def _sem(mesh: Mesh) -> Complex:
    area, low, high = face_areas(mesh.scaled, mesh.F), mesh.edges.low, mesh.edges.high

    def energy(f: Complex) -> float:
        return float((twice_areas(opposite_edges(f[mesh.F])) ** 2 / area).sum())

    f = Dirichlet(cotangent_laplacian(mesh).matrix(), mesh.loop).solve(arc_length_map(mesh))
    for _ in range(STRETCH_ROUNDS):
        e = opposite_edges(f[mesh.F])
        # Cotangents of the image, by its areas, times these by those on the surface.
        weights = -(e[:, [1, 2, 0]] * e[:, [2, 0, 1]].conj()).real / area[:, None]
        L = Laplacian.of(low, high, sum_opposite(mesh.edges, weights), len(f)).matrix()
        next_f = _in_turn(mesh, f, Dirichlet(L, mesh.interior), Dirichlet(L, mesh.loop))
        if not energy(next_f) < energy(f):
            break
        f = next_f
    return f


@takes_meshes
@like(harmonic)
def heat_flow(V: ArrayLike, F: ArrayLike) -> Floats:
    """Map a triangulated disk conformally onto the unit disk, by the heat flow of Gu and Yau 2002.

    The doubly covered surface is mapped to the sphere, at first by a linear problem with one face
    around the point at infinity (Haker et al. 2000), then by the flow that lowers the harmonic
    energy: dh/dt is the part of -L h that is tangential to the sphere. A harmonic map of the sphere
    to the sphere is conformal. Steps are implicit; after each one a Möbius transformation brings
    back the centre of mass, here that of the disk in the equator's plane.

    The start and so all that follows is symmetric at the equator, on which the boundary lies. One
    sheet is enough: nothing of x and y flows through the boundary, and z is 0 there. MapError if
    the energy still falls after 200 steps.

    References
    ----------
    X. Gu, S.-T. Yau. Computing conformal structures of surfaces. Commun. Inf. Syst. 2(2), 2002.

    S. Haker, S. Angenent, A. Tannenbaum, R. Kikinis, G. Sapiro, M. Halle. Conformal surface
    parameterization for texture mapping. IEEE Trans. Vis. Comput. Graph. 6(2), 2000.
    """
    mesh = DiskMesh(V, F)
    B = mesh.loop
    L = cotangent_laplacian(mesh).matrix()
    mass = vertex_areas(mesh.scaled, mesh.F)
    mass *= 2 * np.pi / mass.sum()
    diffusion = diags(mass / TIME_STEP, format="csr") + L
    even, odd = Dirichlet(diffusion, B[:0]), Dirichlet(diffusion, B)
    nothing = np.zeros(len(B))

    corners, triangle = most_regular_face(mesh)
    f_B = to_cube_roots_of_unity(Dirichlet(doubled_laplacian(mesh, L), corners).solve(triangle)[B])
    f = Dirichlet(L, B).solve(f_B / abs(f_B))
    energy = np.inf
    for _ in range(FLOW_STEPS):
        f = mobius_transformation(f, conformal_barycenter(f, mass))
        f[B] /= abs(f[B])
        w, z = _to_hemisphere(f)
        flow_w, flow_z = -L @ w, -L @ z
        flow_z[B] = 0
        outwards = (flow_w * w.conj()).real + flow_z * z
        before, energy = energy, -outwards.sum() / 2
        if not before - energy > FLOW_TOLERANCE:
            return certified_disk_map(mesh, f / f[B[0]])
        w += even.solve(nothing[:0], flow_w - outwards * w)
        z += odd.solve(nothing, flow_z - outwards * z).real
        f = w / (np.hypot(abs(w), z) + z)  # from the south pole, once |w|^2 + z^2 is 1 again
    raise MapError(f"The harmonic energy still falls after {FLOW_STEPS} steps")


def _to_hemisphere(f: Complex) -> tuple[Complex, Floats]:
    """Project the disk from the south pole: x + iy and z of points on the sphere."""
    squared = abs(f) ** 2
    return 2 * f / (1 + squared), (1 - squared) / (1 + squared)
