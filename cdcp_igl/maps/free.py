"""A disk mapped conformally to the plane with a free outline and its own scale."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import (
    Bools,
    Complex,
    Floats,
    Ints,
    as_complex,
    coordinates,
    distinct_rows,
    marked,
    places,
)
from ..descent.descent import Descent, Limits
from ..descent.energies import Angles
from ..descent.pins import pinned
from ..descent.preconditioning import WeightedLaplacian
from ..descent.refinement import lower_angle_distortion
from ..descent.scaffold import keeping_apart
from ..descent.targets import Outline
from ..docstrings import like
from ..errors import MapError, counted, spell
from ..io.given import takes_meshes
from ..options import Options
from ..phases import Phases, Progress
from ..rescue.repair import Repair, repair_locally, repairable
from ..result.base import announced, valid_map
from ..result.keeping import KeepingMap, Kept
from ..result.making import PATIENT, PlaneMap, best_of, fields_of, refined, steps_of
from ..solve.factored import FactoredSurface, harmonic_extension
from ..solve.solvers import SolverName, using
from ..steps.mobius import rotate
from ..steps.trace import edge_lengths
from ..surface.mesh import Mesh
from ..surface.orientation import wrong_side
from ..surface.topology import Topology
from ..verdict.conformality import NOT_ASKED
from ..verdict.distortion import map_distortion
from ..verdict.outline import OutlineCertificate, certify_outline, meeting_edges
from .boundary_first import (
    angles_of_scale,
    closed_curve,
    edge_means,
    grounded,
    scale_of_angles,
)
from .disk import disk_map, factored_surface, map_of

# An outline that touches itself, or nearly so, as both sides of a slit do, is set apart by so much
# of its size: the least that rounding lets be, in a square in which there are other charts.
APART = (1e-12, 1e-11, 1e-10)
# The first share of easing, towards the lengths that the boundary has on the disk.
EASED = 1 / 64
# Steps of refinement of an outline that was eased, and of one that was the circle.
EASING, FREEING = 5, 10
OWN, DELAUNAY, FREED = "own lengths", "intrinsic Delaunay", "eased from the disk"
SUM_TOLERANCE = 1e-9  # of exterior angles, which add up to 2 pi
# Phases of a map onto the disk that one with a free outline only has where its outline is eased.
OF_THE_DISK = ("center", "trace", "circle", "mobius")


@dataclass(frozen=True, eq=False, repr=False)
class FreeMap(KeepingMap, PlaneMap):
    """A conformal map with a free outline. Printing it gives a summary.

    Attributes
    ----------
    uv : (n, 2) float64
        Row i is the image of row i of V, in the unit of V. The outline is as long as the boundary,
        or as the lengths that were asked for; a map that keeps lengths has a size of its own. The
        centroid of the surface, or what was at the centre of the disk, is at (0, 0), before
        refinement; what `align` named lies to its right.
    mesh : DiskMesh
        The surface.
    mirrored : bool
        True of a plane mesh that is clockwise: what is flat keeps its shape, and its faces are
        clockwise in the map, too.
    certificate : OutlineCertificate
        What was verified about `uv`, or its mirror image: no face is flipped, the outline is
        simple.
    conformality, distortion, timings
        As of every `Result`; the seconds include those of maps that were not taken.
    area_ratio : float
        Area of the image by that of the surface.
    pins : (k,) int64
        Vertices that are where they were told to be; `continued` leaves them there.
    boundary : str
        ``"own lengths"``, ``"given scale"`` or ``"given angles"``. Where the outline would
        overlap itself, or flipped faces be left: ``"eased by 25%"``, so far towards the lengths
        that it has on the disk; or ``"eased from the disk"``, from which shear was lowered with
        the outline free.
    laplacian : str
        ``"cotangent"``; or, where that gives no valid map, or none that is conformal,
        ``"intrinsic Delaunay"``.
    repair : Repair
        What was done about flipped faces.
    refinement : Refinement or None
        How far the angular distortion was lowered, with the outline free to change; None if no
        step was asked for and none was due.
    solver : str
        Sparse solver, version and ordering.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.spherical_cap(20)
    >>> result = cdcp_igl.free_map(V, F)
    >>> result.valid, result.boundary
    (True, 'own lengths')
    """

    certificate: OutlineCertificate
    area_ratio: float
    mirrored: bool = False
    pins: Ints = field(default_factory=lambda: np.empty(0, np.int64))

    _kind = "free"
    _plane = "Plane"
    _target = Outline()
    _reported = ("area_ratio",)
    _coarse = np.inf  # an atlas weighs angles against an even scale

    def pinned_to(self, pins: tuple[Ints, Floats] | None, phase: Phases) -> FreeMap:
        """Bring vertices to their places (k, 2), if any; the rest keeps what this map keeps."""
        if not pins:
            return self
        rows, places = pins
        mesh, t = self.mesh, self.kept.keep if self.kept else 0.0
        goal = self._upwards(as_complex(mesh.in_own_unit(places)))
        f = self._plane_map()
        # The similarity that brings them nearest.
        at, to = f[rows] - f[rows].mean(), goal - goal.mean()
        f = (f - f[rows].mean()) * (np.vdot(at, to) / np.vdot(at, at)) + goal.mean()
        with phase("refine"):
            f, steps = pinned(mesh, f, t, rows, goal)
        made = replace(self.moved_to(f, phase), conformality=NOT_ASKED, pins=rows)
        made = replace(made, kept=Kept.of(mesh, f, t, self._target, steps))
        left = abs(f[rows] - goal)
        if left.any():
            raise MapError(
                f"Vertex {rows[left.argmax()]} does not get to its place: the faces around turn "
                "over. Leave out pins, or put them nearer to the map",
                made,
            )
        return valid_map(made, "", "Leave out pins, or put them nearer to the map.")

    @property
    def _held(self) -> Bools | None:
        return marked(len(self.mesh.V), self.pins) if len(self.pins) else None

    def _unfolded(self) -> tuple[Floats, Ints, Floats]:
        return self.mesh.positions, self._upward_faces, self.uv

    @property
    def _upward_faces(self) -> Ints:
        return self.mesh.F[:, :: -1 if self.mirrored else 1]

    def _plane_map(self) -> Complex:
        return self._upwards(as_complex(self.mesh.in_own_unit(self.uv)))

    def _in_plane(self, points: Floats) -> Complex:
        return self._upwards(super()._in_plane(points))

    def _upwards(self, f: Complex) -> Complex:
        """Go from the plane of `uv` to that in which faces are counterclockwise, or back."""
        return f.conj() if self.mirrored else f

    @property
    def _turned(self) -> bool:
        return self.mirrored

    def moved_to(self, f: Complex, phase: Phases, known: float = 0.0) -> FreeMap:
        """Return the map f (n,) of this surface, repaired, certified and judged; see `judge`."""
        mesh = self.mesh
        with phase("repair"):
            f, certificate = _set_apart(mesh, f)
            f, repair = repair_locally(mesh, f, len(mesh.F) if len(certificate.flipped) else 0)
        fields = _judged(mesh, f, certify_outline(mesh, coordinates(f)), repair, phase, known)
        uv = coordinates(self._upwards(as_complex(fields["uv"])))
        return replace(self, **{**fields, "uv": mesh.in_given_unit(uv)})

    def _steps(self) -> list[tuple[str, str]]:
        return [
            *self._kept_pairs(),
            ("boundary", f"{self.boundary}, {self.laplacian} Laplacian"),
            ("area", f"{self.area_ratio:.4g} times that of the surface"),
            *[("pins", counted(len(self.pins), "vertex", "vertices"))] * bool(len(self.pins)),
            *super()._steps(),
        ]

    def _details(self) -> dict[str, Any]:
        return {**self._kept_details(), **super()._details()}


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
        places = places_of(pins, len(surface.mesh.V))
        made = free_map_of(surface, boundary_scale, corners, options, phase)
        return announced(as_given(made)).pinned_to(places, phase)


def free_map_of(
    surface: FactoredSurface,
    boundary_scale: ArrayLike | None,
    corners: Mapping[int, float] | None,
    options: Options,
    phase: Phases,
    *,
    keep_factor: bool = False,
    enough: float = np.inf,
    may_ease: bool = True,
    known: dict[str, FreeMap] | None = None,
) -> FreeMap:
    """Map a factored surface, as `free_map` does; the factor is kept if that is asked for.

    A map whose mean error is more than `enough`, in degrees, is refined unless that is said. If its
    boundary cannot keep its lengths, that is a MapError, unless these `may` be `eased`. What is
    `known` of a surface that will be mapped again are its plain maps, by the Laplacian.
    """
    mesh = surface.mesh
    asked = _boundary(mesh, boundary_scale, corners)
    is_own = asked.name == OWN
    known = {} if known is None else known
    best = _best_map(surface, asked, options, phase, enough, may_ease, known)
    steps = steps_of(best, options) if is_own else 0
    is_far = best.boundary != asked.name or best.distortion.mean > enough
    if options.refine is None and best.valid and is_far and not options.kept:
        steps = max(steps, FREEING if best.boundary == FREED else EASING)
    if steps:
        plain, order = best, _order_of_all(surface)
        if not keep_factor:
            surface.release()

        def finished(f: Complex, known: float) -> FreeMap:
            kind = plain.boundary, plain.laplacian, asked
            return _finished(surface, f, *kind, options, phase, known)

        f = as_complex(plain.uv)
        best = refined(plain, f, Outline(), order, steps, finished, options, phase)
    best = replace(best, uv=mesh.in_given_unit(best.uv))
    if options.kept and best.valid:
        if not keep_factor:
            surface.release()

        def placed(f: Complex) -> Complex:
            f = f - np.average(f, weights=mesh.vertex_areas)
            return rotate(mesh, f, options.align, on_circle=False)

        best = best.keeping(options.kept, placed, phase)
    remedy = "give other lengths or angles of the boundary"
    if is_own:
        remedy = "cut the surface where it is long or branches (cdcp_igl.cut)"
    best = valid_map(best, "", f"To have one, {remedy}")
    phase.done()
    return best


def as_given(made: FreeMap) -> FreeMap:
    """Mirror the map of a plane mesh that is clockwise: what is flat keeps its shape."""
    V, F = made.mesh.V, made.mesh.F
    if np.ptp(V[:, 2]) or not wrong_side(V, Topology(F, len(V)))[0]:
        return made
    return replace(made, uv=made.uv * [1, -1], mirrored=True)


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
class _Boundary:
    """How to lay out the boundary: by the logarithm u_B of its scale, or by exterior angles, (nB,).

    `length` is that of the outline in the unit of ``mesh.V``.
    """

    name: str
    length: float
    u_B: Floats
    angles: Floats | None = None


def _boundary(
    mesh: Mesh, boundary_scale: ArrayLike | None, corners: Mapping[int, float] | None
) -> _Boundary:
    """Check what is asked of the boundary; ValueError if it cannot be had."""
    n, loop, length = len(mesh.V), mesh.loop, edge_lengths(mesh)
    if boundary_scale is not None:
        scale = np.asarray(boundary_scale, dtype=np.float64)
        if scale.shape != (n,):
            raise ValueError(f"boundary_scale has shape {scale.shape}; it must be ({n},)")
        if not (np.isfinite(scale[loop]) & (scale[loop] > 0)).all():
            raise ValueError("boundary_scale must be positive and finite on the boundary")
        u_B = np.log(scale[loop])
        return _Boundary("given scale", float(length @ np.exp(edge_means(u_B))), u_B)
    if corners is None:
        return _Boundary(OWN, float(length.sum()), np.zeros(len(loop)))
    rows = np.array(list(corners))
    if rows.dtype.kind not in "iu" or not np.isin(rows, loop).all():
        raise ValueError(f"corners must be boundary vertices, not {spell(rows)}")
    angles = np.zeros(len(loop))
    angles[mesh.loop_index[rows]] = [*corners.values()]
    return _Boundary("given angles", float(length.sum()), 0 * angles, angles)


def _best_map(
    surface: FactoredSurface,
    asked: _Boundary,
    options: Options,
    phase: Phases,
    enough: float,
    may_ease: bool,
    known: dict[str, FreeMap],
) -> FreeMap:
    """Try one way after the other until a map is conformal; the best, valid or not."""

    def finished(f: Complex, name: str, laplacian: str) -> FreeMap:
        return _finished(surface, f, name, laplacian, asked, options, phase)

    def laid_out(laplacian: str) -> FreeMap:
        """Return the map with the boundary as asked."""
        if laplacian not in known:
            of = surface
            if laplacian == DELAUNAY:
                with phase("factor"):
                    of = surface.delaunay
            known[laplacian] = finished(_laid_out(of, asked, phase), asked.name, laplacian)
        return known[laplacian]

    ways = [partial(laid_out, laplacian) for laplacian in ("cotangent", DELAUNAY)]
    plain = best_of(ways, lambda made: made.conformal and made.distortion.mean <= enough)
    if asked.name != OWN or plain.valid or not may_ease:
        return plain
    with phase("circle"):
        disk = map_of(surface, Options(refine=0), Phases(), known={})

    def eased() -> FreeMap:
        """Return the valid map that is eased least, by bisection of the logarithms of lengths."""
        f_B = as_complex(disk.uv)[surface.mesh.loop]
        scale = np.log(abs(np.roll(f_B, -1) - f_B) / edge_lengths(surface.mesh))
        u_B = (scale + np.roll(scale, 1)) / 2
        low, high, best = 0.0, EASED, plain
        while high - low > high / 4:
            # As long as none is valid, twice the share; then the middle of the last two.
            share = (low + high) / 2 if best.valid else high
            way = replace(asked, name=f"eased by {share:.0%}", u_B=share * (u_B - u_B.mean()))
            made = finished(_laid_out(surface.delaunay, way, phase), way.name, DELAUNAY)
            if made.valid:
                best, high = made, share
            else:
                low, high = share, max(high, min(2 * share, 1.0))
        return best

    def freed_by_newton() -> FreeMap:
        """Lower the shear of the map onto the disk, its outline free but kept simple."""
        with phase("refine"):
            f, _ = keeping_apart(surface.mesh, as_complex(disk.uv), 0.0)
        return finished(f, FREED, disk.boundary.laplacian)

    def after(steps: int) -> FreeMap:
        with phase("refine"):
            laplacian = WeightedLaplacian(surface.mesh, _order_of_all(surface))
            descent = Descent(surface.mesh, as_complex(disk.uv), laplacian=laplacian)
            angles = Angles(surface.mesh, Outline(), options.refine_norm)
            lower_angle_distortion(descent, angles, Limits(steps, least=None, trials=PATIENT))
        return finished(descent.f, FREED, disk.boundary.laplacian)

    def freed_by_refinement() -> FreeMap:
        """Lower its angle errors: on a rough surface that goes farther."""
        # After few steps, what was crowded on the disk may be too small to be turned.
        ways = [partial(after, steps) for steps in (EASING, FREEING)]
        return best_of(ways, lambda made: made.valid)

    return best_of([eased, freed_by_newton, freed_by_refinement])


def _laid_out(surface: FactoredSurface, boundary: _Boundary, phase: Phases) -> Complex:
    """Lay out the boundary, and the interior harmonically, its centroid at 0."""
    mesh = surface.mesh
    with phase("extension"):
        angles, u_B = boundary.angles, boundary.u_B
        if angles is None:
            angles = angles_of_scale(surface, u_B)
        else:
            u_B = scale_of_angles(grounded(surface), angles)
        f = harmonic_extension(surface, closed_curve(mesh, u_B, angles))
        return f - np.average(f, weights=mesh.vertex_areas)


def _finished(
    surface: FactoredSurface,
    f: Complex,
    boundary: str,
    laplacian: str,
    asked: _Boundary,
    options: Options,
    phase: Phases,
    known: float = 0.0,
) -> FreeMap:
    """Turn a map (n,) and scale it to the length of its outline; repair, certify and judge it.

    It is in the unit of ``mesh.V``.
    """
    mesh = surface.mesh
    with phase("repair"):
        f = rotate(mesh, f, options.align, on_circle=False)
        f, certificate = _set_apart(mesh, _of_length(mesh, f, asked.length))
        # An outline that overlaps itself is beyond repair.
        most = repairable(mesh) if certificate.simple else 0
        f, repair = repair_locally(mesh, f, most, is_free=asked.name == OWN)
        if repair.n_flipped:
            f = _of_length(mesh, f, asked.length)
            certificate = certify_outline(mesh, coordinates(f))
    return FreeMap(
        **_judged(mesh, f, certificate, repair, phase, known),
        boundary=boundary,
        laplacian=laplacian,
        solver=surface.solver,
    )


def _of_length(mesh: Mesh, f: Complex, length: float) -> Complex:
    """Scale a map (n,) until its outline is so long."""
    outline = f[mesh.loop]
    return f * (length / abs(np.roll(outline, -1) - outline).sum())


def _judged(
    mesh: Mesh,
    f: Complex,
    certificate: OutlineCertificate,
    repair: Repair,
    phase: Phases,
    known: float = 0.0,
) -> dict[str, Any]:
    """Measure and judge a map (n,): fields of a FreeMap in the unit of ``mesh.V``."""
    with phase("certificate"):
        fields = fields_of(mesh, f, map_distortion(mesh, f), certificate, repair, known=known)
        outline = f[mesh.loop]
        area = (outline.conj() * np.roll(outline, -1)).imag.sum() / 2
    ratio = float(area / mesh.vertex_areas.sum())
    return {**fields, "uv": coordinates(f), "area_ratio": ratio, "timings": phase.seconds}


def own_outline(surface: FactoredSurface, phase: Phases) -> OutlineCertificate:
    """Certify the map in which the boundary keeps its lengths."""
    asked = _boundary(surface.mesh, None, None)
    return _set_apart(surface.mesh, _laid_out(surface, asked, phase))[1]


def _set_apart(mesh: Mesh, f: Complex) -> tuple[Complex, OutlineCertificate]:
    """Certify a map (n,); one whose outline only touches itself, its sides set apart.

    So near as to touch are sides that rounding may let cross when the map is moved.
    """
    certificate = touching = certify_outline(mesh, coordinates(f))
    if not touching.finite:
        return f, touching
    outline = f[mesh.loop]
    along = np.exp(1j * np.angle(np.roll(outline, -1) - outline))
    inward = 1j * (along + np.roll(along, 1)) / 2 * abs(outline).max()
    if not (len(touching.meeting) or len(meeting_edges(outline - APART[0] * inward))):
        return f, touching
    for share in APART:
        apart = f.copy()
        apart[mesh.loop] += share * inward
        certificate = certify_outline(mesh, coordinates(apart))
        if certificate.simple:
            return apart, certificate
    return f, touching


def _order_of_all(surface: FactoredSurface) -> Ints:
    """(n,) vertices in the order of elimination, those of the boundary after what they touch."""
    mesh, edges = surface.mesh, surface.mesh.edges
    rank = places(surface.order, len(mesh.V))
    key = rank.copy()
    for one, other in ((edges.low, edges.high), (edges.high, edges.low)):
        outer = np.flatnonzero(mesh.on_boundary[one])
        np.maximum.at(key, one[outer], rank[other[outer]])
    return np.lexsort([mesh.on_boundary, key])
