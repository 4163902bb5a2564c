"""A surface with two boundary loops, mapped conformally onto a ring between two circles."""

from __future__ import annotations

import logging
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse.csgraph import dijkstra

from . import libigl
from .arrays import Complex, Floats, Ints, as_complex, coordinates, marked
from .cached import cached_property
from .certificate import Certificate, around, not_finite
from .distortion import AngleDistortion, angle_errors
from .errors import MapError, counted
from .io.given import takes_meshes
from .plot.layout import Layout
from .rescue.conformality import NOT_VALID, Conformality, judge
from .rescue.repair import Repair, repair_locally
from .result.bijection import Bijection
from .solve.factored import FactoredSurface
from .solve.solvers import SolverName, using
from .steps.phases import Phases, Progress
from .steps.trace import shared_by_edges
from .surface.filling import fill_hole
from .surface.location import FaceFinder
from .surface.mesh import AnnulusMesh, DiskMesh
from .surface.topology import Topology, group_by_edge, tails
from .surface.triangles import flipped_faces
from .surface.validation import checked_surface

log = logging.getLogger("cdcp_igl")

LEAST_SHARE = 1e-9  # of a turn, for each edge of a loop


@dataclass(frozen=True, eq=False, repr=False)
class AnnulusMap(Bijection):
    """A conformal map onto a ring around 0. Printing it gives a summary.

    Attributes
    ----------
    uv : (n, 2) float64
        Row i is the image of row i of V, between the circles of radius `radius` and 1. The vertex
        of smallest index of the loop that reaches farthest lies at (1, 0).
    mesh : AnnulusMesh
        The surface; holes that were filled come last.
    modulus : float
        log(1 / radius) / (2 pi), a conformal invariant of the surface: of a cylinder, its length
        by its circumference.
    modulus_bounds : (float, float)
        Between which the modulus of the polyhedral surface lies, but for rounding: the logarithm
        of the radius and the angle are trial functions in Dirichlet's principle. `modulus` is
        their geometric mean.
    radius : float
        Of the inner circle.
    filled : int
        Boundary loops beyond two that were filled; those faces are not in the results.
    certificate : Certificate
        As of a `DiskMap`, with both circles in place of one: errors are relative to the radius.
    distortion : AngleDistortion
        Mean, SD and maximum of the angular distortion in degrees.
    conformality : Conformality
        Whether the map is what a conformal map of this mesh should be; if not, the reasons
        and what would help.
    repair : Repair
        What was done about flipped faces.
    solver : str
        Sparse solver, version, ordering and mode.
    timings : dict of str to float
        Seconds per phase.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.spherical_cap(10)
    >>> cdcp_igl.annulus_map(V[1:], F[F.min(axis=1) > 0] - 1).filled
    0
    """

    uv: Floats
    mesh: AnnulusMesh
    modulus: float
    modulus_bounds: tuple[float, float]
    radius: float
    filled: int
    certificate: Certificate
    distortion: AngleDistortion
    conformality: Conformality
    repair: Repair
    solver: str
    timings: dict[str, float]
    _whole: Floats  # with the images of vertices that fill holes
    _n_faces: int

    _kind = "annulus"

    def packed(self) -> Floats:
        """Return the square around the ring, scaled to the unit square: texture coordinates."""
        return (self.uv + 1) / 2

    def _subject(self) -> str:
        return f"{len(self.uv):,} vertices"

    def _key_figure(self) -> str:
        return f"modulus {self.modulus:.6g}"

    def _steps(self) -> list[tuple[str, str]]:
        low, high = self.modulus_bounds
        filled = [("change", f"filled {counted(self.filled, 'hole', 'holes')}")]
        return [
            ("modulus", f"{self.modulus:.8g}, from {low:.8g} to {high:.8g}"),
            ("inner radius", f"{self.radius:.6g}"),
            *(filled if self.filled else []),
            ("repair", str(self.repair)),
            ("solver", self.solver),
        ]

    def _details(self) -> dict[str, Any]:
        return {
            "modulus": self.modulus,
            "modulus_bounds": list(self.modulus_bounds),
            "radius": self.radius,
            "filled": self.filled,
            "repair": asdict(self.repair),
            "solver": self.solver,
        }

    def _surface(self) -> tuple[Floats, Ints]:
        return self.mesh.positions[: len(self.uv)], self._faces

    @property
    def _images(self) -> Floats:
        return self._whole

    @property
    def _faces(self) -> Ints:
        return self.mesh.F[: self._n_faces]

    @cached_property
    def _finder(self) -> FaceFinder:
        # Triangles around 0 make a disk of the ring.
        clockwise, middle = self.mesh.loops[1], len(self.mesh.V)
        around = [np.roll(clockwise, -1), clockwise, np.full(len(clockwise), middle)]
        F = np.vstack([self.mesh.F, np.column_stack(around)])
        edges = group_by_edge(tails(F, middle + 1), middle + 1)
        return FaceFinder(F, edges, np.append(as_complex(self._images), 0), self._n_faces)

    def _layout(self) -> Layout:
        n, m = len(self.uv), self._n_faces
        return Layout(
            V=self.mesh.V[:n],
            F=self._faces,
            uv=self.uv,
            vertices=np.arange(n),
            faces=np.arange(m),
            plane="Ring",
            middle=(0.0, 0.0),
            scale=1.0,
            origin=(0.5, 0.5),
            distortion=self.distortion,
            flipped=len(self.certificate.flipped),
            facts=self._facts(self._subject(), f"modulus {self.modulus:.6g}"),
        )


