"""The prefactored object: maps one surface again and again."""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy
from itertools import islice
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from .algorithm import HarmonicMap, Options, certified_map, harmonic_maps
from .phases import Phases, Progress
from .result import DiskMap
from .solve.factor import Factor
from .solve.laplacian import cotangent_laplacian
from .steps.center import CenterMethod
from .surface.mesh import DiskMesh

__all__ = ["DiskMapper"]


class DiskMapper:
    """A surface, checked and factored, to be mapped onto the disk more than once.

    Checks and factorization, most of the time of `disk_map`, are done once, here. Another
    centre then costs three solves and the boundary; another Möbius transformation,
    alignment or refinement starts from the last harmonic map, if it has the same centre.

    Parameters
    ----------
    V : (n, 3) or (n, 2) array_like of real numbers
        Vertex positions, in any unit. Two columns are a planar mesh.
    F : (m, 3) array_like of integers
        Corners of the faces, counterclockwise seen from outside.

    Attributes
    ----------
    mesh : DiskMesh
        The checked surface.

    Raises
    ------
    MeshError
        If the input is not a triangulated disk.
    SolverError
        If the Laplacian cannot be factored.

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

    mesh: DiskMesh

    def __init__(self, V: ArrayLike, F: ArrayLike) -> None:
        # A mesh may keep the very array of faces; this object outlives the call.
        self.mesh = DiskMesh(V, F.copy() if isinstance(F, np.ndarray) else F)
        self._L = cotangent_laplacian(self.mesh)
        self._factor = Factor(self.mesh, self._L)
        self._last: tuple[object, list[HarmonicMap]] | None = None

    def map(
        self,
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
        """Map the surface; the same map as `disk_map` with these options.

        Parameters
        ----------
        center, mobius, align, refine, refine_norm, refine_seconds, preset, progress
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
        options = Options(center, mobius, align, refine, refine_norm, refine_seconds, preset)
        key = (center, preset)
        known = self._last[1] if self._last and self._last[0] == key else []
        skipped = ["check", "laplacian", "factor"]
        if known:
            skipped += ["center", "trace", "circle", "extension"]
        phase = Phases(progress, refine, skipped)
        self._last = key, known

        def maps() -> Iterator[HarmonicMap]:
            """Make those that are known, and then others if they are asked for."""
            yield from tuple(known)
            made = harmonic_maps(self.mesh, self._L, self._factor, options, phase)
            for harmonic in islice(made, len(known), None):
                known.append(harmonic)
                yield harmonic

        return certified_map(self.mesh, self._factor, maps(), options, phase, keep_factor=True)

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
        other = copy(self)
        other.mesh = self.mesh.moved(V)
        other._L = cotangent_laplacian(other.mesh)
        other._factor = self._factor.refactored(other._L)
        other._last = None
        return other

    def __repr__(self) -> str:
        return f"DiskMapper({self.mesh!r})"
