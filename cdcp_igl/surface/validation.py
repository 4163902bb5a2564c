"""V and F as arrays: numeric, of the right shape, finite, all indices in range."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Floats, Ints
from ..errors import Defect, MeshError, counted

__all__ = [
    "as_faces",
    "as_surface",
    "as_vertices",
    "face_array",
    "finite_size",
    "non_finite_defect",
    "refuse_swapped",
    "repeated_corner_defect",
    "repeated_corners",
    "size_exponent",
    "three_columns",
    "unit_size",
    "vertex_array",
]


def as_surface(V: ArrayLike, F: ArrayLike) -> tuple[Floats, Ints]:
    """V as by `as_vertices` and F as by `as_faces`; MeshError also if they are swapped."""
    refuse_swapped(V, F)
    positions = as_vertices(V)
    return positions, as_faces(F, len(positions))


def refuse_swapped(V: ArrayLike, F: ArrayLike) -> None:
    """Raise MeshError if V and F have changed places.

    They have if V can only be faces of F and F cannot be faces of V.
    """
    try:
        vertices = vertex_array(F)
        if vertices.dtype.kind != "f" or (vertices == np.rint(vertices)).all():
            return  # they are faces
        face_array(V, len(vertices))
    except MeshError:
        return
    raise MeshError(
        Defect(
            "V and F swapped",
            "V has the corners of faces, and F has coordinates",
            "Pass the vertices first: (V, F).",
        )
    )


def vertex_array(V: ArrayLike, name: str = "V") -> NDArray[Any]:
    """V as an array of 2 or 3 numeric columns, finite or not; MeshError if it is none."""
    given = _numeric(name, V)
    if given.ndim != 2 or given.shape[1] not in (2, 3) or len(given) < 3:
        raise MeshError(
            Defect(
                f"shape of {name}",
                f"{name} has shape {given.shape}",
                "It must be (n, 3), or (n, 2) for a planar mesh, with n at least 3.",
            )
        )
    if given.dtype == np.longdouble:
        with np.errstate(over="ignore"):  # what is too large for float64 is infinite here
            given = given.astype(np.float64)
    return given


def as_vertices(V: ArrayLike, name: str = "V") -> Floats:
    """(n, 3) float64 copy of V, scaled to unit size; MeshError if that cannot be."""
    given = vertex_array(V, name)
    if defect := non_finite_defect(given, name):
        raise MeshError(defect)
    return unit_size(given)


def non_finite_defect(given: NDArray[Any], name: str = "V") -> Defect | None:
    """Vertices with a NaN or infinite coordinate, as a defect; None if there are none."""
    finite = np.isfinite(given)
    if finite.all():
        return None
    bad = np.flatnonzero(~finite.all(axis=1))
    vertices = counted(len(bad), "vertex has", "vertices have")
    return Defect(
        "non-finite coordinate",
        f"{vertices} a NaN or infinite coordinate in {name}",
        "Restore the coordinates"
        + ("; cdcp_igl.clean drops these vertices with their faces." if name == "V" else "."),
        "vertices",
        bad,
    )


def three_columns(given: NDArray[Any]) -> Floats:
    """(n, 3) float64 copy of positions in space or in the plane."""
    positions = np.zeros((len(given), 3))
    positions[:, : given.shape[1]] = given
    return positions


def unit_size(given: NDArray[Any]) -> Floats:
    """(n, 3) float64 copy of finite positions; the largest coordinate is from 1/2 to 1."""
    positions = three_columns(given)
    # By a power of two, which is exact: products of lengths stay in range in any unit.
    return np.ldexp(positions, -size_exponent(positions), out=positions)


def finite_size(given: NDArray[Any]) -> Floats:
    """Like `unit_size`; coordinates that are not finite are 0."""
    return unit_size(np.where(np.isfinite(given), given, 0))


def size_exponent(given: NDArray[Any]) -> int:
    """Find the power of two by which `unit_size` divides."""
    return int(np.frexp(max(float(given.max()), -float(given.min())))[1])


def face_array(F: ArrayLike, n: int) -> Ints:
    """(m, 3) int64 copy of F in C order, indices in range; MeshError if that cannot be."""
    given = _numeric("F", F)
    if given.ndim != 2 or given.shape[1] != 3 or len(given) == 0:
        polygons = given.ndim == 2 and given.shape[1] > 3
        raise MeshError(
            Defect(
                "shape of F",
                f"F has shape {given.shape}",
                "It must be (m, 3) with m at least 1."
                + (" Triangulate the polygons first." if polygons else ""),
            )
        )
    # Judged as given: a cast would wrap large unsigned numbers and truncate fractions.
    if not (given.min() >= 0 and given.max() < n):
        outside = np.flatnonzero(~((given >= 0) & (given < n)).all(axis=1))
        one_based = given.min() == 1 and given.max() == n
        raise MeshError(
            Defect(
                "index out of range",
                f"{counted(len(outside), 'face has', 'faces have')} an index outside 0..{n - 1}",
                "The indices count from 1: pass F - 1." if one_based else "Mend or drop them.",
                "faces",
                outside,
            )
        )
    faces = np.array(given, dtype=np.int64, order="C")
    if given.dtype.kind == "f" and not np.array_equal(faces, given):
        fractional = np.flatnonzero((faces != given).any(axis=1))
        raise MeshError(
            Defect(
                "fractional index",
                f"{counted(len(fractional), 'face has', 'faces have')} an index that is no integer",
                "F takes integers, the rows of V.",
                "faces",
                fractional,
            )
        )
    return faces


def as_faces(F: ArrayLike, n: int) -> Ints:
    """Like `face_array`; MeshError also if a face has the same vertex at two corners."""
    faces = face_array(F, n)
    if defect := repeated_corner_defect(faces):
        raise MeshError(defect)
    return faces


def repeated_corner_defect(F: Ints) -> Defect | None:
    """Faces with the same vertex at two corners, as a defect; None if there are none."""
    repeated = repeated_corners(F)
    if len(repeated) == 0:
        return None
    return Defect(
        "repeated corner",
        f"{counted(len(repeated), 'face has', 'faces have')} the same vertex at two corners",
        "Drop these faces, as cdcp_igl.clean does.",
        "faces",
        repeated,
    )


def repeated_corners(F: Ints) -> Ints:
    """Faces with the same vertex at two corners."""
    i, j, k = F.T
    return np.flatnonzero((i == j) | (j == k) | (k == i))


def _numeric(name: str, array: ArrayLike) -> NDArray[Any]:
    try:
        numeric = np.asarray(array)
    except ValueError:  # ragged
        numeric = np.empty(0, dtype=object)
    if numeric.dtype.kind not in "iuf":
        raise MeshError(
            Defect(
                "not numeric",
                f"{name} is not a rectangular array of real numbers",
                "V takes rows of 3 (or 2) real numbers, F rows of 3 integers.",
            )
        )
    return numeric
