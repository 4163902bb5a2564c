"""Names of the array types used in signatures, and blocks of long arrays."""

from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "Bools",
    "Complex",
    "Floats",
    "Indices",
    "Ints",
    "blocks",
    "coordinates",
    "spread_evenly",
]

Bools = NDArray[np.bool_]
Complex = NDArray[np.complex128]
Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Indices = NDArray[np.signedinteger[Any]]  # 32 bits where that is enough

BLOCK = 1 << 14  # faces

# Freed memory goes back to the system, and what is taken again has to be cleared page by page. The
# C library of Linux (glibc) keeps as much as it has seen freed in one block, up to 32 MB. Such a
# block, which nobody touches, takes no memory, and halves the pages of a first map of 20,000
# vertices.
with suppress(MemoryError):
    np.empty((1 << 25) - (1 << 16), dtype=np.uint8)


def coordinates(z: Complex) -> Floats:
    """(n, 2) real and imaginary parts."""
    return np.column_stack([z.real, z.imag])


def blocks(m: int) -> Iterator[slice]:
    """Split m faces into blocks whose arrays stay in the cache."""
    for start in range(0, m, BLOCK):
        yield slice(start, start + BLOCK)


def spread_evenly(m: int, most: int) -> Ints:
    """(k,) rows of at most so many of m, spread evenly."""
    return np.linspace(0, m - 1, min(most, m)).astype(np.int64)
