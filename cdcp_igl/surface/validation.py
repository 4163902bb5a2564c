"""The reader of V and F: numeric, of the right shape, finite, all indices in range.

`read` tells all that is wrong, `usable_arrays` and `checked_surface` raise it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Floats, Ints
from ..errors import Defect, MeshError


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


def repeated_corners(F: Ints) -> Ints:
    """Faces with the same vertex at two corners."""
    i, j, k = F.T
    return np.flatnonzero((i == j) | (j == k) | (k == i))


def unit_size(given: NDArray[Any]) -> Floats:
    """(n, 3) float64 copy of positions; the largest coordinate is from 1/2 to 1.

    Coordinates that are not finite are 0.
    """
    positions = np.zeros((len(given), 3))
    np.copyto(positions[:, : given.shape[1]], given, where=np.isfinite(given))
    # By a power of two, which is exact: products of lengths stay in range in any unit.
    return np.ldexp(positions, -size_exponent(positions), out=positions)


def size_exponent(given: NDArray[Any]) -> int:
    """Find the power of two by which `unit_size` divides."""
    return int(np.frexp(max(float(given.max()), -float(given.min())))[1])


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
    try:
        numeric = np.asarray(array)
    except ValueError:  # ragged
        numeric = np.empty(0, dtype=object)
    if numeric.dtype.kind not in "iuf":
        cells = isinstance(array, list) and array and hasattr(array[0], "type")
        raise MeshError(Defect.of("not numeric, cells" if cells else "not numeric", array=name))
    return numeric
