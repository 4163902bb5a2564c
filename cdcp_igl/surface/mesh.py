"""The checked input: a triangulated disk, annulus or sphere."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Bools, Floats, Ints, marked, places, size_exponent
from ..cached import cached_property
from ..errors import Defect, MeshError, counted
from .topology import Edges, group_by_edge, tails
from .triangles import corner_angles, corner_cotangents, degenerate_faces, vertex_areas
from .validation import Examined, checked_vertices, examine


@dataclass(frozen=True, eq=False, init=False, repr=False)
class Mesh:
    """Triangles and their boundary: indexed, immutable. What all maps and solvers take.

    Made directly, it is a part of a surface, of any topology, and nothing is checked: V (n, 3) and
    F as below, and the `rim`, in any order. Its subclasses check a whole surface of their kind.

    Attributes
    ----------
    V : (n, 3) float64
        The vertices in the unit in which they were given.
    F : (m, 3) int64, read-only
        The faces.
    loops : tuple of int64 arrays, read-only
        Boundary vertices of each loop in order, the surface on their left, from the smallest
        index; the loop that reaches farthest comes first. None of a part.
    loop : (nB,) int64, read-only
        The boundary vertices, one loop after the other.
    interior : (nI,) int64, read-only
        The other vertices, ascending.
    on_boundary : (n,) bool, read-only
        Which vertices are on the boundary.
    edges : Edges
        Its undirected edges.
    cotangents : (m, 3) float64, read-only
        Cotangents of the corner angles, column k at corner k.
    """

    scaled: Floats  # by a power of two: the largest coordinate lies between 1/2 and 1
    F: Ints
    loops: tuple[Ints, ...]
    loop: Ints
    interior: Ints
    on_boundary: Bools
    cotangents: Floats
    _exponent: int

    def __init__(self, V: Floats, F: Ints, rim: Ints) -> None:
        vars(self).update(loops=(), _exponent=0)
        self._index(V, F, rim, corner_cotangents(V, F))

    def _take(self, examined: Examined, defects: tuple[Defect, ...]) -> None:
        """Be a surface that was examined, unless it has these defects: MeshError."""
        if examined.surface is None or defects:
            raise MeshError(*defects)
        surface, loops = examined.surface, tuple(examined.loops)
        for indices in (*loops, *vars(surface.edges).values()):
            _read_only(indices)
        vars(self).update(loops=loops, edges=surface.edges, _exponent=examined.exponent)
        loop = np.concatenate([np.empty(0, np.int64), *loops])
        self._index(examined.V, surface.F, loop, examined.cotangents)

    def _index(self, V: Floats, F: Ints, loop: Ints, cotangents: Floats) -> None:
        on_boundary = marked(len(V), loop)
        interior = np.flatnonzero(~on_boundary)
        self._set(scaled=V, F=F, loop=loop, interior=interior, on_boundary=on_boundary)
        self._set(cotangents=cotangents)

    def __setstate__(self, state: dict[str, Any]) -> None:
        # Arrays that were pickled come back writeable.
        for value in (*state.values(), *state["loops"], *vars(state["edges"]).values()):
            if isinstance(value, np.ndarray):
                _read_only(value)
        self.__dict__.update(state)

    def _set(self, **arrays: NDArray[Any]) -> None:
        vars(self).update({name: _read_only(array) for name, array in arrays.items()})

    @property
    def V(self) -> Floats:
        """(n, 3) the vertices in the unit in which they were given, read-only."""
        return _read_only(self.in_given_unit(self.scaled))

    def in_given_unit(self, lengths: Floats) -> Floats:
        """Take lengths in the unit of `scaled` to the one of V, exactly."""
        return np.ldexp(lengths, self._exponent)

    def in_own_unit(self, lengths: Floats) -> Floats:
        """Take lengths in the unit of V to the one of `scaled`, exactly."""
        return np.ldexp(lengths, -self._exponent)

    @cached_property
    def edges(self) -> Edges:
        """Its undirected edges, read-only."""
        n = len(self.scaled)
        return group_by_edge(tails(self.F, n), n)

    @cached_property
    def angles(self) -> Floats:
        """(m, 3) corner angles of the surface in radians, column k at corner k; read-only."""
        return _read_only(corner_angles(self.cotangents))

    def angles_of(self, faces: Ints) -> Floats:
        """(k, 3) corner angles of some faces, in radians: for few of them, not all are reckoned."""
        if 2 * len(faces) > len(self.F):
            return self.angles[faces]
        return corner_angles(self.cotangents[faces])

    @cached_property
    def vertex_areas(self) -> Floats:
        """(n,) a third of the sum of the areas of the faces at each vertex; read-only."""
        return _read_only(vertex_areas(self.scaled, self.F))

    @cached_property
    def inscribed(self) -> Ints:
        """(k,) faces with all three corners on the boundary, read-only.

        On the disk they are inscribed in the circle, and the circle fixes their angles.
        """
        i, j, k = self.on_boundary.take(self.F.T)
        return _read_only(np.flatnonzero(i & j & k))

    @cached_property
    def loop_index(self) -> Ints:
        """(n,) index of each vertex in ``loop``, -1 inside; read-only."""
        return _read_only(places(self.loop, len(self.scaled)))

    def moved(self, V: ArrayLike) -> Self:
        """Return the mesh with its vertices elsewhere; what is known of its faces is kept.

        MeshError if V has another number of rows, is not finite, or makes a face degenerate.
        """
        positions = checked_vertices(V)
        if len(positions) != len(self.scaled):
            rows, n = len(positions), len(self.scaled)
            raise MeshError(Defect.of("shape of V, of a mesh", rows=rows, vertices=n))
        cotangents = corner_cotangents(positions, self.F)
        if len(flat := degenerate_faces(cotangents)):
            raise MeshError(Defect.of("degenerate face", flat))
        mesh = copy(self)
        for of_positions in ("angles", "vertex_areas"):
            mesh.__dict__.pop(of_positions, None)
        mesh._set(scaled=positions, cotangents=cotangents)
        vars(mesh)["_exponent"] = size_exponent(np.asarray(V))
        return mesh

    def part(self, faces: Ints) -> tuple[Mesh, Ints]:
        """Return some of the faces as a mesh, of any topology, and the rows of its vertices here.

        Vertices with other faces, too, count as its boundary, in no order.
        """
        vertices, corners = np.unique(self.F[faces], return_inverse=True)
        F, n = corners.reshape(-1, 3), len(vertices)
        whole = np.bincount(self.F.ravel(), minlength=len(self.scaled))[vertices]
        rim = (np.bincount(F.ravel(), minlength=n) < whole) | self.on_boundary[vertices]
        return Mesh(self.scaled[vertices], F, np.flatnonzero(rim)), vertices

    def __repr__(self) -> str:
        return (
            f"{type(self).__name__}({len(self.scaled):,} vertices, "
            f"{counted(len(self.F), 'face', 'faces')}, {len(self.loop):,} boundary vertices)"
        )


class DiskMesh(Mesh):
    """A triangulated disk: the only way into Algorithm 1.

    One component, every edge on one or two faces, consistently oriented, every vertex a manifold
    vertex, one boundary loop, Euler characteristic 1, every vertex used, coordinates finite, no
    degenerate face.

    V and F are as in `disk_map`. MeshError names the defect, the offending rows and the remedy, and
    lists the other defects.
    """

    def __init__(self, V: ArrayLike, F: ArrayLike) -> None:
        examined = examine(V, F)
        self._take(examined, examined.defects)


class SphereMesh(Mesh):
    """A triangulated sphere: no boundary loop, and no handle; else like a DiskMesh."""

    def __init__(self, V: ArrayLike, F: ArrayLike) -> None:
        examined = examine(V, F)
        defects = _without(examined, "closed surface", "several boundary loops")
        n = len(examined.loops)
        self._take(examined, (*defects, Defect.of("boundary", loops=n)) if n else defects)


class AnnulusMesh(Mesh):
    """A triangulated annulus: two boundary loops, and no handle; else like a DiskMesh."""

    def __init__(self, V: ArrayLike, F: ArrayLike) -> None:
        examined = examine(V, F)
        n = len(examined.loops)
        defects = _without(examined, *["several boundary loops"] * (n == 2))
        self._take(examined, (*defects, Defect.of("one boundary loop")) if n == 1 else defects)


def _read_only(array: NDArray[Any]) -> NDArray[Any]:
    array.flags.writeable = False
    return array


def _without(examined: Examined, *names: str) -> tuple[Defect, ...]:
    return tuple(defect for defect in examined.defects if defect.name not in names)
