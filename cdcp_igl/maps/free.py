"""A disk mapped conformally to the plane with a free outline and its own scale."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import (
    Complex,
    Floats,
    Ints,
    as_complex,
    coordinates,
    distinct_rows,
    places,
)
from ..cached import cached_property
from ..descent.pins import pinned
from ..descent.placing import centered, judged_in_plane, set_apart
from ..descent.preconditioning import WeightedLaplacian
from ..descent.repair import repair_locally, repairable
from ..descent.scaffold import keeping_apart
from ..descent.targets import PLANE
from ..descent.tradeoff import measured
from ..docstrings import like
from ..errors import MapError, spell
from ..io.given import takes_meshes
from ..options import Options
from ..phases import Phases, Progress
from ..result.base import announced, valid_map
from ..result.disk_map import DiskMap
from ..result.free_map import FreeMap
from ..result.keeping import kept_map
from ..solve.factored import FactoredSurface, harmonic_extension
from ..solve.solvers import SolverName, using
from ..steps.mobius import rotate
from ..steps.trace import edge_lengths
from ..surface.mesh import Mesh
from ..surface.orientation import wrong_side
from ..surface.topology import Topology
from ..surface.triangles import flipped_faces
from ..verdict.conformality import NOT_ASKED
from ..verdict.outline import OutlineCertificate, certify_outline
from .boundary_first import (
    angles_of_scale,
    closed_curve,
    edge_means,
    grounded,
    scale_of_angles,
)
from .disk import DiskProblem, disk_map, factored_surface
from .problem import OnTarget, Problem, Start, solve

# The first share of easing, towards the lengths that the boundary has on the disk.
EASED = 1 / 64
# Steps of refinement of an outline that was eased, and of one that was the circle.
EASING, FREEING = 5, 10
OWN, DELAUNAY, FREED = "own lengths", "intrinsic Delaunay", "eased from the disk"
SUM_TOLERANCE = 1e-9  # of exterior angles, which add up to 2 pi
# Phases of a map onto the disk that one with a free outline only has where its outline is eased.
OF_THE_DISK = ("center", "trace", "circle", "mobius")


@takes_meshes
@like(disk_map)
def free_map(
    V: ArrayLike,
    F: ArrayLike,
    *,
    boundary_scale: ArrayLike | None = None,
    corners: Mapping[int, float] | None = None,
    align: int | ArrayLike | None = None,
    refine: int | None = None,
    refine_norm: float = 1.5,
    refine_seconds: float = np.inf,
    keep: float | str = "angles",
    pins: Mapping[int, ArrayLike] | None = None,
    solver: SolverName | None = None,
    progress: Progress | None = None,
) -> FreeMap:
    """Map a triangulated disk conformally to the plane, with the outline that distorts least.

    Of all conformal maps the one that keeps the lengths of the boundary has the least variation
    of scale. Its exterior angles follow from that by one system of equations, and they and the
    lengths tell the outline; the coordinates inside are harmonic. With the factor of a map onto
    the disk it takes two more solves. Refinement then moves the outline, too.

    Where a face at the outline is flipped, the vertices near it are relaxed: ``result.repair`` says
    how many. An outline that overlaps itself is eased: its lengths go towards those that it has on
    the disk, as far as needed. ``result.boundary`` says so. One that only touches itself, like the
    sides of a slit, is set apart by what rounding needs, at most 1e-10 of its size.

    Parameters
    ----------
    boundary_scale : (n,) array_like of positive numbers, optional
        How many times longer the boundary is to be in the plane, at each vertex; an edge gets the
        geometric mean of its ends. Rows inside do not matter. Lengths are reached but for what
        closes the outline.
    corners : mapping of int to float, optional
        Exterior angles in radians at boundary vertices; elsewhere the outline is straight. They
        add up to 2 pi: a polygon.
    align : int, (3,) array_like or None
        What lies to the right of the centroid, as in `disk_map`.
    refine : int or None
        Steps of refinement, as in `disk_map`, the outline free. None is as needed: up to five of
        an outline that was eased, ten of one that was a circle. Not together with `boundary_scale`
        or `corners`, which it would not keep.
    keep : {"angles", "lengths", "areas"}, float or str
        What the map is to keep as well as it can, as in `disk_map`, the outline and the size free:
        lengths are in the unit of V. The outline does not come to overlap itself. Not together with
        `refine`, `boundary_scale` or `corners`.
    pins : mapping of int to (2,) array_like, optional
        Where vertices are to be, in the unit of V: two at least. They get there to the last bit,
        no face flips, and the boundary does not overlap itself; the rest gives way, and keeps what
        `keep` says. Places where they already lie leave a map that keeps angles as it is. Not
        together with `align`, `refine`, `boundary_scale`, `corners` or a bound on texels.

    Returns
    -------
    FreeMap

    Raises
    ------
    MapError
        If no map is a bijection onto a simple polygon, or if pins do not all get to their places.
        Its ``result`` is the one of least distortion, whose certificate says where the outline
        overlaps itself, or the map as far as it went.

    References
    ----------
    R. Sawhney, K. Crane. Boundary first flattening. ACM Trans. Graph. 37(1), 2018. There one
    coordinate is the harmonic conjugate of the other; here both are harmonic.

    Examples
    --------
    What is flat keeps its shape and its size, unless another scale is asked for:

    >>> import numpy as np
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.square(10)
    >>> result = cdcp_igl.free_map(V, F, align=[1, 0, 0])
    >>> bool(abs(result.uv - V[:, :2]).max() < 1e-12)
    True
    >>> twice = cdcp_igl.free_map(V, F, boundary_scale=np.full(len(V), 2))
    >>> round(twice.area_ratio, 9)
    4.0
    >>> longer = cdcp_igl.free_map(V, F, keep="lengths", pins={0: (-2, 0), 10: (2, 0)})
    >>> longer.uv[[0, 10]].tolist()
    [[-2.0, 0.0], [2.0, 0.0]]
    """
    options = Options(
        align=align,
        refine=refine,
        refine_norm=refine_norm,
        refine_seconds=refine_seconds,
        solver=solver,
        keep=keep,
    )
    check_boundary(boundary_scale, corners, pins, options)
    phase = Phases(progress, refine or 0, skipped=OF_THE_DISK)
    with using(solver):
        surface = factored_surface(V, F, options, phase)
        places = places_of(pins, len(surface.mesh.scaled))
        boundary = boundary_of(surface.mesh, boundary_scale, corners)
        made = solve(FreeProblem(surface, boundary, options, phase))
        return pinned_to(announced(as_given(made)), places, phase)


def check_boundary(
    boundary_scale: ArrayLike | None,
    corners: Mapping[int, float] | None,
    pins: Mapping[int, ArrayLike] | None,
    options: Options,
) -> None:
    """Check what is asked of the outline, as far as that takes no mesh; ValueError."""
    of_boundary = boundary_scale is not None or corners is not None
    if places_of(pins):
        _refuse_beside_pins(options, of_boundary=of_boundary)
    if boundary_scale is not None and corners is not None:
        raise ValueError("of boundary_scale and corners only one is possible")
    if of_boundary:
        for moves in ("refine", *["keep"] * bool(options.kept)):
            if getattr(options, moves):
                raise ValueError(
                    f"{moves} moves the boundary: leave it out, or boundary_scale and corners"
                )
    if boundary_scale is not None and np.ndim(boundary_scale) != 1:
        raise ValueError(f"boundary_scale must have a number a vertex, not be {boundary_scale!r}")
    if corners is None:
        return
    if not isinstance(corners, Mapping) or not corners:
        raise ValueError(f"corners must give angles at boundary vertices, not {corners!r}")
    given = np.array([*corners.values()], dtype=np.float64)
    if not (abs(given) < np.pi).all() or not abs(given.sum() - 2 * np.pi) <= SUM_TOLERANCE:
        raise ValueError(
            "the exterior angles at the corners must be radians between -pi and pi that add up to "
            f"2 pi; they add up to {given.sum():.9g}"
        )


def _refuse_beside_pins(options: Options, *, of_boundary: bool) -> None:
    if of_boundary:
        raise ValueError("pins move the boundary: leave them out, or boundary_scale or corners")
    for name in ("refine", "align"):
        if getattr(options, name) is not None:
            raise ValueError(f"{name} moves what pins hold: leave one of them out")
    if options.kept.texels < np.inf:
        raise ValueError("pins hold places, and no bound on texels: keep a number")


def places_of(
    pins: Mapping[int, ArrayLike] | None, n: float = np.inf
) -> tuple[Ints, Floats] | None:
    """Vertices (k,) that are told where to be, and their places (k, 2); ValueError if not."""
    if pins is None:
        return None
    rows = np.array(list(pins)) if isinstance(pins, Mapping) else np.empty(0)
    if len(rows) < 2 or rows.dtype.kind not in "iu" or rows.ndim > 1:
        raise ValueError(f"pins must give two vertices or more their places, not {pins!r}")
    if absent := [row for row in rows if not 0 <= row < n]:
        raise ValueError(f"pins name vertex {absent[0]}, which is not there")
    given = [np.asarray(place) for place in pins.values()]
    if any(place.shape != (2,) or place.dtype.kind not in "iuf" for place in given):
        raise ValueError("pins must give each vertex two real numbers")
    places = np.array(given, dtype=np.float64)
    if not np.isfinite(places).all() or len(distinct_rows(places)[0]) < len(rows):
        raise ValueError("places of pins must be finite, and all different")
    return rows.astype(np.int64), places


@dataclass(frozen=True)
class Boundary:
    """How to lay out the boundary: by the logarithm u_B of its scale, or by exterior angles, (nB,).

    `length` is that of the outline in the unit of ``mesh.scaled``.
    """

    name: str
    length: float
    u_B: Floats
    angles: Floats | None = None


def boundary_of(
    mesh: Mesh,
    boundary_scale: ArrayLike | None = None,
    corners: Mapping[int, float] | None = None,
) -> Boundary:
    """Check what is asked of the boundary; ValueError if it cannot be had."""
    n, loop, length = len(mesh.scaled), mesh.loop, edge_lengths(mesh)
    if boundary_scale is not None:
        scale = np.asarray(boundary_scale, dtype=np.float64)
        if scale.shape != (n,):
            raise ValueError(f"boundary_scale has shape {scale.shape}; it must be ({n},)")
        if not (np.isfinite(scale[loop]) & (scale[loop] > 0)).all():
            raise ValueError("boundary_scale must be positive and finite on the boundary")
        u_B = np.log(scale[loop])
        return Boundary("given scale", float(length @ np.exp(edge_means(u_B))), u_B)
    if corners is None:
        return Boundary(OWN, float(length.sum()), np.zeros(len(loop)))
    rows = np.array(list(corners))
    if rows.dtype.kind not in "iu" or not np.isin(rows, loop).all():
        raise ValueError(f"corners must be boundary vertices, not {spell(rows)}")
    angles = np.zeros(len(loop))
    angles[mesh.loop_index[rows]] = [*corners.values()]
    return Boundary("given angles", float(length.sum()), 0 * angles, angles)


class FreeProblem(Problem[FreeMap]):
    """A disk into the plane, its boundary as asked for.

    A map whose mean error is more than `enough`, in degrees, is refined unless that is said. If its
    boundary cannot keep its lengths, that is a MapError, unless these `may` be `eased`. What is
    `known` of a surface that will be mapped again are its plain maps, by the Laplacian.
    """

    coarse = np.inf  # an atlas weighs angles against an even scale

    def __init__(
        self,
        surface: FactoredSurface,
        boundary: Boundary,
        options: Options,
        phase: Phases,
        *,
        keep_factor: bool = False,
        enough: float = np.inf,
        may_ease: bool = True,
        known: dict[str, FreeMap] | None = None,
    ) -> None:
        super().__init__(surface.mesh, options, phase)
        self.surface, self.boundary = surface, boundary
        self._keep_factor, self._enough, self._may_ease = keep_factor, enough, may_ease
        self._known = {} if known is None else known
        to_do = "cut the surface where it is long or branches (cdcp_igl.cut)"
        if not self._is_own:
            to_do = "give other lengths or angles of the boundary"
        self.remedy = f"To have one, {to_do}"

    @property
    def _is_own(self) -> bool:
        return self.boundary.name == OWN

    def starts(self) -> Iterator[Start[FreeMap]]:
        """Yield the map with the boundary as asked, on two Laplacians; then eased ones."""
        yield partial(self._as_asked, "cotangent")
        yield partial(self._as_asked, DELAUNAY)
        asked = [self._known[name] for name in ("cotangent", DELAUNAY) if name in self._known]
        if self._is_own and self._may_ease and not any(made.valid for made in asked):
            yield self._eased
            yield self._from_disk

    def is_good_start(self, made: FreeMap) -> bool:
        """Whether no other start is tried; a map that is eased need not be near."""
        is_near = made.boundary != self.boundary.name or made.distortion.mean <= self._enough
        return made.is_acceptable and is_near

    def needs_no_other_start(self, made: FreeMap) -> bool:
        """Return True: a Tutte embedding has a circle for a boundary, and no free one."""
        return True

    def _as_asked(self, laplacian: str) -> FreeMap:
        """Lay out the boundary as asked."""
        if laplacian not in self._known:
            surface = self.surface
            if laplacian == DELAUNAY:
                with self.phase("factor"):
                    surface = surface.delaunay
            f = _laid_out(surface, self.boundary, self.phase)
            self._known[laplacian] = self._placed(f, self.boundary.name, laplacian)
        return self._known[laplacian]

    @cached_property
    def _disk(self) -> DiskMap:
        """The map onto the unit disk."""
        with self.phase("circle"):
            return solve(DiskProblem(self.surface, Options(refine=0), Phases(), known={}))

    def _eased(self) -> FreeMap:
        """Return the valid map that is eased least, by bisection of the logarithms of lengths."""
        f_B = self._disk._f[self.mesh.loop]
        scale = np.log(abs(np.roll(f_B, -1) - f_B) / edge_lengths(self.mesh))
        u_B = (scale + np.roll(scale, 1)) / 2
        low, high, best = 0.0, EASED, None
        while high - low > high / 4:
            # As long as none is valid, twice the share, up to 1; then the gap is halved.
            share = (low + high) / 2 if best else high
            way = replace(self.boundary, u_B=share * (u_B - u_B.mean()))
            f = _laid_out(self.surface.delaunay, way, self.phase)
            made = self._placed(f, f"eased by {share:.0%}", DELAUNAY)
            if made.valid:
                best, high = made, share
            else:
                low, high = share, high if best else min(2 * share, 1.0)
        return best or made

    def _from_disk(self) -> FreeMap:
        """Lower the shear of the map onto the disk, its outline free but kept simple."""
        disk = self._disk
        with self.phase("refine"):
            f, _ = keeping_apart(self.mesh, disk._f, 0.0)
        return self._placed(f, FREED, disk.boundary.laplacian)

    def _placed(self, f: Complex, boundary: str, laplacian: str, known: float = 0.0) -> FreeMap:
        """Turn a map (n,) about its centroid, scale it to the length of its outline; judge it."""
        mesh, length = self.mesh, self.boundary.length
        with self.phase("repair"):
            if boundary != FREED or not _loses_faces(mesh, f, centered(mesh, f)):
                f = centered(mesh, f)
            f = rotate(mesh, f, self.options.align, on_circle=False)
            f, certificate = set_apart(mesh, _of_length(mesh, f, length))
            # An outline that overlaps itself is beyond repair.
            most = repairable(mesh) if certificate.simple else 0
            f, repair = repair_locally(mesh, f, most, is_free=self._is_own)
            if repair.n_flipped:
                f = _of_length(mesh, centered(mesh, f), length)
                certificate = certify_outline(mesh, coordinates(f))
        return FreeMap(
            **judged_in_plane(mesh, f, certificate, repair, self.phase, known),
            boundary=boundary,
            laplacian=laplacian,
            solver=self.surface.solver,
        )

    def steps(self, made: FreeMap) -> int:
        """Return how many steps of refinement a map gets: more where its outline was eased."""
        if not self._is_own:
            return 0
        steps, options = super().steps(made), self.options
        is_far = made.boundary != OWN or made.distortion.mean > self._enough
        if options.refine is None and made.valid and is_far and not options.kept:
            steps = max(steps, FREEING if made.boundary == FREED else EASING)
        return steps

    def on_target(self, made: FreeMap) -> OnTarget:
        """Return a map as descent sees it: all vertices move."""
        laplacian = WeightedLaplacian(self.mesh, _order_of_all(self.surface))
        return OnTarget(PLANE, made._f, laplacian)

    def moved(self, made: FreeMap, f: Complex, known: float) -> FreeMap:
        """Return what descent made of a map."""
        return self._placed(f, made.boundary, made.laplacian, known)

    def release(self) -> None:
        """Give back the memory of the factor, as refinement makes one of its own."""
        if not self._keep_factor:
            self.surface.release()

    def finished(self, best: FreeMap) -> FreeMap:
        """Let a map keep lengths or areas if that is asked for."""
        if not (self.options.kept and best.valid):
            return best
        self.release()

        def placed(f: Complex) -> Complex:
            f = centered(self.mesh, f)
            return rotate(self.mesh, f, self.options.align, on_circle=False)

        return kept_map(best, self.options.kept, placed, self.phase)


def pinned_to(made: FreeMap, pins: tuple[Ints, Floats] | None, phase: Phases) -> FreeMap:
    """Bring vertices to their places (k, 2), if any; the rest keeps what the map keeps."""
    if not pins:
        return made
    rows, places = pins
    mesh, f, t = made.mesh, made._f, made.kept.keep if made.kept else 0.0
    goal = made._upwards(as_complex(mesh.in_own_unit(places)))
    # The similarity that brings them nearest.
    at, to = f[rows] - f[rows].mean(), goal - goal.mean()
    f = (f - f[rows].mean()) * (np.vdot(at, to) / np.vdot(at, at)) + goal.mean()
    with phase("refine"):
        f, steps = pinned(mesh, f, t, rows, goal)
    made = replace(made, pins=rows)._moved(f, phase)
    kept = measured(mesh, f, t, PLANE, steps)
    made = replace(made, conformality=NOT_ASKED, kept=kept)
    left = abs(f[rows] - goal)
    if left.any():
        raise MapError(
            f"Vertex {rows[left.argmax()]} does not get to its place: the faces around turn "
            "over. Leave out pins, or put them nearer to the map",
            made,
        )
    return valid_map(made, "", "Leave out pins, or put them nearer to the map.")


def as_given(made: FreeMap) -> FreeMap:
    """Mirror the map of a plane mesh that is clockwise: what is flat keeps its shape."""
    V, F = made.mesh.scaled, made.mesh.F
    if np.ptp(V[:, 2]) or not wrong_side(V, Topology(F, len(V)))[0]:
        return made
    return replace(made, mirrored=True)


def _laid_out(surface: FactoredSurface, boundary: Boundary, phase: Phases) -> Complex:
    """Lay out the boundary, and the interior harmonically."""
    with phase("extension"):
        angles, u_B = boundary.angles, boundary.u_B
        if angles is None:
            angles = angles_of_scale(surface, u_B)
        else:
            u_B = scale_of_angles(grounded(surface), angles)
        return harmonic_extension(surface, closed_curve(surface.mesh, u_B, angles))


def _loses_faces(mesh: Mesh, f: Complex, moved: Complex) -> bool:
    """Whether rounding flips faces of a map (n,) when it is moved, which are crowded around 0."""
    return len(flipped_faces(moved, mesh.F)[0]) > len(flipped_faces(f, mesh.F)[0])


def _of_length(mesh: Mesh, f: Complex, length: float) -> Complex:
    """Scale a map (n,) until its outline is so long."""
    outline = f[mesh.loop]
    return f * (length / abs(np.roll(outline, -1) - outline).sum())


def own_outline(surface: FactoredSurface, phase: Phases) -> OutlineCertificate:
    """Certify the map in which the boundary keeps its lengths."""
    asked = boundary_of(surface.mesh)
    mesh = surface.mesh
    return set_apart(mesh, centered(mesh, _laid_out(surface, asked, phase)))[1]


def _order_of_all(surface: FactoredSurface) -> Ints:
    """(n,) vertices in the order of elimination, those of the boundary after what they touch."""
    mesh, edges = surface.mesh, surface.mesh.edges
    rank = places(surface.order, len(mesh.scaled))
    key = rank.copy()
    for one, other in ((edges.low, edges.high), (edges.high, edges.low)):
        outer = np.flatnonzero(mesh.on_boundary[one])
        np.maximum.at(key, one[outer], rank[other[outer]])
    return np.lexsort([mesh.on_boundary, key])
