"""Constructive disk conformal parameterization: Algorithm 1, one line a step."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from .arrays import Complex, Floats
from .certificate import certify
from .distortion import AngleDistortion, angle_errors
from .errors import MapError
from .phases import Phases, Progress
from .result import DiskMap
from .solve.factor import Factor
from .solve.laplacian import Laplacian, cotangent_laplacian
from .steps.center import Center, CenterMethod, central_face
from .steps.circle import BoundaryMethod, maps_to_circle, spread
from .steps.dipole import boundary_trace
from .steps.mobius import normalize, rotate
from .steps.refine import lower_angle_distortion
from .steps.repair import unfold
from .surface.mesh import DiskMesh

__all__ = ["HarmonicMap", "Options", "cdcp", "certified_map", "disk_map", "harmonic_maps"]


def cdcp(V: ArrayLike, F: ArrayLike, **options: Any) -> Floats:
    """Map a triangulated disk conformally onto the unit disk.

    Parameters
    ----------
    V : (n, 3) or (n, 2) array_like of real numbers
        Vertex positions, in any unit.
    F : (m, 3) array_like of integers
        Corners of the faces, counterclockwise seen from outside.
    **options
        Those of `disk_map`.

    Returns
    -------
    (n, 2) float64
        ``disk_map(V, F, **options).uv``.

    Raises
    ------
    MeshError, SolverError, MapError
        As `disk_map`.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.spherical_cap(20)
    >>> uv = cdcp_igl.cdcp(V, F)
    >>> uv.shape == (len(V), 2)
    True
    """
    return disk_map(V, F, **options).uv


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
        comes with the first two; the first costs about two thirds of the map itself, each further
        one half.
    refine_norm : float
        The exponent p, from 1 to 2. The default lowers mean and SD; the nearer to 1, the
        lower the mean and the higher the SD.
    refine_seconds : float
        Time limit of the refinement: after so many seconds no step is begun. The map is the
        best until then, ``result.refinement.stopped`` says so, and it depends on the speed of
        the machine; without a limit, equal inputs have equal outputs.
    preset : {"paper"} or None
        ``"paper"`` follows the paper to the letter where it is right: coldest face by
        heat, no whitening of the trace, Nelder-Mead over all faces. Not to be combined
        with `center` and `mobius`.
    progress : callable, optional
        Called as ``progress(phase, fraction)`` when a phase begins, and after each step of
        refinement.

    Returns
    -------
    DiskMap
        ``uv`` (n, 2) with the certificate, the distortion, and what was used.

    Raises
    ------
    MeshError
        If the input is not a triangulated disk.
    SolverError
        If the Laplacian cannot be factored.
    MapError
        If no map is a bijection onto the disk, which the crowding of a surface that is too
        long and thin for double precision may prevent; the last one is its ``result``.
    ValueError
        If an option is not one of those above.

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
    options = Options(center, mobius, align, refine, refine_norm, refine_seconds, preset)
    phase = Phases(progress, refine)
    with phase("check"):
        mesh = DiskMesh(V, F)
    with phase("laplacian"):
        L = cotangent_laplacian(mesh)  # (8)
    with phase("factor"):
        factor = Factor(mesh, L)
    maps = harmonic_maps(mesh, L, factor, options, phase)
    return certified_map(mesh, factor, maps, options, phase, keep_factor=False)


@dataclass(frozen=True, eq=False)
class Options:
    """The options of `disk_map`; ValueError if one is none of those allowed."""

    center: CenterMethod | int = "torsion"
    mobius: Literal["angle", "area"] | None = "angle"
    align: int | ArrayLike | None = None
    refine: int = 0
    refine_norm: float = 1.5
    refine_seconds: float = np.inf
    preset: Literal["paper"] | None = None

    def __post_init__(self) -> None:
        if self.preset not in (None, "paper"):
            raise ValueError(f'preset must be "paper" or None, not {self.preset!r}')
        if self.mobius not in ("angle", "area", None):
            raise ValueError(f'mobius must be "angle", "area" or None, not {self.mobius!r}')
        if not isinstance(self.refine, int | np.integer) or self.refine < 0:
            raise ValueError(f"refine must be a number of steps, 0 or more, not {self.refine!r}")
        if not 1 <= self.refine_norm <= 2:
            raise ValueError(f"refine_norm must be from 1 to 2, not {self.refine_norm!r}")
        if not self.refine_seconds >= 0:
            raise ValueError(f"refine_seconds must be 0 or more, not {self.refine_seconds!r}")
        if self.paper and (self.center, self.mobius) != ("torsion", "angle"):
            raise ValueError('preset="paper" sets center and mobius itself')

    @property
    def paper(self) -> bool:
        """Whether to follow the paper to the letter."""
        return self.preset == "paper"


@dataclass(frozen=True, eq=False)
class HarmonicMap:
    """The map before its normalisation: it depends on `center` and `preset` only.

    Attributes
    ----------
    f : (n,) complex128
    extend : callable
        Extends boundary values harmonically to all of the surface.
    center : Center
    trace : BoundaryMethod
    """

    f: Complex
    extend: Callable[[Complex], Complex]
    center: Center
    trace: BoundaryMethod


def harmonic_maps(
    mesh: DiskMesh, L: Laplacian, factor: Factor, options: Options, phase: Phases
) -> Iterator[HarmonicMap]:
    """Do the first half of Algorithm 1: from the factor to harmonic maps onto the disk.

    The second and third are for where the one before cannot be certified.
    """
    paper = options.paper
    center = "heat" if paper else options.center
    with phase("center"):
        tau_c = central_face(mesh, L, factor, center, well_shaped=not paper)
    with phase("trace"):
        h_B = boundary_trace(mesh, factor, tau_c.face)  # (18), Theorem 1
    attempts = maps_to_circle(mesh, L, factor, h_B, tau_c.face, whitened=not paper)  # (1)-(6)
    for f_B, extend, boundary in phase.each("circle", attempts):
        with phase("extension"):
            f = extend(f_B)  # (10)
        yield HarmonicMap(f, extend, tau_c, boundary)


def certified_map(
    mesh: DiskMesh,
    factor: Factor,
    maps: Iterator[HarmonicMap],
    options: Options,
    phase: Phases,
    *,
    keep_factor: bool,
) -> DiskMap:
    """Normalise one map after the other until one is certified; MapError if none is."""
    for harmonic in maps:
        result = normalized_map(mesh, factor, harmonic, options, phase, keep_factor=keep_factor)
        if result.certificate.valid:
            phase.done()
            return result
    raise MapError(
        f"The map is not a bijection onto the disk: {result.certificate}. Boundary: {result.trace}",
        result,
    )


def normalized_map(
    mesh: DiskMesh,
    factor: Factor,
    harmonic: HarmonicMap,
    options: Options,
    phase: Phases,
    *,
    keep_factor: bool,
) -> DiskMap:
    """Do the second half: the Möbius transformation, repair, refinement, certificate."""
    with phase("mobius"):
        method = "nelder-mead" if options.paper else options.mobius
        f, normalization = normalize(mesh, harmonic.f, method)  # (19), (20)
    with phase("repair"):
        f, n_spread = spread(mesh, f, harmonic.extend)
        f, repair = unfold(mesh, rotate(mesh, f, options.align))
    with phase("refine") as advance:
        refinement = None
        if options.refine:
            if not keep_factor:  # refinement makes its own, and no fallback needs this one
                factor.release()
            f, refinement = lower_angle_distortion(
                mesh,
                f,
                factor.order,
                options.refine,
                options.refine_norm,
                seconds=options.refine_seconds,
                turn=partial(rotate, mesh, align=options.align),
                advance=advance,
            )
    with phase("certificate"):
        uv = np.column_stack([f.real, f.imag])
        certificate = certify(mesh, uv)
        degrees = np.degrees(abs(angle_errors(mesh, f)))
        distortion = AngleDistortion.of(degrees)
        free = distortion
        if 0 < len(mesh.inscribed) < len(mesh.F):
            free = AngleDistortion.of(np.delete(degrees, mesh.inscribed, axis=0))
    return DiskMap(
        uv=uv,
        mesh=mesh,
        certificate=certificate,
        distortion=distortion,
        distortion_free=free,
        center=harmonic.center,
        trace=replace(harmonic.trace, n_spread=n_spread),
        repair=repair,
        mobius=normalization,
        refinement=refinement,
        solver=factor.solver,
        timings=phase.seconds,
    )
