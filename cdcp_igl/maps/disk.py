"""A triangulated disk, mapped conformally onto the unit disk: Algorithm 1, and what follows."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cache, partial
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from ..algorithm import Steps, as_printed, harmonic_map
from ..arrays import Complex, Floats, marked
from ..cached import cached_property
from ..descent.collapsed_faces import open_collapsed_faces
from ..descent.descent import from_tutte
from ..descent.placing import judged
from ..descent.preconditioning import WeightedLaplacian
from ..descent.repair import repair_locally, repairable
from ..descent.targets import DISK
from ..io.given import takes_meshes
from ..options import Options
from ..phases import Phases, Progress
from ..records import BoundaryMethod, Repair, Straightening
from ..result.base import announced
from ..result.disk_map import DiskMap
from ..result.keeping import kept_map
from ..solve.factored import FactoredSurface, extended_again, harmonic_extension
from ..solve.laplacian import cotangent_laplacian
from ..solve.solvers import SolverName, using
from ..starts.boundary import FALLBACKS, STARTS, by_inscribed_angles
from ..starts.recentring import recentered
from ..starts.straightening import straighten
from ..starts.tutte import tutte_embedding
from ..steps.center import Center, CenterMethod, central_face
from ..steps.circle import Rejected
from ..steps.mobius import (
    FREE,
    FREE_SHARE,
    MobiusMethod,
    Normalization,
    Placed,
    at_one,
    composed,
    normalized,
    rotate,
)
from ..surface.mesh import DiskMesh, Mesh
from ..surface.triangles import flipped_faces
from ..verdict.certificate import certify_disk
from ..verdict.distortion import map_distortion
from . import rules
from .problem import OnTarget, Problem, Start, solve

log = logging.getLogger("cdcp_igl")

NONE_FLIPPED = np.empty(0, np.int64), 0
REMEDY = (
    "Boundary: {0.boundary}. Parts of it may be too small on the disk for double precision: cut "
    "the surface where it is long or branches (cdcp_igl.cut)"
)


@takes_meshes
def cdcp(
    V: ArrayLike,
    F: ArrayLike,
    *,
    center: CenterMethod | int = "torsion",
    mobius: Literal["angle", "area"] | None = "angle",
    align: int | ArrayLike | None = None,
    refine: int | None = None,
    refine_norm: float = 1.5,
    refine_seconds: float = np.inf,
    keep: float | str = "angles",
    preset: Literal["paper"] | None = None,
    solver: SolverName | None = None,
    progress: Progress | None = None,
) -> Floats:
    """Map a triangulated disk conformally onto the unit disk.

    Parameters
    ----------
    V, F, center, mobius, align, refine, refine_norm, refine_seconds, keep, preset, solver, progress
        As in `disk_map`.

    Returns
    -------
    (n, 2) float64
        ``disk_map(V, F, ...).uv``: row i is the image of row i of V, on the closed unit disk.

    Raises
    ------
    MeshError, SolverError, MapError, ValueError, ImportError
        As `disk_map`.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.spherical_cap(20)
    >>> uv = cdcp_igl.cdcp(V, F)
    >>> uv.shape == (len(V), 2)
    True
    """
    options = Options(
        center, mobius, align, refine, refine_norm, refine_seconds, preset, solver, keep
    )
    return announced(made_disk_map(V, F, options, progress)).uv


@takes_meshes
def disk_map(
    V: ArrayLike,
    F: ArrayLike,
    *,
    center: CenterMethod | int = "torsion",
    mobius: Literal["angle", "area"] | None = "angle",
    align: int | ArrayLike | None = None,
    refine: int | None = None,
    refine_norm: float = 1.5,
    refine_seconds: float = np.inf,
    keep: float | str = "angles",
    preset: Literal["paper"] | None = None,
    solver: SolverName | None = None,
    progress: Progress | None = None,
) -> DiskMap:
    """Map a triangulated disk conformally onto the unit disk, and certify the map.

    The constructive disk conformal parameterization (CDCP) of Yueh et al., Algorithm 1.

    Parameters
    ----------
    V : (n, 3) or (n, 2) array_like of real numbers
        Vertex positions, in any unit. Two columns are a planar mesh. In place of V and F: the
        path of a file, a tuple, or a mesh of trimesh, Open3D, PyVista, meshio, nilearn or LaPy.
    F : (m, 3) array_like of integers
        Corners of the faces, counterclockwise seen from outside: one component, one
        boundary loop, no handle.
    center : {"torsion", "heat", "centroid"} or int
        The face that carries the dipole, sect. 4.1: by the torsion function, by heat
        diffusion with t = 1e4 as in the paper, nearest to the centroid of the area, or a
        given row of F. After the Möbius step the choice hardly shows.
    mobius : {"angle", "area"} or None
        What the Möbius transformation at the end minimises: angular distortion,
        eqs. (19)-(20); or the unevenness of area, by the conformal barycentre. None
        leaves the central face near 0.
    align : int, (3,) array_like or None
        What lies at angle 0: a boundary vertex, which goes to (1, 0); or a direction in
        space: on the average over the surface, the map goes right where the surface goes
        that way, ValueError if it has no slope there. None is the first boundary vertex.
    refine : int or None
        Steps of refinement, 0 for none: Gauss-Newton on the sum of |angle error|^p over all
        corners; boundary vertices slide on the circle. Not in the paper. Most of the gain
        comes with the first two; five take about as long as the map itself.
        None is as needed: no step for a good map; two for one that is measurably not near
        the conformal one, whose errors are above 6 degrees in the mean, or whose boundary has
        few vertices, and up to nine while each takes off a fiftieth; and for one that is not
        conformal, or of which repair has moved more than a hundredth of the vertices, as many
        as gain enough, see `Refinement`. Such maps have these if fewer are asked for, too.
    refine_norm : float
        The exponent p, from 1 to 2. The default lowers mean and SD; the nearer to 1, the
        lower the mean and the higher the SD.
    refine_seconds : float
        Time limit of the refinement: after so many seconds no step is begun. The map is the
        best until then, ``result.refinement.stopped`` says so, and it depends on the speed of
        the machine; without a limit, equal inputs have equal outputs.
    keep : {"angles", "lengths", "areas"}, float or str
        What the map is to keep as well as it can: from 0, angles, over 1/2, lengths (the symmetric
        Dirichlet energy is least), to 0.99, areas; 1 is taken for 0.99. Or the least such number
        that bounds the densities of texels, as ``"texels<2"``; ``result.kept`` tells, see `Kept`.
        Lengths and areas are those of the surface, brought to the area of the disk. No face flips
        on the way. Not together with `refine` or `preset`; `mobius` is then for areas.
    preset : {"paper"} or None
        ``"paper"`` follows the paper to the letter where it is right: coldest face by
        heat, the trace by eq. (18) and without whitening, Nelder-Mead over all faces. Not to be
        combined with `center` and `mobius`.
    solver : {"scikit-sparse", "cvxopt", "scipy"} or None
        What factors the matrices: CHOLMOD by either package, or SuperLU. None is what the
        environment variable ``CDCP_IGL_SOLVER`` names, or else the first that is installed.
    progress : callable, optional
        Called as ``progress(phase, fraction)`` when a phase begins, and after each step of
        refinement.

    Returns
    -------
    DiskMap
        ``uv`` (n, 2) with the certificate, the distortion, and what was used. Where the
        geodesic algorithm gives no valid map, or one that is measurably not near the
        conformal one, others are tried, and the valid map with the lowest mean distortion is
        returned; ``conformal`` says whether it is what a conformal map of this mesh should be.

    Raises
    ------
    MeshError
        If the input is not a triangulated disk.
    SolverError
        If the Laplacian cannot be factored.
    MapError
        If no map is a bijection onto the disk, which the crowding of a surface that is too
        long and thin for double precision may prevent; the one of least mean distortion is its
        ``result``.
    ValueError
        If an option is not one of those above; nothing has been computed then.
    ImportError
        If the solver that was asked for is not installed.

    References
    ----------
    M.-H. Yueh et al. A constructive algorithm for disk conformal parameterizations.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.ellipse(20)
    >>> result = cdcp_igl.disk_map(V, F, mobius="area", refine=2)
    >>> result.certificate.valid, result.refinement.steps
    (True, 2)
    """
    options = Options(
        center, mobius, align, refine, refine_norm, refine_seconds, preset, solver, keep
    )
    return announced(made_disk_map(V, F, options, progress))


def made_disk_map(
    V: ArrayLike, F: ArrayLike, options: Options, progress: Progress | None
) -> DiskMap:
    """Map a disk as `disk_map` does, without a word where the map is not conformal."""
    phase = Phases(progress, options.refine or 0)
    with using(options.solver):
        return solve(DiskProblem(factored_surface(V, F, options, phase), options, phase))


def factored_surface(
    V: ArrayLike, F: ArrayLike, options: Options, phase: Phases
) -> FactoredSurface:
    """Check the surface and the options, and factor the Laplacian."""
    with phase("check"):
        mesh = DiskMesh(V, F)
        options.check_rows(len(mesh.F), mesh.loop)
    with phase("laplacian"):
        L = cotangent_laplacian(mesh)  # (8)
    with phase("factor"):
        return FactoredSurface(mesh, L)


@dataclass(frozen=True, eq=False)
class _OnDisk(Placed):
    """A map on the disk, what was done about its flipped faces, and how many were held open."""

    n_opened: int
    repair: Repair


@dataclass(frozen=True, eq=False)
class _Harmonic:
    """A map f (n,) onto the disk before its Möbius transformation, and how it was made.

    It is harmonic for the Laplacian of `surface`, or from a Tutte embedding. The point `w` has gone
    to 0, lest the faces around it be too small; 0 if none has.
    """

    surface: FactoredSurface
    f: Complex
    boundary: BoundaryMethod
    w: complex = 0j
    straightening: Straightening = field(default_factory=Straightening)

    def corrected(self, *, straightened: bool) -> _Harmonic:
        """Take the common shear out if asked to, and move a tiny region deep inside to 0."""
        surface, mesh, f, done = self.surface, self.surface.mesh, self.f, self.straightening
        if straightened:
            f, done = straighten(mesh, f, partial(harmonic_extension, surface))
        f, w = recentered(mesh, f, partial(extended_again, surface))
        return replace(self, f=f, w=w, straightening=done)


class DiskProblem(Problem[DiskMap]):
    """A disk onto the unit disk.

    A surface that will be mapped again keeps its factor, and `known`, the last harmonic map of
    Algorithm 1 by the options that it depends on.
    """

    onto, remedy = " onto the disk", REMEDY

    def __init__(
        self,
        surface: FactoredSurface,
        options: Options,
        phase: Phases,
        known: dict[object, tuple[Center, Complex]] | None = None,
    ) -> None:
        super().__init__(surface.mesh, options, phase)
        self.surface, self._known = surface, known
        self._tried: list[tuple[_Harmonic, DiskMap]] = []

    @cached_property
    def algorithm(self) -> Steps:
        """The steps of Algorithm 1 that the options ask for; the central face is found once."""
        steps = Steps(partial(central_face, center=self.options.center))
        steps = as_printed() if self.options.preset == "paper" else steps
        return replace(steps, center=cache(steps.center))

    @cached_property
    def center(self) -> Center:
        """The central face."""
        return self.algorithm.center(self.surface)

    def starts(self) -> Iterator[Start[DiskMap]]:
        """Yield Algorithm 1, then other boundaries on the intrinsic Delaunay Laplacian.

        If the map will be refined, one other boundary is enough: Tutte embeddings, which come next,
        lead nearer than a third. Where all are sheared, many flipped faces are repaired, too.
        """
        if len(self.mesh.interior) == 0 and self.options.preset is None:
            yield self._inscribed
            return
        yield self._geodesic
        for name in FALLBACKS:
            before = len(self._tried)
            yield partial(self._on_delaunay, name)
            if self._may_refine and len(self._tried) > before:
                break
        if all(made.conformality.sheared for _, made in self._tried):
            for harmonic, made in sorted(self._tried, key=lambda pair: rules.rank(pair[1])):
                if not (made.valid or made.repair.rounds):
                    yield partial(self._much_repaired, harmonic)

    @property
    def _may_refine(self) -> bool:
        return self.options.preset is None and self.options.refine != 0

    def is_good_start(self, made: DiskMap) -> bool:
        """Whether no other harmonic map may lead nearer to the conformal one."""
        return not rules.may_be_improved(made, self.options)

    def _geodesic(self) -> DiskMap:
        """Map by Algorithm 1."""
        options, known = self.options, self._known
        if known and options.first_steps in known:
            self.center, f = known[options.first_steps]
        else:
            self.center, f = harmonic_map(self.surface, self.algorithm, self.phase)
        if known is not None:
            known.clear()
            known[options.first_steps] = self.center, f
        return self._judged(_Harmonic(self.surface, f, BoundaryMethod("geodesic")))

    def _on_delaunay(self, name: str) -> DiskMap:
        """Map harmonically on the Delaunay Laplacian, the boundary by a method without curve."""
        with self.phase("circle"):
            f_B = FALLBACKS[name](self.surface, self.center.face)
        with self.phase("extension"):
            delaunay = self.surface.delaunay
            f = extended_again(delaunay, harmonic_extension(delaunay, f_B))  # (10)
        method = BoundaryMethod(name, laplacian="intrinsic Delaunay")
        return self._judged(_Harmonic(delaunay, f, method))

    def _judged(self, harmonic: _Harmonic) -> DiskMap:
        """Place a harmonic map, and repair it if few faces are flipped."""
        with self.phase("mobius"):
            harmonic = harmonic.corrected(straightened=self.options.preset is None)
        made = self._normalized(harmonic, repairable(self.mesh, rules.FEW_FLIPPED))
        self._tried.append((harmonic, made))
        return made

    def _inscribed(self) -> DiskMap:
        """Map a surface without interior vertices, all of whose faces are inscribed."""
        with self.phase("circle"):
            f = by_inscribed_angles(self.mesh)
        harmonic = _Harmonic(self.surface, f, BoundaryMethod("inscribed angles"))
        return self._placed(harmonic, self.options.mobius_method, np.inf)

    def _much_repaired(self, harmonic: _Harmonic) -> DiskMap:
        """Repair also many flipped faces, and do without a Möbius transformation."""
        made = self._placed(harmonic, None, repairable(self.mesh))
        method = self.options.mobius_method
        return replace(made, mobius=Normalization(method, 0j, "repair", 0.0)) if method else made

    def tutte_starts(self, best: DiskMap) -> Iterator[Start[DiskMap]]:
        """Yield maps that no flipped face keeps from coming near: Tutte embeddings of low shear."""
        if self.options.preset is None and len(self.mesh.interior):
            yield from (partial(self._from_tutte, name) for name in STARTS)

    def _from_tutte(self, name: str) -> DiskMap:
        mesh, phase = self.mesh, self.phase
        f = np.zeros(len(mesh.scaled), dtype=complex)
        with phase("circle"):
            f[mesh.loop] = STARTS[name](self.surface, self.center.face)
        with phase("repair"):
            start, w = tutte_embedding(mesh, f, on_disk=True)
            if len(flipped_faces(start, mesh.F)[0]):
                raise Rejected(f"{name}: it crowds the mean values too much for double precision")
            f = _sheared_less(mesh, start)
        # Repair would take long, and an embedding has no need of it.
        method = BoundaryMethod(name, laplacian="mean value")
        return self._normalized(_Harmonic(self.surface, f, method, w), 0)

    def needs_no_other_start(self, made: DiskMap) -> bool:
        """Whether no Tutte embedding may lead nearer to the conformal map."""
        as_asked = made.valid and self.options.refine == 0
        return as_asked or rules.needs_no_other_start(made)

    def _normalized(self, harmonic: _Harmonic, most: float) -> DiskMap:
        """Apply the Möbius transformation, unless the map is better without it; repair, and judge.

        A transformed map that repair was tried on, which may be in vain, or that has moved a small
        part of the surface away from 0, is held against the map without the transformation; but not
        if few vertices were moved, and would be there, too: then the transformation lowers the
        distortion. At `most` so many flipped faces are repaired.
        """
        mesh, method = self.mesh, self.options.mobius_method
        made = self._placed(harmonic, method, most)
        if made.mobius.w == harmonic.w or not (harmonic.w or made.repair.rounds):
            return made
        heavily = rules.repaired_part(made) > rules.HEAVILY_REPAIRED
        little = made.valid and not (harmonic.w or heavily)
        if method != "area" and little and len(flipped_faces(harmonic.f, mesh.F)[0]):
            return made
        plain = self._placed(harmonic, None, most)
        part = rules.PRICE_OF_AREA if method == "area" else FREE_SHARE
        price = max(part * plain.distortion.mean, np.degrees(FREE))
        if _order(plain, price) < _order(made):
            rejected = made.mobius.rejected or "repair"
            mobius = replace(made.mobius, w=harmonic.w, rejected=rejected, reached=0.0)
            return replace(plain, mobius=mobius)
        return made

    def _placed(self, harmonic: _Harmonic, method: MobiusMethod | None, most: float) -> DiskMap:
        """Take the last step of Algorithm 1, open collapsed faces, repair the map, judge it."""
        mesh, align = self.mesh, self.options.align

        def place(f: Complex) -> _OnDisk:
            f, n_opened = open_collapsed_faces(mesh, rotate(mesh, f, align))
            f, repair = repair_locally(mesh, f, most)
            # What repair has not found flipped or flat is certain.
            flipped = flipped_faces(f, mesh.F) if repair.n_flipped else NONE_FLIPPED
            return _OnDisk(f, flipped, n_opened, repair)

        with self.phase("mobius"):
            placed, mobius = normalized(
                mesh, harmonic.f, method, place, repaired=True
            )  # (19), (20)
        if placed.repair.n_flipped:
            log.info("%s", placed.repair)
        with self.phase("certificate"):
            f = placed.f
            certificate = certify_disk(mesh, f, placed.flipped)
            fields = judged(mesh, f, map_distortion(mesh, f), certificate, placed.repair)
        return DiskMap(
            **fields,
            _f=f,
            center=self.center,
            boundary=replace(harmonic.boundary, n_opened=placed.n_opened),
            straightening=harmonic.straightening,
            mobius=replace(mobius, w=composed(harmonic.w, mobius.w)),
            solver=harmonic.surface.solver,
            timings=self.phase.seconds,
        )

    def chosen(self, made: list[DiskMap], failures: list[str]) -> DiskMap:
        """Return the best map, which tells which others were tried, and why they are not it."""
        best, *others = sorted(made, key=rules.rank) if made[1:] else made
        before = [reason for one in made for reason in one.boundary.rejected]
        why = tuple(dict.fromkeys((*before, *failures, *map(_objection, others))))
        for objection in why:
            log.info("boundary by %s, rejected %s", best.boundary.name, objection)
        return replace(best, boundary=replace(best.boundary, rejected=why))

    def steps(self, made: DiskMap) -> int:
        """Return how many steps a map gets; without inner vertices only those asked for."""
        steps = super().steps(made)
        return steps if len(self.mesh.interior) or not steps else self.options.refine or 0

    def on_target(self, made: DiskMap) -> OnTarget:
        """Return a map as descent sees it: the factor has the analysis of its preconditioner."""
        laplacian = WeightedLaplacian(self.mesh, self.surface.rows, self.surface.analysis)
        return OnTarget(DISK, made._f, laplacian, near=not rules.default_steps(made))

    def moved(self, made: DiskMap, f: Complex, known: float) -> DiskMap:
        """Return what descent made of a map, turned once: a rotation rounds all coordinates."""
        return made._moved(rotate(self.mesh, f, self.options.align), self.phase, known)

    def release(self) -> None:
        """Give back the memory of the factor, as refinement makes one of its own."""
        if self._known is None:
            self.surface.release()

    def finished(self, best: DiskMap) -> DiskMap:
        """Let a map keep lengths or areas if that is asked for; say what it is."""
        if self.options.kept and best.valid:
            self.release()
            turned = partial(rotate, self.mesh, align=self.options.align)
            best = kept_map(best, self.options.kept, turned, self.phase)
        with self.phase("distortion"):
            if best.conformality.reasons:
                reasons = (*best.conformality.reasons, *_causes(best))
                best = replace(best, conformality=replace(best.conformality, reasons=reasons))
        return replace(best, solver=self.surface.solver)


def _sheared_less(mesh: Mesh, start: Complex) -> Complex:
    """Lower the shear of an embedding (n,) so that no face is flipped when the map is turned.

    That puts the first boundary vertex at 1, and rounds all coordinates. Where it flips faces that
    are very small, this vertex stays at 1 from the beginning, and nothing is left to turn.
    """
    f, first = from_tutte(mesh, start), mesh.loop[0]
    if len(flipped_faces(at_one(mesh, f, first), mesh.F)[0]):
        f = from_tutte(mesh, at_one(mesh, start, first), marked(len(f), first))
    return f


def _order(made: DiskMap, price: float = 0.0) -> tuple[bool, bool, float]:
    return not made.valid, not made.is_acceptable, made.distortion.mean + price


def _objection(made: DiskMap) -> str:
    """Say why another map was sought after this one, or taken instead."""
    name = made.boundary.name
    if not made.valid:
        return f"{name}: no certificate"
    verdict = "" if made.is_acceptable else ", not conformal"
    return f"{name}: mean distortion {made.distortion.mean:.2f} degrees{verdict}"


def _causes(made: DiskMap) -> Iterator[str]:
    """Say what may have kept a map from being conformal."""
    if made.boundary.name == "arc length":
        yield f"the boundary {'began' if made._from_tutte else 'lies'} by arc length"
        yield from (reason for reason in made.boundary.rejected if "crowding" in reason)
    if (part := rules.repaired_part(made)) > rules.REPAIRED:
        yield f"repair of flipped faces moved {part:.0%} of the vertices"
