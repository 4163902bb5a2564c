"""Constructive disk conformal parameterization: Algorithm 1, one line a step."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from .arrays import Complex, Floats
from .rescue.boundary import FALLBACKS, Rejected, by_trace, whitened_geodesic_map
from .rescue.harmonic_map import HarmonicMap
from .result.disk_map import DiskMap
from .selection import best_map
from .solve.factored import FactoredSurface
from .solve.laplacian import cotangent_laplacian
from .solve.solvers import SolverName, using
from .steps.center import Center, CenterMethod, central_face
from .steps.mobius import MobiusMethod, normalize
from .steps.options import Options
from .steps.phases import Phases, Progress
from .steps.trace import boundary_trace, conjugate_trace
from .steps.zipper import geodesic_map
from .surface.mesh import DiskMesh

__all__ = ["Attempts", "Steps", "algorithm_1", "cdcp", "disk_map"]


def cdcp(
    V: ArrayLike,
    F: ArrayLike,
    *,
    center: CenterMethod | int = "torsion",
    mobius: Literal["angle", "area"] | None = "angle",
    align: int | ArrayLike | None = None,
    refine: int = 0,
    refine_norm: float = 1.5,
    refine_seconds: float = np.inf,
    preset: Literal["paper"] | None = None,
    solver: SolverName | None = None,
    progress: Progress | None = None,
) -> Floats:
    """Map a triangulated disk conformally onto the unit disk.

    Parameters
    ----------
    V : (n, 3) or (n, 2) array_like of real numbers
        Vertex positions, in any unit.
    F : (m, 3) array_like of integers
        Corners of the faces, counterclockwise seen from outside.
    center, mobius, align, refine, refine_norm, refine_seconds, preset, solver, progress
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
    options = Options(center, mobius, align, refine, refine_norm, refine_seconds, preset, solver)
    return _disk_map(V, F, options, progress).uv


