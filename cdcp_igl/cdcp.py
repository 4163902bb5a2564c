"""Constructive disk conformal parameterization: Algorithm 1, one line a step."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from .arrays import Floats
from .center import CenterMethod, central_face
from .circle import maps_to_circle, spread
from .dipole import boundary_trace
from .distortion import AngleDistortion, angle_errors
from .errors import MapError
from .factor import Factor
from .injectivity import certify
from .laplacian import cotangent_laplacian
from .mesh import DiskMesh
from .mobius import normalize, rotate
from .phases import Phases, Progress
from .refine import lower_angle_distortion
from .repair import unfold
from .result import DiskMap

__all__ = ["cdcp", "disk_map"]


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
        corners, boundary fixed. Not in the paper. Most of the gain comes with the first two;
        each costs about half as much again as the map.
    refine_norm : float
        The exponent p, from 1 to 2. The default lowers mean and SD; the nearer to 1, the
        lower the mean and the higher the SD.
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
    """
    if preset not in (None, "paper"):
        raise ValueError(f'preset must be "paper" or None, not {preset!r}')
    if mobius not in ("angle", "area", None):
        raise ValueError(f'mobius must be "angle", "area" or None, not {mobius!r}')
    if not isinstance(refine, int | np.integer) or refine < 0:
        raise ValueError(f"refine must be a number of steps, 0 or more, not {refine!r}")
    if not 1 <= refine_norm <= 2:
        raise ValueError(f"refine_norm must be from 1 to 2, not {refine_norm!r}")
    paper = preset == "paper"
    if paper and (center, mobius) != ("torsion", "angle"):
        raise ValueError('preset="paper" sets center and mobius itself')

    phase = Phases(progress, refine)
    with phase("check"):
        mesh = DiskMesh(V, F)
    with phase("laplacian"):
        L = cotangent_laplacian(mesh)  # (8)
    with phase("factor"):
        factor = Factor(mesh, L)
    with phase("center"):
        tau_c = central_face(mesh, L, factor, "heat" if paper else center, well_shaped=not paper)
    with phase("trace"):
        h_B = boundary_trace(mesh, factor, tau_c.face)  # (18), Theorem 1
    attempts = maps_to_circle(mesh, L, factor, h_B, tau_c.face, whitened=not paper)  # (1)-(6)
    for f_B, extend, method in phase.each("circle", attempts):
        with phase("extension"):
            f = extend(f_B)  # (10)
        with phase("mobius"):
            f, normalization = normalize(mesh, f, "nelder-mead" if paper else mobius)  # (19), (20)
        with phase("repair"):
            f, n_spread = spread(mesh, f, extend)
            boundary = replace(method, n_spread=n_spread)
            f, repair = unfold(mesh, rotate(mesh, f, align))
        with phase("refine") as advance:
            refinement = None
            if refine:
                f, refinement = lower_angle_distortion(mesh, f, refine, refine_norm, advance)
        with phase("certificate"):
            uv = np.column_stack([f.real, f.imag])
            certificate = certify(mesh, uv)
            degrees = np.degrees(abs(angle_errors(mesh, f)))
            distortion = AngleDistortion.of(degrees)
            free = distortion
            if 0 < len(mesh.inscribed) < len(mesh.F):
                free = AngleDistortion.of(np.delete(degrees, mesh.inscribed, axis=0))
        if certificate.valid:
            break
    phase.done()

    result = DiskMap(
        uv=uv,
        certificate=certificate,
        distortion=distortion,
        distortion_free=free,
        center=tau_c,
        trace=boundary,
        repair=repair,
        mobius=normalization,
        refinement=refinement,
        solver=factor.solver,
        timings=phase.seconds,
    )
    if not certificate.valid:
        raise MapError(
            f"The map is not a bijection onto the disk: {certificate}. Boundary: {boundary}", result
        )
    return result
