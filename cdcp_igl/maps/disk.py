"""A triangulated disk, mapped conformally onto the unit disk: Algorithm 1, and what follows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from ..algorithm import Steps, algorithm_1
from ..arrays import Complex, Floats, as_complex
from ..descent.targets import DISK
from ..io.given import takes_meshes
from ..options import Options
from ..phases import Phases, Progress
from ..rescue.harmonic_map import HarmonicMap
from ..result.base import announced, valid_map
from ..result.disk_map import DiskMap, judged
from ..result.making import refined, steps_of
from ..solve.factored import FactoredSurface
from ..solve.laplacian import cotangent_laplacian
from ..solve.solvers import SolverName, using
from ..steps.center import CenterMethod
from ..steps.circle import Rejected
from ..steps.mobius import rotate
from ..surface.mesh import DiskMesh
from .selection import chosen, embedded, inscribed, is_good, rescue

LITTLE_STRETCH = 1.6  # of maps with large faces: no other map has a mean lower by 5 %
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
        return map_of(factored_surface(V, F, options, phase), options, phase)


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


def map_of(
    surface: FactoredSurface,
    options: Options,
    phase: Phases,
    *,
    known: dict[object, HarmonicMap] | None = None,
) -> DiskMap:
    """Map a factored surface by Algorithm 1, and where that map is not good, rescue it.

    A surface that will be mapped again keeps its factor, and what is `known` of it: the last
    harmonic map of Algorithm 1, by the options that it depends on.
    """
    steps = Steps.of(options)
    if len(surface.mesh.interior) == 0 and options.preset is None:
        best = inscribed(surface, steps.center(surface), options, phase)
        return finish(surface, best, options, phase, keep_factor=known is not None)
    try:
        before = known.get(options.first_steps) if known else None
        harmonic, f, mobius = algorithm_1(surface, steps, phase, before)
    except Rejected as reason:
        best = rescue(surface, steps.center(surface), reason, options, phase)
    else:
        if known is not None:
            known.clear()
            known[options.first_steps] = harmonic
        f = rotate(surface.mesh, f, options.align)
        best = judged(surface.mesh, f, replace(harmonic.done, mobius=mobius), surface.solver, phase)
        if not is_good(best, harmonic, options):
            best = rescue(surface, best.center, harmonic, options, phase)
    return finish(surface, best, options, phase, keep_factor=known is not None)


def finish(
    surface: FactoredSurface,
    best: DiskMap,
    options: Options,
    phase: Phases,
    *,
    keep_factor: bool,
) -> DiskMap:
    """Refine a map if that is asked for or needed, and say what it is; MapError if it is not valid.

    Where another may be nearer to the conformal map, and refinement leaves it so, maps that begin
    with embeddings are refined, too, and the best is taken. Unless `keep_factor`, refinement of a
    good map, which makes a factor of its own, begins by giving back the memory of the surface's. A
    map that is to keep lengths or areas begins here.
    """
    due = options.preset is None and len(surface.mesh.interior) > 0

    def is_enough(made: DiskMap) -> bool:
        return is_settled(made) or (made.valid and options.refine == 0)

    good = is_settled(best)
    if good and not keep_factor and steps_of(best, options, due=due):
        surface.release()
    best = _lowered(surface, best, options, phase, due=due)
    if due and not (good or is_enough(best)):
        tried, rejected = [best], list(best.boundary.rejected)
        for start in embedded(surface, best.center, options, phase):
            if isinstance(start, Rejected):
                rejected.append(str(start))
                continue
            tried.append(_lowered(surface, start, options, phase, due=due))
            if is_enough(tried[-1]):
                break
        tried.sort(key=lambda made: made.refined_rank)
        best = chosen(tried, tuple(rejected))
    if options.kept and best.valid:
        if not keep_factor:
            surface.release()
        turned = partial(rotate, surface.mesh, align=options.align)
        best = best.keeping(options.kept, turned, phase)
    with phase("distortion"):
        if best.conformality.reasons:
            reasons = (*best.conformality.reasons, *_causes(best))
            best = replace(best, conformality=replace(best.conformality, reasons=reasons))
    best = valid_map(replace(best, solver=surface.solver), " onto the disk", REMEDY)
    phase.done()
    return best


def is_settled(made: DiskMap) -> bool:
    """Whether no other map may be nearer to the conformal one.

    It is conformal beyond doubt, or its faces are large, but hardly stretched, and the scale
    explains all errors; no step of refinement would have undone that. And repair has left most of
    it as it was, or what is left of the errors belongs to single faces: else refinement may go
    farther from an embedding.
    """
    if made.refinement is not None and made.refinement.stopped == "not conformal":
        return False
    if made.is_far_from_mended:
        return False
    verdict = made.conformality
    hardly = made.valid and not verdict.sheared and verdict.stretch <= LITTLE_STRETCH
    return hardly or (made.conformal and not verdict.is_doubtful)


def _lowered(
    surface: FactoredSurface, plain: DiskMap, options: Options, phase: Phases, *, due: bool
) -> DiskMap:
    """Refine a map by the steps that are asked for, or `due`."""
    mesh, steps = surface.mesh, steps_of(plain, options, due=due)
    if steps == 0:
        return plain

    def finished(f: Complex, known: float) -> DiskMap:
        # Rotated only once, at the end: a rotation rounds all coordinates.
        return plain.moved_to(rotate(mesh, f, options.align), phase, known)

    f, near = as_complex(plain.uv), not plain.steps_due
    how = options, phase, surface.analysis
    return refined(plain, f, DISK, surface.rows, steps, finished, *how, near=near)


def _causes(done: DiskMap) -> Iterator[str]:
    """Say what may have kept a map from being conformal."""
    if done.boundary.name == "arc length":
        yield f"the boundary {'began' if done.is_embedded else 'lies'} by arc length"
        yield from (reason for reason in done.boundary.rejected if "crowding" in reason)
    if done.is_repaired:
        yield f"repair of flipped faces moved {done.repaired_share:.0%} of the vertices"