def disk_map(
    V: ArrayLike,
    F: ArrayLike,
    *,
    center: CenterMethod | int = "torsion",
    mobius: Literal["angle", "area"] | None = "angle",
    align: int | ArrayLike | None = None,
    refine: int = 0,
    refine_norm: float = 1.5,
    refine_seconds: float = np.inf,
    preset: Literal["paper"] | None = None,
    solver: SolverName | None = None,
    progress: Progress | None = None,
) -> DiskMap:
    """Map a triangulated disk conformally onto the unit disk, and certify the map.

    The constructive disk conformal parameterization (CDCP) of Yueh et al., Algorithm 1.

    Parameters
    ----------
    V : (n, 3) or (n, 2) array_like of real numbers
        Vertex positions, in any unit. Two columns are a planar mesh.
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
        that way. None is the boundary vertex of smallest index.
    refine : int
        Steps of refinement, 0 for none: Gauss-Newton on the sum of |angle error|^p over all
        corners; boundary vertices slide on the circle. Not in the paper. Most of the gain
        comes with the first two; five take one to three times as long as the map itself. A
        harmonic map that is measurably not near the conformal one has two steps in any case.
        One that is not conformal, or had to be replaced by repair, has up to 100, as long as
        each gains a thousandth; above 5,000 vertices, from the 20th on, three.
    refine_norm : float
        The exponent p, from 1 to 2. The default lowers mean and SD; the nearer to 1, the
        lower the mean and the higher the SD.
    refine_seconds : float
        Time limit of the refinement: after so many seconds no step is begun. The map is the
        best until then, ``result.refinement.stopped`` says so, and it depends on the speed of
        the machine; without a limit, equal inputs have equal outputs.
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
        If an option is not one of those above; nothing has been computed then. Or, once there
        is a map, if the surface has no slope in the direction `align`.
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
    options = Options(center, mobius, align, refine, refine_norm, refine_seconds, preset, solver)
    return _disk_map(V, F, options, progress)


def _disk_map(V: ArrayLike, F: ArrayLike, options: Options, progress: Progress | None) -> DiskMap:
    phase = Phases(progress, options.refine)
    with using(options.solver):
        surface = factored_surface(V, F, options, phase)
        return map_of(surface, options, phase, keep_factor=False)


def factored_surface(
    V: ArrayLike, F: ArrayLike, options: Options, phase: Phases
) -> FactoredSurface:
    """Check the surface and the options, and factor the Laplacian."""
    with phase("check"):
        mesh = DiskMesh(V, F)
        options.check_rows(mesh)
    with phase("laplacian"):
        L = cotangent_laplacian(mesh)  # (8)
    with phase("factor"):
        return FactoredSurface(mesh, L)


def map_of(
    surface: FactoredSurface, options: Options, phase: Phases, *, keep_factor: bool
) -> DiskMap:
    """Map a factored surface once; `keep_factor` as in `best_map`."""
    attempts = Attempts(surface, Steps.of(options))
    return best_map(surface, attempts, options, phase, keep_factor=keep_factor)


@dataclass(frozen=True)
class Steps:
    """The steps of Algorithm 1 that can be taken in more than one way.

    Attributes
    ----------
    center : callable
        The central face of a `FactoredSurface`, sect. 4.1.
    trace : callable
        The boundary trace (nB,) for a surface and its central face, Theorem 1.
    circle : callable
        The exterior map of a closed curve (nB,) onto the circle, eqs. (1)-(6).
    mobius : {"angle", "area", "nelder-mead"} or None
        What the Möbius transformation minimises, eqs. (19)-(20).
    straightened : bool
        Whether the shear that all faces have in common is taken out before that; not in the
        paper.
    """

    center: Callable[[FactoredSurface], Center] = central_face
    trace: Callable[[FactoredSurface, int], Complex] = conjugate_trace
    circle: Callable[[Complex], Complex] = whitened_geodesic_map
    mobius: MobiusMethod | None = "angle"
    straightened: bool = True

    @classmethod
    def of(cls, options: Options) -> Steps:
        """Choose the steps that the options of `disk_map` ask for."""
        if options.paper:
            coldest = partial(central_face, center="heat", well_shaped=False)
            return cls(
                coldest, boundary_trace, geodesic_map, options.mobius_method, straightened=False
            )
        return cls(partial(central_face, center=options.center), mobius=options.mobius_method)


class Attempts:
    """The harmonic maps of one surface, each made when it is first asked for.

    The first is that of Algorithm 1; the others stand in for it where its trace gives no map,
    or one that cannot be certified or is not conformal.

    Parameters
    ----------
    surface : FactoredSurface
    steps : Steps
    """

    def __init__(self, surface: FactoredSurface, steps: Steps) -> None:
        self.surface, self.steps = surface, steps
        self._center: Center | None = None
        self._made: dict[int, HarmonicMap | Rejected] = {}

    def __iter__(self) -> Iterator[Callable[[Phases], HarmonicMap]]:
        return (partial(self.make, number) for number in range(1 + len(FALLBACKS)))

    def make(self, number: int, phase: Phases) -> HarmonicMap:
        """Do the first half of Algorithm 1, from the factor to a harmonic map; or Rejected."""
        if number not in self._made:
            try:
                self._made[number] = self._harmonic_map(number, phase)
            except Rejected as rejected:
                self._made[number] = rejected
        made = self._made[number]
        if isinstance(made, Rejected):
            raise made
        return made

    def _harmonic_map(self, number: int, phase: Phases) -> HarmonicMap:
        surface, steps = self.surface, self.steps
        if self._center is None:
            with phase("center"):
                self._center = steps.center(surface)  # sect. 4.1
        tau_c = self._center
        if number == 0:
            with phase("trace"):
                h_B = steps.trace(surface, tau_c.face)  # Theorem 1
            with phase("circle"):
                boundary = by_trace(surface, h_B, steps.circle)  # (1)-(6)
        else:
            with phase("circle"):
                boundary = FALLBACKS[number - 1](surface, tau_c.face)
        with phase("extension"):
            straightened = steps.straightened
            return HarmonicMap.of(surface.mesh, boundary, tau_c, straightened=straightened)  # (10)

    @property
    def started(self) -> bool:
        """Whether the first map has been made."""
        return 0 in self._made


def algorithm_1(surface: FactoredSurface, steps: Steps) -> Complex:
    """Algorithm 1 as it stands: no fallback, no repair, no certificate.

    Parameters
    ----------
    surface : FactoredSurface
    steps : Steps

    Returns
    -------
    (n,) complex128

    Raises
    ------
    Rejected
        If the trace gives no map of the boundary onto the circle.
    """
    harmonic = Attempts(surface, steps).make(0, Phases())
    f, _ = normalize(surface.mesh, harmonic.f, steps.mobius)  # (19), (20)
    return f
