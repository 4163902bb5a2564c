"""The prefactored object: maps one surface again and again."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any, Literal, overload

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import typed
from ..arrays import Complex
from ..io.given import OfGiven, takes_meshes, tell
from ..options import Options
from ..phases import Phases, Progress
from ..result.base import announced
from ..result.disk_map import DiskMap
from ..result.free_map import FreeMap
from ..solve.factored import FactoredSurface
from ..solve.solvers import SolverName, using
from ..steps.center import Center, CenterMethod
from ..surface.mesh import DiskMesh, Mesh
from .disk import DiskProblem
from .free import (
    OF_THE_DISK,
    FreeProblem,
    as_given,
    boundary_of,
    check_boundary,
    pinned_to,
    places_of,
)
from .problem import solve

# Phases of maps that a mapper has behind it from the beginning, or once it has a harmonic map.
BEFORE = ("check", "laplacian", "factor")
HARMONIC = ("center", "trace", "circle", "extension")


class DiskMapper(OfGiven):
    """A surface, checked and factored, to be mapped onto the disk more than once.

    Checks and factorization, most of the time of `disk_map`, are done once, here. Another
    centre then costs three solves and the boundary; another Möbius transformation,
    alignment or refinement starts from the last harmonic map, if it has the same centre.

    It can be pickled and copied, and be sent to other processes so; the factor is made again
    on arrival.

    Parameters
    ----------
    V, F, solver
        As in `disk_map`; the solver is for all maps.

    Attributes
    ----------
    mesh : DiskMesh
        The checked surface.

    Raises
    ------
    MeshError, SolverError, ValueError, ImportError
        As `disk_map`.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.spherical_cap(20)
    >>> mapper = cdcp_igl.DiskMapper(V, F)
    >>> conformal, even = mapper.map(), mapper.map(mobius="area")
    >>> sorted(set(conformal.timings) - set(even.timings))
    ['center', 'circle', 'extension', 'trace']
    >>> stretched = mapper.moved(V * [1, 1, 2]).map()
    >>> stretched.certificate.valid
    True
    """

    @overload
    def __init__(self, V: ArrayLike, F: ArrayLike, *, solver: SolverName | None = None) -> None: ...
    @overload
    def __init__(self, mesh: object, *, solver: SolverName | None = None) -> None: ...
    @takes_meshes  # type: ignore[arg-type, misc]
    def __init__(self, V: ArrayLike, F: ArrayLike, *, solver: SolverName | None = None) -> None:
        mesh = DiskMesh(V, F)
        self._solver = solver
        with using(solver):
            self._surface = FactoredSurface.of(mesh)
        self._known: dict[object, tuple[Center, Complex]] = {}

    @property
    def mesh(self) -> Mesh:
        """The checked surface."""
        return self._surface.mesh

    @typed
    def map(
        self,
        *,
        center: CenterMethod | int = "torsion",
        mobius: Literal["angle", "area"] | None = "angle",
        align: int | ArrayLike | None = None,
        refine: int | None = None,
        refine_norm: float = 1.5,
        refine_seconds: float = np.inf,
        keep: float | str = "angles",
        preset: Literal["paper"] | None = None,
        progress: Progress | None = None,
    ) -> DiskMap:
        """Map the surface; the same map as `disk_map` with these options.

        Parameters
        ----------
        center, mobius, align, refine, refine_norm, refine_seconds, keep, preset, progress
            As in `disk_map`.

        Returns
        -------
        DiskMap
            Its ``timings`` have the phases that this call went through.

        Raises
        ------
        SolverError, MapError, ValueError
            As `disk_map`.
        """
        options = Options(
            center, mobius, align, refine, refine_norm, refine_seconds, preset, keep=keep
        )
        options.check_rows(len(self.mesh.F), self.mesh.loop)
        known = options.first_steps in self._known
        phase = Phases(progress, refine or 0, BEFORE + HARMONIC * known)
        with using(self._solver):
            made = announced(solve(DiskProblem(self._surface, options, phase, self._known)))
            tell(made, vars(self))
            return made

    @typed
    def free(
        self,
        *,
        boundary_scale: ArrayLike | None = None,
        corners: Mapping[int, float] | None = None,
        align: int | ArrayLike | None = None,
        refine: int | None = None,
        refine_norm: float = 1.5,
        refine_seconds: float = np.inf,
        keep: float | str = "angles",
        pins: Mapping[int, ArrayLike] | None = None,
        progress: Progress | None = None,
    ) -> FreeMap:
        """Map the surface with a free outline; the same map as `free_map` with these options.

        Parameters
        ----------
        boundary_scale, corners, align, refine, refine_norm, refine_seconds, keep, pins,
        progress
            As in `free_map`.

        Returns
        -------
        FreeMap

        Raises
        ------
        SolverError, MapError, ValueError
            As `free_map`.
        """
        options = Options(
            align=align,
            refine=refine,
            refine_norm=refine_norm,
            refine_seconds=refine_seconds,
            keep=keep,
        )
        check_boundary(boundary_scale, corners, pins, options)
        options.check_rows(len(self.mesh.F), self.mesh.loop)
        phase = Phases(progress, refine or 0, (*BEFORE, *OF_THE_DISK))
        with using(self._solver):
            boundary = boundary_of(self.mesh, boundary_scale, corners)
            problem = FreeProblem(self._surface, boundary, options, phase, keep_factor=True)
            made = announced(as_given(solve(problem)))
            made = pinned_to(made, places_of(pins, len(self.mesh.scaled)), phase)
            tell(made, vars(self))
            return made

    def moved(self, V: ArrayLike) -> DiskMapper:
        """Take the same faces with moved vertices: no topological checks, no new ordering.

        Parameters
        ----------
        V : (n, 3) or (n, 2) array_like of real numbers
            As many rows as before; row i is the new place of vertex i.

        Returns
        -------
        DiskMapper
            This one stays as it is.

        Raises
        ------
        MeshError
            If V has another number of rows, is not finite, or makes a face degenerate.
        SolverError
            If the Laplacian cannot be factored.
        """
        other = DiskMapper.__new__(DiskMapper)
        other._solver = self._solver
        other._surface = self._surface.moved(V)
        other._known = {}
        tell(other, {**vars(self), "source": None})  # which holds other places
        return other

    def __reduce__(self) -> tuple[Any, ...]:
        # The factor is in memory of the solver: another process makes its own on arrival.
        made = partial(DiskMapper, solver=self._solver), (self.mesh.V, self.mesh.F)
        told = "source", "given_rows", "given_faces"
        return *made, {name: getattr(self, name) for name in told}

    def __repr__(self) -> str:
        return f"DiskMapper({self.mesh!r})"