@takes_meshes
def annulus_map(
    V: ArrayLike,
    F: ArrayLike,
    *,
    solver: SolverName | None = None,
    progress: Progress | None = None,
) -> AnnulusMap:
    """Map a triangulated surface with two boundary loops conformally onto a ring.

    The loop that reaches farthest goes to the unit circle, the next one to the inner circle, whose
    radius is found with the map; other loops are filled for the time of the map. The logarithm of
    the radius is the harmonic function that is constant on both loops, the angle its conjugate:
    on the loops it is what flows through them, inside it is harmonic, too. Both have one factor.

    Parameters
    ----------
    V : (n, 3) or (n, 2) array_like of real numbers
        Vertex positions, in any unit.
    F : (m, 3) array_like of integers
        Corners of the faces, counterclockwise seen from outside.
    solver, progress
        As in `disk_map`.

    Returns
    -------
    AnnulusMap

    Raises
    ------
    MeshError
        If the surface is closed, has one boundary loop, a handle or several components, or is no
        mesh.
    MapError
        If the map is no bijection; it is the ``result``.
    SolverError
        If the Laplacian cannot be factored.
    ImportError
        If the solver that was asked for is not installed.

    References
    ----------
    L. V. Ahlfors. Conformal Invariants. McGraw-Hill, 1973. Chapter 4.
    H. Hakula, A. Rasila, M. Vuorinen. On moduli of rings and quadrilaterals: algorithms and
    experiments. SIAM J. Sci. Comput. 33(1), 2011.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.spherical_cap(20)
    >>> result = cdcp_igl.annulus_map(V[1:], F[F.min(axis=1) > 0] - 1)
    >>> low, high = result.modulus_bounds
    >>> result.valid, low < result.modulus < high
    (True, True)
    """
    phase = Phases(progress, skipped=("center", "circle", "mobius", "refine"))
    with using(solver):
        with phase("check"):
            mesh, (n, m), filled = _filled(V, F)
        with phase("factor"):
            surface = FactoredSurface.of(mesh)
        with phase("trace"):
            f, bounds = ring_map(surface)
        with phase("repair"):
            f, repair = repair_locally(mesh, f)
        with phase("certificate"):
            modulus = float(np.sqrt(bounds[0] * bounds[1]))
            radius = float(np.exp(-2 * np.pi * modulus))
            certificate = certify_ring(mesh, f, radius)
            degrees = np.degrees(abs(angle_errors(mesh, f)))
            closely = repair.n_flipped > 0
            verdict = judge(mesh, f, degrees, closely=closely) if certificate.valid else NOT_VALID
    result = AnnulusMap(
        uv=coordinates(f)[:n],
        mesh=mesh,
        modulus=modulus,
        modulus_bounds=bounds,
        radius=radius,
        filled=filled,
        certificate=certificate,
        distortion=AngleDistortion.of(degrees[:m]),
        conformality=verdict,
        repair=repair,
        solver=surface.solver,
        timings=phase.seconds,
        _whole=coordinates(f),
        _n_faces=m,
    )
    if not result.valid:
        raise MapError(f"The map is not a bijection onto the ring: {certificate}", result)
    if not result.conformal:
        log.warning("the map is not conformal: %s", "; ".join(verdict.reasons))
    phase.done()
    return result


def _filled(V: ArrayLike, F: ArrayLike) -> tuple[AnnulusMesh, tuple[int, int], int]:
    """Fill all loops but the two that reach farthest; the vertices and faces given, and loops."""
    positions, faces = checked_surface(V, F)
    size = np.asarray(V).shape[0], len(faces)
    loops = Topology(faces, len(positions)).loops
    loops.sort(key=lambda loop: -float(np.linalg.norm(np.ptp(positions[loop], axis=0))))
    if len(loops) <= 2:
        return AnnulusMesh(V, F), size, 0
    corners, filling = np.asarray(V, dtype=np.float64), [faces]
    for loop in loops[2:]:
        if (patch := fill_hole(positions, loop)) is not None:
            if patch.max() == len(corners):
                corners = np.vstack([corners, corners[loop].mean(axis=0)])
                positions = np.vstack([positions, positions[loop].mean(axis=0)])
            filling.append(patch)
    return AnnulusMesh(corners, np.vstack(filling)), size, len(filling) - 1


