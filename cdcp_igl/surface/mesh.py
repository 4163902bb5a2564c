"""The checked input: a triangulated topological disk."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Bools, Floats, Ints, marked, places
from ..cached import cached_property
from ..errors import Defect, MeshError, counted
from .checking import examine
from .topology import Edges
from .triangles import corner_angles, corner_cotangents, degenerate_faces
from .validation import checked_vertices, size_exponent


@dataclass(frozen=True, eq=False, init=False, repr=False)
class DiskMesh:
    """A triangulated disk: checked, indexed, immutable.

    The only way into the algorithm. One component, every edge on one or two faces,
    consistently oriented, every vertex a manifold vertex, one boundary loop, Euler
    characteristic 1, every vertex used, coordinates finite, no degenerate face.

    Parameters
    ----------
    V : (n, 3) or (n, 2) array_like of real numbers
        Vertex positions, in any unit. Two columns are a planar mesh.
    F : (m, 3) array_like of integers
        Corners of the faces, rows of V, counterclockwise seen from outside.

    Attributes
    ----------
    V : (n, 3) float64, read-only
        The positions, scaled by a power of two (which is exact) so that the largest
        coordinate lies between 1/2 and 1.
    F : (m, 3) int64, read-only
        The faces.
    loop : (nB,) int64, read-only
        Boundary vertices in order, the surface on their left, from the smallest index.
    interior : (nI,) int64, read-only
        The other vertices, ascending.
    on_boundary : (n,) bool, read-only
        Which vertices are on the boundary.
    edges : Edges
        Its undirected edges.
    cotangents : (m, 3) float64, read-only
        Cotangents of the corner angles, column k at corner k.

    Raises
    ------
    MeshError
        If the input is no disk. It names the defect, the offending rows and the
        remedy, and lists the other defects.
    """

    V: Floats
    F: Ints
    loop: Ints
    interior: Ints
    on_boundary: Bools
    edges: Edges
    cotangents: Floats
    _exponent: int

    def __init__(self, V: ArrayLike, F: ArrayLike) -> None:
        examined = examine(V, F)
        if examined.surface is None or examined.defects:
            raise MeshError(*examined.defects)
        surface = examined.surface
        [loop] = surface.loops
        on_boundary = marked(surface.n, loop)
        edges = surface.edges
        for indices in (edges.low, edges.high, edges.sides, edges.start):
            indices.flags.writeable = False
        self._set(
            V=examined.V,
            F=surface.F,
            loop=loop,
            interior=np.flatnonzero(~on_boundary),
            on_boundary=on_boundary,
            cotangents=examined.cotangents,
        )
        object.__setattr__(self, "edges", edges)
        object.__setattr__(self, "_exponent", size_exponent(np.asarray(V)))

    def __setstate__(self, state: dict[str, Any]) -> None:
        # Arrays that were pickled come back writeable.
        for value in (*state.values(), *vars(state["edges"]).values()):
            if isinstance(value, np.ndarray):
                value.flags.writeable = False
        self.__dict__.update(state)

    def _set(self, **arrays: NDArray[Any]) -> None:
        for name, array in arrays.items():
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    @property
    def positions(self) -> Floats:
        """(n, 3) the vertices in the unit in which they were given."""
        return self.in_given_unit(self.V)

    def in_given_unit(self, lengths: Floats) -> Floats:
        """Take lengths in the unit of `V` to that in which the vertices were given, exactly."""
        return np.ldexp(lengths, self._exponent)

    @cached_property
    def angles(self) -> Floats:
        """(m, 3) corner angles of the surface in radians, column k at corner k; read-only."""
        angles = corner_angles(self.cotangents)
        angles.flags.writeable = False
        return angles

    @cached_property
    def inscribed(self) -> Ints:
        """(k,) faces with all three corners on the boundary, read-only.

        On the disk they are inscribed in the circle, and the circle fixes their angles.
        """
        i, j, k = self.on_boundary.take(self.F.T)
        inscribed = np.flatnonzero(i & j & k)
        inscribed.flags.writeable = False
        return inscribed

    @cached_property
    def loop_index(self) -> Ints:
        """(n,) index of each vertex in ``loop``, -1 inside; read-only."""
        index = places(self.loop, len(self.V))
        index.flags.writeable = False
        return index

    def moved(self, V: ArrayLike) -> DiskMesh:
        """Return the mesh with its vertices elsewhere; what is known of its faces is kept.

        MeshError if V has another number of rows, is not finite, or makes a face degenerate.
        """
        positions = checked_vertices(V)
        if len(positions) != len(self.V):
            rows, n = len(positions), len(self.V)
            raise MeshError(Defect.of("shape of V, of a mesh", rows=rows, vertices=n))
        cotangents = corner_cotangents(positions, self.F)
        if len(flat := degenerate_faces(cotangents)):
            raise MeshError(Defect.of("degenerate face", flat))
        mesh = copy(self)
        mesh.__dict__.pop("angles", None)
        mesh._set(V=positions, cotangents=cotangents)
        object.__setattr__(mesh, "_exponent", size_exponent(np.asarray(V)))
        return mesh

    def __repr__(self) -> str:
        return (
            f"DiskMesh({len(self.V):,} vertices, {counted(len(self.F), 'face', 'faces')}, "
            f"{len(self.loop):,} boundary vertices)"
        )
