"""Names of the array types in signatures, points as complex numbers, parts of arrays, units."""

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Bools = NDArray[np.bool_]
Complex = NDArray[np.complex128]
Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Numbers = TypeVar("Numbers", Complex, Floats)  # complex or real, as given
Scalar = TypeVar("Scalar", bound=np.generic)
Indices = NDArray[np.signedinteger[Any]]  # 32 bits where that is enough


def as_complex(uv: Floats) -> Complex:
    """(n,) u + iv of points (n, 2)."""
    return np.array(uv, dtype=np.float64, order="C").view(np.complex128)[:, 0]


def coordinates(z: Complex) -> Floats:
    """(n, 2) real and imaginary parts."""
    return np.array(z, dtype=np.complex128, order="C")[:, None].view(np.float64)


def marked(n: int, *rows: NDArray[Any] | int) -> Bools:
    """(n,) which of n rows are among the given ones."""
    among = np.zeros(n, dtype=bool)
    for some in rows:
        among[some] = True
    return among


def places(rows: NDArray[Any], n: int) -> Ints:
    """(n,) where each of n rows is among the given ones, which are different; -1 if it is not."""
    place = np.full(n, -1)
    place[rows] = np.arange(len(rows))
    return place


def shifted(x: NDArray[Scalar], k: int = 1) -> NDArray[Scalar]:
    """(n,) at each place of a ring what is k places on: in a quarter of the time of `np.roll`."""
    return np.concatenate([x[k:], x[:k]])


def evenly_spaced_rows(m: int, most: int) -> Ints:
    """(k,) rows of at most so many of m, spread evenly."""
    return np.arange(m) if m <= most else np.linspace(0, m - 1, most).astype(np.int64)


def distinct_rows(rows: NDArray[Any]) -> tuple[Ints, Ints]:
    """(k,) first of each set of equal rows, the rows ascending; (n,) which of the k each row is."""
    order = np.lexsort(rows.T[::-1])  # stable: the first comes first
    leads = np.ones(len(rows), dtype=bool)
    leads[1:] = (rows[order[1:]] != rows[order[:-1]]).any(axis=1)
    which = np.empty(len(rows), dtype=np.int64)
    which[order] = np.cumsum(leads) - 1
    return order[leads], which


def rows_not_in(others: Ints, rows: Ints) -> Ints:
    """(k, 2) those of some rows that are none of the others (l, 2)."""
    _, number = distinct_rows(np.vstack([others, rows]))
    other, own = np.split(number, [len(others)])
    return rows[~np.isin(own, other)]


def in_space(given: NDArray[Any]) -> Floats:
    """(n, 3) float64 copy of positions; z is 0 where they have two columns."""
    return np.pad(given.astype(np.float64), ((0, 0), (0, 3 - given.shape[1])))


def unit_size(given: NDArray[Any], exponent: int | None = None) -> Floats:
    """(n, 3) float64 copy of positions; the largest coordinate is from 1/2 to 1.

    Coordinates that are not finite are 0. Another `exponent` of the unit may be given.
    """
    positions = np.zeros((len(given), 3))
    np.copyto(positions[:, : given.shape[1]], given, where=np.isfinite(given))
    # By a power of two, which is exact: products of lengths stay in range in any unit.
    exponent = size_exponent(positions) if exponent is None else exponent
    return np.ldexp(positions, -exponent, out=positions)


def size_exponent(given: NDArray[Any]) -> int:
    """Find the power of two by which `unit_size` divides."""
    return int(np.frexp(max(float(given.max()), -float(given.min())))[1])