def ring_map(surface: FactoredSurface) -> tuple[Complex, tuple[float, float]]:
    """Map an annulus to the plane (n,), and bound its modulus from below and from above."""
    mesh, L = surface.mesh, surface.laplacian.matrix()
    outer, inner = mesh.loops
    one = marked(len(mesh.V), inner).astype(float)
    u = one - surface.solve(L @ one)
    flux = L @ u
    energy = float(u @ flux)
    path, jump = _branch_cut(mesh, outer, inner)
    angle, forwards = _loop_angles(mesh, path, flux)
    if not forwards:  # through edges of obtuse faces
        D = surface.delaunay.laplacian.matrix()
        flux = D @ (one - surface.delaunay.solve(D @ one))
        angle, _ = _loop_angles(mesh, path, flux)
    low, high, weights = surface.laplacian.low, surface.laplacian.high, surface.laplacian.weights

    def sources(flow: Floats) -> Floats:
        n = len(mesh.V)
        return (np.bincount(high, flow, n) - np.bincount(low, flow, n)).astype(np.float64)

    angle -= surface.solve(sources(weights * (angle[high] - angle[low] + jump)))
    # The inner circle may be turned against the outer one: as the energy is least.
    difference = angle[high] - angle[low] + jump
    change = u[high] - u[low]
    turn = -float((weights * difference * change).sum()) / energy
    angle += turn * u
    difference += turn * change
    bounds = 1 / energy, float((weights * difference**2).sum()) / (2 * np.pi) ** 2
    angle -= angle[outer[0]]
    modulus = np.sqrt(bounds[0] * bounds[1])
    f: Complex = np.exp(-2 * np.pi * modulus * u + 1j * angle)
    return f, bounds


def _loop_angles(mesh: DiskMesh, path: Ints, flux: Floats) -> tuple[Floats, bool]:
    """Angles (n,) along both loops, by the flux (n,) through their edges; whether all go forward.

    The first vertex is that of the path, and the inner loop runs clockwise.
    """
    angle, forwards = np.zeros(len(mesh.V)), True
    for loop, first, turn in zip(mesh.loops, path[[0, -1]], (2 * np.pi, -2 * np.pi), strict=True):
        shares = shared_by_edges(mesh, loop, flux[loop])
        forwards &= bool((shares / shares.sum() > 0).all())
        shares = np.maximum(shares / shares.sum(), LEAST_SHARE)
        start = int(np.flatnonzero(loop == first)[0])
        passed = np.append(0, np.cumsum(np.roll(shares, -start)[:-1])) / shares.sum()
        angle[np.roll(loop, -start)] = turn * passed % (2 * np.pi)
    return angle, forwards


def _branch_cut(mesh: DiskMesh, outer: Ints, inner: Ints) -> tuple[Ints, Floats]:
    """Shortest path of edges from one loop to the other, and the jump of the angle along edges.

    Where an edge leaves the path to the left, the path counts as one turn farther.
    """
    distance, before, _ = dijkstra(
        libigl.adjacency_matrix(mesh.F),
        indices=outer,
        unweighted=True,
        min_only=True,
        return_predecessors=True,
    )
    path = [int(inner[distance[inner].argmin()])]
    while before[path[-1]] >= 0:
        path.append(int(before[path[-1]]))
    path.reverse()
    # Corners on either side of the path are grouped by crossing edges, but for those of the path.
    topology = Topology(mesh.F, len(mesh.V))
    tail, head = mesh.F.T.ravel(), np.roll(mesh.F, -1, axis=1).T.ravel()
    one, other = topology.twins
    place = np.full(len(mesh.V), -2)
    place[path] = np.arange(0, 2 * len(path), 2)
    across = abs(place[tail[one]] - place[head[one]]) != 2
    across |= (place[tail[one]] < 0) | (place[head[one]] < 0)
    count, fan = topology.fans_across(one[across], other[across])
    ahead = (place[head] - place[tail] == 2) & (place[tail] >= 0)  # the face on its left
    left = np.zeros(count, dtype=bool)
    left[fan[ahead]] = True
    left[np.roll(fan.reshape(3, -1), -1, axis=0).ravel()[ahead]] = True
    turns = np.where(place[tail] >= 0, left[fan], False).astype(float)
    along = np.roll(turns.reshape(3, -1), -1, axis=0).ravel() - turns
    side = mesh.edges.sides[mesh.edges.start]
    forwards = tail[side] == mesh.edges.low
    return np.array(path), 2 * np.pi * np.where(forwards, along[side], -along[side])


def certify_ring(mesh: AnnulusMesh, f: Complex, radius: float) -> Certificate:
    """Verify a map (n,) onto the ring, as `certify` does of one onto the disk."""
    if not np.isfinite(f).all():
        return not_finite(mesh)
    outer, inner = f[mesh.loops[0]], f[mesh.loops[1]][::-1] / radius
    turns, monotone = zip(around(outer), around(inner), strict=True)
    flipped, n_exact = flipped_faces(f, mesh.F)
    return Certificate(
        finite=True,
        boundary_error=float(abs(abs(np.append(outer, inner)) - 1).max()),
        boundary_monotone=all(monotone),
        winding_number=turns[0] if turns[0] != 1 else turns[1],
        flipped=flipped,
        n_exact=n_exact,
    )
