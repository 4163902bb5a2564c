"""A surface with two boundary loops, mapped conformally onto a ring between two circles."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from ..arrays import Complex, Floats, Ints, as_complex, coordinates, marked
from ..descent.targets import Ring
from ..docstrings import like
from ..errors import Defect, MeshError, counted
from ..io.given import takes_meshes
from ..options import Options
from ..phases import Phases, Progress
from ..plot.layout import Layout
from ..rescue.boundary import BoundaryMethod
from ..rescue.repair import repair_locally, repairable
from ..result.base import announced, how_made, valid_map
from ..result.making import MadeMap, best_of, fields_of, refined, steps_of
from ..solve.factored import FactoredSurface
from ..solve.solvers import SolverName, using
from ..steps.circle import Rejected
from ..steps.trace import shared_by_edges
from ..surface.filling import fill_hole, with_middle
from ..surface.mesh import AnnulusMesh, Mesh
from ..surface.topology import Topology, by_reach
from ..surface.validation import checked_surface
from ..verdict.certificate import Certificate, certify_ring
from ..verdict.distortion import map_distortion
from .disk import disk_map
from .rings import embedded_ring

EMBEDDED = "arc length, hole filled"
LEAST_SHARE, FAIR_SHARE = 1e-9, 1e-7  # of a turn, for each edge of a loop; faces then have an area
REMEDY = (
    "Parts of it may be too small for double precision: cut the surface, or fill a hole "
    "(cdcp_igl.surface_map)"
)


@dataclass(frozen=True, eq=False, repr=False)
class AnnulusMap(MadeMap):
    """A conformal map onto a ring around 0. Printing it gives a summary.

    Attributes
    ----------
    uv : (n, 2) float64
        Row i is the image of row i of V, between the circles of radius `radius` and 1; few corners
        of a hole may lie on one half of its circle, and vertices between that and their chords.
        The vertex of smallest index of the loop that reaches farthest lies at (1, 0).
    mesh : AnnulusMesh
        The surface; holes that were filled come last.
    modulus : float
        log(1 / inner radius) / (2 pi) of the exact map, a conformal invariant of the surface: of
        a cylinder, its length by its circumference.
    modulus_bounds : (float, float)
        Between which the modulus of the polyhedral surface lies, but for rounding: the logarithm
        of the radius and the angle are trial functions in Dirichlet's principle. `modulus` is
        their geometric mean.
    radius : float
        Of the inner circle. Its logarithm is near -2 pi times the modulus: such that all that flows
        through the one flows around the other, or as refinement has left it.
    boundary : str
        ``"flux"``: angles on the loops are what flows through them. Where that leaves flipped
        faces, or is not conformal even if refined, the outer loop begins by arc length, in an
        embedding of the disk that is there when the hole is filled: ``"arc length, hole filled"``.
        The best one is taken.
    filled : int
        Boundary loops beyond two that were filled; those faces are not in the results.
    certificate : Certificate
        As of a `DiskMap`, with both circles in place of one: errors are relative to the radius.
    conformality, distortion, repair, refinement, solver, timings
        As of a `DiskMap`.

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
    boundary: str
    filled: int
    certificate: Certificate
    _whole: Floats  # with the images of vertices that fill holes
    _n_faces: int

    _kind = "annulus"
    _plane = "Ring"
    _reported = ("modulus", "modulus_bounds", "radius", "filled")

    @property
    def is_embedded(self) -> bool:
        """Whether the map comes from an embedding of a disk."""
        return self.boundary == EMBEDDED

    def _made(self) -> dict[str, Any]:
        return how_made(self, BoundaryMethod(self.boundary), "none")

    def packed(self) -> Floats:
        """Return the square around the ring, scaled to the unit square: texture coordinates."""
        return (self.uv + 1) / 2

    def _key_figure(self) -> str:
        return f"modulus {self.modulus:.6g}"

    def _steps(self) -> list[tuple[str, str]]:
        low, high = self.modulus_bounds
        filled = [("change", f"filled {counted(self.filled, 'hole', 'holes')}")]
        return [
            ("modulus", f"{self.modulus:.8g}, from {low:.8g} to {high:.8g}"),
            ("inner radius", f"{self.radius:.6g}"),
            ("boundary", self.boundary),
            *(filled if self.filled else []),
            *super()._steps(),
        ]

    def _surface(self) -> tuple[Floats, Ints]:
        return self.mesh.positions[: len(self.uv)], self._faces

    @property
    def _faces(self) -> Ints:
        return self.mesh.F[: self._n_faces]

    def _layout(self) -> Layout:
        V = self.mesh.V[: len(self.uv)]
        return self._drawn(V, self._faces, self.uv, self._key_figure())


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
            inner = marked(len(mesh.V), mesh.loops[1])
            if len(rows := np.flatnonzero(inner[mesh.F].all(axis=1))):
                raise MeshError(Defect.of("face on the inner circle", rows))
            if len(across := mesh.edges.ends(mesh.edges.chords(inner))):
                raise MeshError(Defect.of("edge across the inner circle", across))
        with phase("factor"):
            surface = FactoredSurface.of(mesh)
        with phase("trace"):
            strip, bounds = ring_map(surface)

        def finished(strip: Complex, known: float = 0.0, *, boundary: str) -> AnnulusMap:
            with phase("repair"):
                f = np.exp(strip - 1j * strip.imag[mesh.loops[0][0]])
                f, repair = repair_locally(mesh, f, repairable(mesh))
            with phase("certificate"):
                certificate = certify_ring(mesh, f)
                degrees = map_distortion(mesh, f)
                fields = fields_of(mesh, f, degrees, certificate, repair, known=known)
            return AnnulusMap(
                **fields,
                uv=coordinates(f)[:n],
                modulus=float(np.sqrt(bounds[0] * bounds[1])),
                modulus_bounds=bounds,
                radius=float(abs(f[mesh.loops[1]]).mean()),
                boundary=boundary,
                filled=filled,
                solver=surface.solver,
                timings=phase.seconds,
                _whole=coordinates(f),
                _n_faces=m,
            )

        def lowered(name: str, strip: Complex) -> AnnulusMap:
            plain = finished(strip, boundary=name)
            if not (steps := steps_of(plain, options)):
                return plain
            f, again = np.log(as_complex(plain._whole)), partial(finished, boundary=name)
            return refined(plain, f, Ring(), surface.order, steps, again, options, phase)

        def enough(made: AnnulusMap) -> bool:
            return made.conformal or (made.valid and options.refine == 0)

        best = best_of((partial(lowered, *way) for way in _strips(surface, strip)), enough)
    best = valid_map(best, " onto the ring", REMEDY)
    phase.done()
    return announced(best)


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


def _strips(surface: FactoredSurface, strip: Complex) -> Iterator[tuple[str, Complex]]:
    """Yield a map to a strip (n,), and others that may be better, with their names.

    No edge of a ring turns by pi or more around 0, and none crosses the inner circle.
    """
    yield "flux", strip
    fair, _ = ring_map(surface, least=FAIR_SHARE)
    if not np.array_equal(fair, strip):
        yield "flux", fair
    with suppress(MeshError, Rejected):
        yield EMBEDDED, np.log(embedded_ring(surface.mesh))


def ring_map(
    surface: FactoredSurface, *, least: float = LEAST_SHARE
) -> tuple[Complex, tuple[float, float]]:
    """Map an annulus to a strip (n,), the logarithm of a ring around 0; bounds of its modulus.

    The angles on the loops are what flows through them.

    As much flows through the real part as around it, 2 pi, so that far from the loops there is no
    shear. The mean of the bounds of the modulus would lay a loop's errors on the whole surface.
    """
    mesh, L = surface.mesh, surface.laplacian
    one = marked(len(mesh.V), mesh.loops[1]).astype(float)
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
    angle, forwards = np.zeros(len(mesh.V)), True
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
