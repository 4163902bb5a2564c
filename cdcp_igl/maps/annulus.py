"""A surface with two boundary loops, mapped conformally onto a ring between two circles."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from functools import partial

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from ..arrays import Complex, Floats, marked
from ..descent.placing import judged
from ..descent.preconditioning import WeightedLaplacian
from ..descent.repair import repair_locally, repairable
from ..descent.targets import Ring
from ..docstrings import like
from ..errors import Defect, MeshError
from ..io.given import takes_meshes
from ..options import Options
from ..phases import Phases, Progress
from ..result.annulus_map import AnnulusMap
from ..result.base import announced
from ..solve.factored import FactoredSurface
from ..solve.solvers import SolverName, using
from ..steps.circle import Rejected
from ..steps.trace import shared_by_edges
from ..surface.filling import fill_hole, with_middle
from ..surface.mesh import AnnulusMesh, Mesh
from ..surface.topology import Topology, by_reach
from ..surface.validation import checked_surface
from ..verdict.certificate import certify_ring
from ..verdict.distortion import map_distortion
from .disk import disk_map
from .problem import OnTarget, Problem, Start, solve
from .rings import embedded_ring

LEAST_SHARE, FAIR_SHARE = 1e-9, 1e-7  # of a turn, for each edge of a loop; faces then have an area


@takes_meshes
@like(disk_map)
def annulus_map(
    V: ArrayLike,
    F: ArrayLike,
    *,
    refine: int | None = None,
    refine_norm: float = 1.5,
    refine_seconds: float = np.inf,
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
    F : (m, 3) array_like of integers
        Corners of the faces, counterclockwise seen from outside.
    refine : int or None
        As in `disk_map`; the inner circle moves, too.

    Returns
    -------
    AnnulusMap

    Raises
    ------
    MeshError
        If the surface is closed, has one boundary loop, a handle or several components, or is no
        mesh; or if all three corners of a face, or both ends of an edge inside, lie on the loop
        that goes to the inner circle: it would lie inside of that.
    MapError
        If the map is no bijection; it is the ``result``.

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
    options = Options(
        refine=refine, refine_norm=refine_norm, refine_seconds=refine_seconds, solver=solver
    )
    phase = Phases(progress, refine or 0, skipped=("center", "circle", "extension", "mobius"))
    with using(solver):
        with phase("check"):
            mesh, (n, m), filled = _filled(V, F)
            inner = marked(len(mesh.scaled), mesh.loops[1])
            if len(rows := np.flatnonzero(inner[mesh.F].all(axis=1))):
                raise MeshError(Defect.of("face on the inner circle", rows))
            if len(across := mesh.edges.ends(mesh.edges.chords(inner))):
                raise MeshError(Defect.of("edge across the inner circle", across))
        return announced(solve(RingProblem(mesh, (n, m), filled, options, phase)))


class RingProblem(Problem[AnnulusMap]):
    """A surface with two boundary loops onto a ring.

    `size` are the numbers of vertices and faces that were given, `filled` of holes that were not.
    """

    onto = " onto the ring"
    remedy = (
        "Parts of it may be too small for double precision: cut the surface, or fill a hole "
        "(cdcp_igl.surface_map)"
    )
    mesh: AnnulusMesh

    def __init__(
        self, mesh: AnnulusMesh, size: tuple[int, int], filled: int, options: Options, phase: Phases
    ) -> None:
        super().__init__(mesh, options, phase)
        self._size, self._filled = size, filled
        with phase("factor"):
            self.surface = FactoredSurface.of(mesh)
        with phase("trace"):
            self._strip, self._bounds = ring_map(self.surface)

    def starts(self) -> Iterator[Start[AnnulusMap]]:
        """Yield the map by the flux, and the one in which no edge has too little of it."""
        yield partial(self._placed, self._strip, "flux")
        fair, _ = ring_map(self.surface, least=FAIR_SHARE)
        if not np.array_equal(fair, self._strip):
            yield partial(self._placed, fair, "flux")

    def tutte_starts(self, best: AnnulusMap) -> Iterator[Start[AnnulusMap]]:
        """Yield the map from the embedding of a disk in which the hole is filled."""
        with suppress(MeshError, Rejected):
            strip = np.log(embedded_ring(self.mesh))
            yield partial(self._placed, strip, "arc length, hole filled")

    def needs_no_other_start(self, made: AnnulusMap) -> bool:
        """Whether no Tutte embedding may lead nearer to the conformal map."""
        return made.is_acceptable or (made.valid and self.options.refine == 0)

    def _placed(self, strip: Complex, boundary: str, known: float = 0.0) -> AnnulusMap:
        """Turn a map to a strip (n,), roll it up; repair, certify and judge it."""
        mesh, bounds = self.mesh, self._bounds
        with self.phase("repair"):
            f = np.exp(strip - 1j * strip.imag[mesh.loops[0][0]])
            f, repair = repair_locally(mesh, f, repairable(mesh))
        with self.phase("certificate"):
            degrees, certificate = map_distortion(mesh, f), certify_ring(mesh, f)
            fields = judged(mesh, f, degrees, certificate, repair, known)
        return AnnulusMap(
            **fields,
            _f=f,
            modulus=float(np.sqrt(bounds[0] * bounds[1])),
            modulus_bounds=bounds,
            radius=float(abs(f[mesh.loops[1]]).mean()),
            boundary=boundary,
            filled=self._filled,
            solver=self.surface.solver,
            timings=self.phase.seconds,
            _size_given=self._size,
        )

    def on_target(self, made: AnnulusMap) -> OnTarget:
        """Return a map as descent sees it: the logarithm, whose circles are straight."""
        laplacian = WeightedLaplacian(self.mesh, self.surface.order)
        return OnTarget(Ring(), np.log(made._f), laplacian)

    def moved(self, made: AnnulusMap, f: Complex, known: float) -> AnnulusMap:
        """Return what descent made of a map."""
        return self._placed(f, made.boundary, known)


def _filled(V: ArrayLike, F: ArrayLike) -> tuple[AnnulusMesh, tuple[int, int], int]:
    """Fill all loops but the two that reach farthest; the vertices and faces given, and loops."""
    positions, faces = checked_surface(V, F)
    size = np.asarray(V).shape[0], len(faces)
    topology = Topology(faces, len(positions))
    loops = by_reach(positions, topology.loops)
    if len(loops) <= 2:
        return AnnulusMesh(V, F), size, 0
    corners, filling = np.asarray(V, dtype=np.float64), [faces]
    for loop in loops[2:]:
        if (patch := fill_hole(positions, topology, loop)) is not None:
            if patch.max() == len(corners):
                corners = with_middle(corners, corners[loop])
                positions = with_middle(positions, positions[loop])
            filling.append(patch)
    return AnnulusMesh(corners, np.vstack(filling)), size, len(filling) - 1


def ring_map(
    surface: FactoredSurface, *, least: float = LEAST_SHARE
) -> tuple[Complex, tuple[float, float]]:
    """Map an annulus to a strip (n,), the logarithm of a ring around 0; bounds of its modulus.

    The angles on the loops are what flows through them.

    As much flows through the real part as around it, 2 pi, so that far from the loops there is no
    shear. The mean of the bounds of the modulus would lay a loop's errors on the whole surface.
    """
    mesh, L = surface.mesh, surface.laplacian
    one = marked(len(mesh.scaled), mesh.loops[1]).astype(float)
    u = one - surface.solve(L.matrix() @ one)
    flux = L.matrix() @ u
    energy = float(u @ flux)
    starts, jump = _branch_cut(mesh)
    angle, forwards = _loop_angles(mesh, starts, flux, least)
    if not forwards:  # through edges of obtuse faces
        D = surface.delaunay.laplacian.matrix()
        flux = D @ (one - surface.delaunay.solve(D @ one))
        angle, _ = _loop_angles(mesh, starts, flux, least)
    flow = L.weights * (angle[L.high] - angle[L.low] + jump)
    sources = np.bincount(L.high, flow, len(u)) - np.bincount(L.low, flow, len(u))
    angle -= surface.solve(sources.astype(np.float64))
    # The inner circle may be turned against the outer one: as the energy is least.
    change = u[L.high] - u[L.low]
    angle -= (L.weights * change) @ (angle[L.high] - angle[L.low] + jump) / energy * u
    turns = (angle[L.high] - angle[L.low] + jump) / (2 * np.pi)
    bounds = 1 / energy, float(L.weights @ turns**2)
    return -2 * np.pi / energy * u + 1j * angle, bounds


def _loop_angles(mesh: Mesh, starts: list[int], flux: Floats, least: float) -> tuple[Floats, bool]:
    """Angles (n,) along both loops by the flux (n,); whether all go forward.

    The inner loop runs clockwise.
    """
    angle, forwards = np.zeros(len(mesh.scaled)), True
    for loop, first, turn in zip(mesh.loops, starts, (2 * np.pi, -2 * np.pi), strict=True):
        shares = shared_by_edges(mesh, loop, flux[loop])
        shares = shares / shares.sum()
        forwards &= bool((shares > 0).all())
        start = -int(np.flatnonzero(loop == first)[0])
        shares = np.roll(np.maximum(shares, least), start)
        passed = np.append(0, np.cumsum(shares[:-1])) / shares.sum()
        angle[np.roll(loop, start)] = turn * passed % (2 * np.pi)
    return angle, forwards


def _branch_cut(mesh: Mesh) -> tuple[list[int], Floats]:
    """Cut the angle through a strip of faces, from loop to loop.

    Returns where it is 0 on either loop, and (e,) by what it jumps along edges, from low to high.
    """
    m, edges = len(mesh.F), mesh.edges
    tail, head = mesh.F.T.ravel(), np.roll(mesh.F, -1, axis=1).T.ravel()
    one, other = (sides.astype(np.int64) for sides in edges.twins)
    # The half-edge of the first face that leads to the second one; 0 is none.
    rows, columns = np.append(one, other) % m, np.append(other, one) % m
    leads = csr_matrix((np.append(one, other) + 1, (rows, columns)), (m, m))
    border = edges.border.astype(np.int64)
    outer, inner = (border[np.isin(tail[border], loop)] for loop in mesh.loops)
    distance, before, _ = dijkstra(
        leads, indices=outer % m, unweighted=True, min_only=True, return_predecessors=True
    )
    last = int(inner[distance[inner % m].argmin()])
    strip = [last % m]
    while before[strip[-1]] >= 0:
        strip.append(int(before[strip[-1]]))
    first = int(outer[outer % m == strip[-1]][0])
    turns = np.zeros(3 * m)
    turns[np.append(last, leads[strip[1:], strip[:-1]] - 1)] = -2 * np.pi
    turns[np.append(first, leads[strip[:-1], strip[1:]] - 1)] = 2 * np.pi
    side = edges.sides[edges.start]
    jump = np.where(tail[side] == edges.low, turns[side], -turns[side])
    return [int(head[first]), int(tail[last])], jump
