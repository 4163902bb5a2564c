"""Discrete conformal equivalence: the triangles scaled at their vertices until they are flat."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .. import libigl
from ..arrays import Floats, Ints, places
from ..docstrings import like
from ..errors import MapError, counted
from ..io.given import takes_meshes
from ..solve.laplacian import cotangent_laplacian
from ..steps.mobius import normalize
from ..surface.mesh import DiskMesh, Mesh
from .certified import certified_disk_map
from .dirichlet import Dirichlet, harmonic
from .free_boundary import least_squares_layout

TOLERANCE = 1e-9  # of what the angles around a vertex lack, in radians
MAX_STEPS = 100  # the Chinese Lion takes 12
SHORTEST = 1e-6  # step of Newton's method, by the whole step
DELAUNAY = 0.1  # weight of an edge that stays Delaunay, as the angles change by a few degrees
BROKEN = 0.01  # what stands for the Hessian of faces without area, which is 0, by that at u = 0


@takes_meshes
@like(harmonic)
def ricci(V: ArrayLike, F: ArrayLike) -> Floats:
    """Map a triangulated disk onto the unit disk, discretely conformally (Springborn et al. 2008).

    Two meshes are discretely conformally equivalent if their edges are as l_ij and
    exp((u_i + u_j) / 2) l_ij. Inversions keep that, and so a boundary vertex k is sent to infinity:
    the surface is inverted in a sphere around it, where the rest is to be mapped to the upper
    half-plane. Its boundary has to become straight but for the neighbours of k, whose lengths are
    right already. The u of such a metric minimise a convex energy, by Newton's method: this is
    discrete Ricci flow, without the flow. Laid out, the half-plane becomes the disk, and k returns.

    Edges are not flipped. There may be no such map then: MapError if Newton's method does not
    converge, if faces break the triangle inequality, or if each boundary vertex has an edge through
    the interior to another.

    References
    ----------
    B. Springborn, P. Schröder, U. Pinkall. Conformal equivalence of triangle meshes. ACM Trans.
    Graph. 27(3), 2008.

    M. Jin, J. Kim, F. Luo, X. Gu. Discrete surface Ricci flow. IEEE Trans. Vis. Comput. Graph.
    14(5), 2008.
    """
    mesh = DiskMesh(V, F)
    n, k = len(mesh.scaled), _sent_to_infinity(mesh)
    kept, at_k = np.delete(np.arange(n), k), np.equal(mesh.F, k).any(axis=1)
    offset = mesh.scaled[kept] - mesh.scaled[k]
    inverted = offset / (offset**2).sum(axis=1, keepdims=True)
    place = places(kept, n)
    rest = DiskMesh(inverted, place[mesh.F[~at_k]])
    link = place[np.setdiff1d(mesh.F[at_k], [k])]

    z = least_squares_layout(rest, _flat_angles(rest, link))
    after, before = place[np.roll(mesh.loop, -mesh.loop_index[k])[[1, -1]]]
    z = (z - z[after]) / (z[before] - z[after])
    middle = complex(np.median(z.real), np.median(z.imag))
    f = np.ones(n, dtype=complex)
    f[kept] = (z - middle) / (z - middle.conjugate())
    f[mesh.loop] /= abs(f[mesh.loop])  # it is on the circle but for rounding
    f, _ = normalize(mesh, f / f[mesh.loop[0]], "angle")
    return certified_disk_map(mesh, f)


def _sent_to_infinity(mesh: Mesh) -> int:
    """Choose the widest boundary vertex without chords that seems to lie in no circumcircle.

    The inversion there would turn that face over; of faces next to its own, cotangents tell.
    """
    edges, n = mesh.edges, len(mesh.scaled)
    opposite = np.empty(3 * len(mesh.F))
    opposite[edges.sides] = np.repeat(cotangent_laplacian(mesh).weights, edges.valence)
    least = np.full(n, np.inf)
    np.minimum.at(least, mesh.F.T, np.roll(opposite.reshape(3, -1), -1, axis=0))
    possible = mesh.on_boundary & (least > DELAUNAY)
    possible[edges.ends(edges.chords(mesh.on_boundary))] = False
    if not possible.any() or not len(mesh.interior):
        raise MapError("Discrete conformal equivalence: no boundary vertex can go to infinity")
    around = np.bincount(mesh.F.ravel(), mesh.angles.ravel())
    return int(np.where(possible, around, 0).argmax())


def _flat_angles(mesh: Mesh, fixed: Ints) -> Floats:
    """(m, 3) angles of the flat metric with a straight boundary, but at vertices where u is 0."""
    n = len(mesh.scaled)
    length = np.sqrt(libigl.squared_edge_lengths(mesh.scaled, mesh.F))
    target = np.where(mesh.on_boundary, np.pi, 2 * np.pi)

    def angles_and_gradient(u: Floats) -> tuple[Floats, Floats]:
        at = u[mesh.F]
        # The angles need no size: exp(-u_k / 2) for the edge opposite k does, up to a factor.
        angles = angles_of_lengths(length * np.exp((at.min(axis=1, keepdims=True) - at) / 2))
        gradient: Floats = target - np.bincount(mesh.F.ravel(), angles.ravel(), n)
        gradient[fixed] = 0
        return angles, gradient

    u = np.zeros(n)
    angles, gradient = angles_and_gradient(u)
    for _ in range(MAX_STEPS):
        broken = (angles == 0).any(axis=1)
        if abs(gradient).max() < TOLERANCE:
            break
        cotangents = BROKEN * mesh.cotangents
        cotangents[~broken] = 1 / np.tan(angles[~broken])
        hessian = cotangent_laplacian(mesh, cotangents).matrix()
        newton = Dirichlet(hessian, fixed).solve(np.zeros(len(fixed)), -gradient).real
        step, slope = 1.0, abs(gradient @ newton)
        angles, gradient = angles_and_gradient(u + newton)
        while abs(gradient @ newton) > slope and step > SHORTEST:
            step /= 2
            angles, gradient = angles_and_gradient(u + step * newton)
        u += step * newton
    else:
        raise MapError(f"Discrete conformal equivalence: not flat after {MAX_STEPS} steps")
    if broken.any():
        count = counted(broken.sum(), "face breaks", "faces break")
        raise MapError(f"Discrete conformal equivalence: flat, {count} the triangle inequality")
    return angles


def angles_of_lengths(length: Floats) -> Floats:
    """(m, 3) angles opposite the sides (m, 3); 0, 0 and pi if a side is too long for the others."""
    a, b, c = length.T
    p, q, r = np.maximum([b + c - a, c + a - b, a + b - c], 0)
    s = a + b + c
    return 2 * np.arctan2(np.sqrt([q * r, r * p, p * q]), np.sqrt([s * p, s * q, s * r])).T
