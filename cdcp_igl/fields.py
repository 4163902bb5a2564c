"""Values at vertices, such as heights, colours or labels, and what they are in between."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from .arrays import Floats, Ints

Method = Literal["linear", "nearest"]
Labelled = ArrayLike | tuple[ArrayLike, Mapping[int, str]]  # with names, as of `io.Values`


@dataclass(frozen=True, eq=False)
class Field:
    """Real values (n, ...) as float64, NaN where they are masked; `nearest` of labels."""

    values: Floats
    nearest: bool

    @classmethod
    def of(cls, given: ArrayLike, method: Method | None = None) -> Field:
        """Take values as they are given; ValueError if they are complex.

        Integers and truth values are labels, between which there is nothing, unless a `method`
        is told.
        """
        if method not in ("linear", "nearest", None):
            raise ValueError(f'method must be "linear" or "nearest", not {method!r}')
        values: Any = np.ma.asarray(given)
        if np.iscomplexobj(values):
            raise ValueError("values must be real; of complex ones give both parts, as two columns")
        real = values.astype(np.float64).filled(np.nan)
        labels = values.dtype.kind in "biu"
        return cls(real, labels if method is None else method == "nearest")

    def of_vertices(self, n: int, *, unused: bool = False) -> Field:
        """Return it if it has a row for each of n vertices; of `unused` ones there may be more."""
        shape = self.values.shape
        if not shape or shape[0] < n or (shape[0] > n and not unused):
            raise ValueError(f"values has shape {shape}; it must have {n} rows")
        return self

    def at(self, rows: Ints, weights: Floats) -> Floats:
        """(k, ...) means of rows (k, c) by weights (k, c), or the rows of most weight.

        Rows of weight 0 are not read. NaN where weights are.
        """
        if self.nearest:
            best = np.take_along_axis(rows, weights.argmax(axis=1)[:, None], axis=1)[:, 0]
            found = self.values[best]
            found[np.isnan(weights[:, 0])] = np.nan
            return found
        share = weights.reshape(*weights.shape, *[1] * (self.values.ndim - 1))
        corners = np.where(share == 0, 0, self.values[rows])
        return np.asarray(np.einsum("kc,kc...->k...", weights, corners))
