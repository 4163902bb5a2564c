"""The reader of V and F, and every defect of theirs.

`read` tells what is wrong with the arrays, `usable_arrays` and `checked_surface` raise it;
`examine` finds what keeps them from being a disk, before libigl is called, which crashes the
process on some inputs and answers others with NaN.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Bools, Floats, Ints, distinct_rows, size_exponent, unit_size
from ..errors import Defect, MeshError
from .topology import Topology, by_reach, duplicate_faces
from .triangles import corner_cotangents, degenerate_faces

# What stands for no data in terrains and scans: as formats write it.
NO_DATA = {-9999.0, -99999.0, -32768.0, -32767.0, 9999.0, 99999.0, 32767.0, 65535.0}
NO_DATA |= {s * x for s in (-1.0, 1.0) for x in (1e20, 1e30, float(np.finfo(np.float32).max))}
FAR = 5


class Given(NamedTuple):
    """V and F as they were given.

    V has 2 or 3 numeric columns and F (m, 3) indices in range; None if there is no such array.
    """

    V: NDArray[Any] | None
    F: Ints | None
    defects: tuple[Defect, ...]


def read(V: ArrayLike, F: ArrayLike) -> Given:
    """Read a surface; the defects are those of the arrays, and faces with a repeated corner."""
    if _are_swapped(V, F):
        return Given(None, None, (Defect.of("V and F swapped"),))
    try:
        vertices = _vertices(V)
    except MeshError as error:
        return Given(None, None, error.defects)
    defects = _non_finite(vertices)
    try:
        faces = _faces(F, len(vertices))
    except MeshError as error:
        return Given(vertices, None, (*defects, *error.defects))
    if faces.min() == 1 and _are_from_one(vertices, faces):
        return Given(vertices, None, (*defects, Defect.of("indices from 1")))
    if len(repeated := repeated_corners(faces)):
        defects += (Defect.of("repeated corner", repeated),)
    return Given(vertices, faces, defects)


def usable_arrays(V: ArrayLike, F: ArrayLike) -> tuple[NDArray[Any], Ints]:
    """Read V as given, of 2 or 3 columns, finite or not, and a copy of F; MeshError if unusable."""
    given = read(V, F)
    if given.V is None or given.F is None:
        raise MeshError(given.defects[-1])
    return given.V, given.F


def checked_surface(V: ArrayLike, F: ArrayLike) -> tuple[Floats, Ints]:
    """Read V (n, 3), scaled to unit size, and F; MeshError for any defect of theirs."""
    given = read(V, F)
    if given.V is None or given.F is None or given.defects:
        raise MeshError(*given.defects)
    return unit_size(given.V), given.F


def checked_vertices(V: ArrayLike, name: str = "V") -> Floats:
    """Read V (n, 3), scaled to unit size; MeshError if it is none, or not finite."""
    given = _vertices(V, name)
    if defects := _non_finite(given, name):
        raise MeshError(*defects)
    return unit_size(given)


def without_data(V: NDArray[Any], F: Ints) -> tuple[Ints, str]:
    """Vertices that stand for points that were not measured, and where they lie.

    They have one place, as (0, 0, 0), with faces that lie there as a whole; or a coordinate that
    formats write where there are no data, as -9999; and edges FAR times as long as the median
    lead to them, four vertices or more.
    """
    found, where = np.empty(0, np.int64), ""
    columns = np.ascontiguousarray(V.T)  # whose extremes take a tenth of the time
    for extreme in (np.fmin.reduce(columns, axis=1), np.fmax.reduce(columns, axis=1)):
        for axis, value in enumerate(extreme.tolist()):
            if value in NO_DATA and _is_far(V, F, there := V[:, axis] == value):
                found, where = np.flatnonzero(there), f"{'xyz'[axis]} = {value:g}"
    x = columns[0].take(F)
    flat = F[(x[:, 0] == x[:, 1]) & (x[:, 1] == x[:, 2])]
    whole = (V[flat] == V[flat[:, :1]]).all(axis=(1, 2))
    if not whole.any():  # nearly always
        return found, where
    for place in np.unique(V[flat[whole, 0]], axis=0):
        if _is_far(V, F, there := (place == V).all(axis=1)):
            found = np.union1d(found, np.flatnonzero(there))
            where = where or f"({', '.join(f'{x:g}' for x in place.tolist())})"
    return found, where


def _is_far(V: NDArray[Any], F: Ints, there: Bools) -> bool:
    """Whether some vertices, four or more, have long edges to all others."""
    edges = np.concatenate([F[:, [0, 1]], F[:, [1, 2]], F[:, [2, 0]]])
    n_ends = there[edges].sum(axis=1)
    with np.errstate(over="ignore", invalid="ignore"):
        length = np.linalg.norm(V[edges[:, 0]].astype(float) - V[edges[:, 1]], axis=1)
    if there.sum() < 4 or not (n_ends == 1).any() or not (n_ends == 0).any():
        return False
    return bool(np.median(length[n_ends == 1]) > FAR * np.median(length[n_ends == 0]))


def repeated_corners(F: Ints) -> Ints:
    """Faces with the same vertex at two corners."""
    i, j, k = F.T
    return np.flatnonzero((i == j) | (j == k) | (k == i))


@dataclass(frozen=True, eq=False)
class Examined:
    """Arrays in their final form, what was computed from them, and all defects."""

    n_vertices: int  # rows of V and of F; 0 where the array is unusable
    n_faces: int
    defects: tuple[Defect, ...]
    V: Floats = field(default_factory=lambda: np.empty((0, 3)))  # of unit size
    exponent: int = 0  # of the power of two by which they were divided
    surface: Topology | None = None  # None if unusable, or if a corner is repeated
    loops: list[Ints] = field(default_factory=list)  # those of the surface, the outer one first
    cotangents: Floats = field(default_factory=lambda: np.empty((0, 3)))  # if all is finite


def examine(V: ArrayLike, F: ArrayLike) -> Examined:
    """Check everything that `DiskMesh` promises."""
    given = read(V, F)
    found = list(given.defects)
    names = {defect.name for defect in found}
    n, m = (0 if array is None else len(array) for array in (given.V, given.F))
    if given.V is None or given.F is None or "repeated corner" in names:
        return Examined(n, m, tuple(found))

    positions, exponent = unit_size(given.V), size_exponent(given.V)
    surface = Topology(given.F, n)
    lost, place = without_data(given.V, given.F)
    if len(lost):
        found.append(Defect.of("points without data", lost, place=place))
    found += _defects_of_edges(surface)
    if not surface.singular.any():
        found += _defects_of_a_surface(surface, given.V)
    loops = by_reach(positions, surface.loops)
    if "non-finite coordinate" in names:
        return Examined(n, m, tuple(found), positions, exponent, surface, loops)
    cotangents = corner_cotangents(positions, given.F)
    if len(flat := degenerate_faces(cotangents)):
        found.append(Defect.of("degenerate face", flat))
    return Examined(n, m, tuple(found), positions, exponent, surface, loops, cotangents)


def _defects_of_edges(surface: Topology) -> Iterator[Defect]:
    if not surface.used.all():
        yield Defect.of("unreferenced vertex", np.flatnonzero(~surface.used))
    singular = surface.singular
    # A face and its copy close each other: without a third one at an edge they are all there is.
    if singular.any() or np.bincount(surface.components[1]).min() == 2:
        duplicates = duplicate_faces(surface.F)
        if len(duplicates):
            yield Defect.of("duplicate face", duplicates)
    if singular.any():
        yield Defect.of("non-manifold edge", surface.edges.ends(singular))


def _defects_of_a_surface(surface: Topology, V: NDArray[Any]) -> Iterator[Defect]:
    """Where no edge has three faces; V tells which vertices coincide, and the outer loop."""
    if surface.misoriented is None:
        yield Defect.of("not orientable")
    elif len(surface.misoriented):
        yield Defect.of("inconsistent orientation", surface.misoriented)
    count, component = surface.components
    if count > 1:
        sizes = np.bincount(component)
        finite = V[np.isfinite(V).all(axis=1)]
        coincide = len(distinct_rows(finite)[0]) < len(finite)
        yield Defect.of(
            "several components" + (", coinciding" if coincide else ""),
            np.flatnonzero(component != sizes.argmax()),
            components=count,
            largest=sizes.max(),
            faces=len(component),
        )
    if len(surface.pinched):
        yield Defect.of("non-manifold vertex", surface.pinched)
        return
    if len(surface.border) == 0:
        yield Defect.of("closed surface" + (", with handles" if surface.genus else ""))
    if len(surface.loops) > count:
        outer = by_reach(V, surface.loops)[0]
        holes = np.concatenate([loop for loop in surface.loops if loop is not outer])
        loops = len(surface.loops)
        yield Defect.of("several boundary loops", holes, loops=loops, outer=len(outer))
    if surface.genus:
        yield Defect.of("handle", genus=surface.genus)


def _are_swapped(V: ArrayLike, F: ArrayLike) -> bool:
    """Whether V can only be faces of F, and F cannot be faces of V."""
    try:
        vertices = _vertices(F)
        if vertices.dtype.kind != "f" or (vertices == np.rint(vertices)).all():
            return False  # they are faces
        _faces(V, len(vertices))
    except MeshError:
        return False
    return True


def _are_from_one(V: NDArray[Any], F: Ints) -> bool:
    """Whether faces that use all vertices but the first would have far shorter edges by F - 1."""
    if not np.array_equal(np.unique(F), np.arange(1, len(V))):
        return False
    positions = unit_size(V)
    here, there = (np.square(positions[G[:, 0]] - positions[G[:, 1]]).sum() for G in (F, F - 1))
    return bool(there < 0.9 * here)


def _vertices(V: ArrayLike, name: str = "V") -> NDArray[Any]:
    given = _numeric(name, V)
    if given.ndim != 2 or given.shape[1] not in (2, 3) or len(given) < 3:
        turned = given.ndim == 2 and given.shape[0] in (2, 3) and given.shape[1] > 3
        row = "shape of V, transposed" if turned else "shape of V"
        raise MeshError(Defect.of(row, shape=given.shape))
    if given.dtype == np.longdouble:
        with np.errstate(over="ignore"):  # what is too large for float64 is infinite here
            given = given.astype(np.float64)
    return given


def _non_finite(given: NDArray[Any], name: str = "V") -> tuple[Defect, ...]:
    finite = np.isfinite(given)
    if finite.all():
        return ()
    bad = np.flatnonzero(~finite.all(axis=1))
    row = "non-finite coordinate" if name == "V" else "non-finite coordinate, of a map"
    return (Defect.of(row, bad),)


def _faces(F: ArrayLike, n: int) -> Ints:
    """(m, 3) int64 copy of F in C order."""
    given = _numeric("F", F)
    if given.ndim != 2 or given.shape[1] != 3 or len(given) == 0:
        row = "shape of F" + (", flat" if given.ndim == 1 else "")
        row = row if given.size else "shape of F, empty"
        raise MeshError(Defect.of(row, shape=given.shape))
    # Judged as given: a cast would wrap large unsigned numbers and truncate fractions.
    if not (given.min() >= 0 and given.max() < n):
        outside = np.flatnonzero(~((given >= 0) & (given < n)).all(axis=1))
        from_1 = given.min() == 1 and given.max() == n
        row = "index out of range, from 1" if from_1 else "index out of range"
        raise MeshError(Defect.of(row, outside, last=n - 1))
    faces = np.array(given, dtype=np.int64, order="C")
    if given.dtype.kind == "f" and not np.array_equal(faces, given):
        raise MeshError(Defect.of("fractional index", np.flatnonzero((faces != given).any(axis=1))))
    return faces


def _numeric(name: str, array: ArrayLike) -> NDArray[Any]:
    if np.ma.is_masked(array):  # what is missing is no number
        array = np.ma.filled(np.ma.asarray(array).astype(np.float64), np.nan)
    try:
        numeric = np.asarray(array)
    except ValueError:  # ragged
        numeric = np.empty(0, dtype=object)
    if numeric.dtype.kind not in "iuf":
        cells = isinstance(array, list) and array and hasattr(array[0], "type")
        raise MeshError(Defect.of("not numeric, cells" if cells else "not numeric", array=name))
    return numeric
