"""Charts laid into the unit square by their shape, some texels apart.

After B. Lévy, S. Petitjean, N. Ray, J. Maillot. Least squares conformal maps for automatic texture
atlas generation. ACM Trans. Graph. 21(3), 2002: one after the other, the largest first, charts sink
onto the skyline of those that are there. Here each comes to lie where its upper end is lowest, in
one of several directions; and the square is the smallest into which all go.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.spatial import ConvexHull, QhullError

from ..arguments import is_real, is_whole
from ..arrays import Complex, Floats, coordinates
from ..errors import counted

# The smallest square into which all charts may go has so many columns. With twice as many, 40
# surfaces fill as much of theirs. A square of which they take a small part has `MOST` at most.
COLUMNS, MOST = 300, 3000
# Directions in which a chart is tried: of many charts, of one, and of all together.
FEWEST_TURNS, MOST_TURNS, ALL_TURNS = 2, 64, 128
# The side of the square grows by this share until all charts go into it; then the last step is
# bisected so often. Where they do not at so many times the side, the padding leaves no room.
STEP, BISECTIONS, HOPELESS = 0.25, 6, 32
APART = 1e-6  # texels at least between charts: those that only touch may overlap by rounding


@dataclass(frozen=True)
class Packing:
    """How charts are to lie in the unit square; ValueError if that is not possible.

    Attributes
    ----------
    size : int
        Texels along each side of the square.
    padding : float
        Texels between charts, and between them and the rim.
    density : float or None
        Texels a unit of the surface; None for as many as there is room for.
    rotate : bool
        Whether charts with free outlines are turned.
    """

    size: int = 2048
    padding: float = 4
    density: float | None = None
    rotate: bool = True

    def __post_init__(self) -> None:
        if not (is_whole(self.size) and self.size >= 1):
            raise ValueError(f"size must be 1, 2, ... texels, not {self.size!r}")
        if not (is_real(self.padding) and 0 <= self.padding < self.size / 2):
            raise ValueError(
                f"padding must be from 0 to less than half of the {self.size:,} texels, "
                f"not {self.padding!r}"
            )
        if self.density is not None and not (is_real(self.density) and 0 < self.density < np.inf):
            raise ValueError(f"density must be a positive number or None, not {self.density!r}")
        if not isinstance(self.rotate, bool | np.bool_):
            raise ValueError(f"rotate must be True or False, not {self.rotate!r}")

    def places(self, outlines: Sequence[Complex], unit: float = 1) -> tuple[Complex, Complex]:
        """(k,) factors and displacements that take closed polygons to their places in the square.

        A length of `unit` in their plane is one of the surface. ValueError if they do not fit.
        """
        areas = np.array([abs((z.conj() * np.roll(z, -1)).imag.sum()) / 2 for z in outlines])
        longest = max(max(np.ptp(z.real), np.ptp(z.imag)) for z in outlines)
        # A unit of the outlines.
        columns = COLUMNS / max(np.sqrt(areas.sum()), longest / np.sqrt(2))
        if self.density:
            columns = min(columns, MOST * self.density / (self.size * unit))
        n_turns = int(np.clip(ALL_TURNS // len(outlines), FEWEST_TURNS, MOST_TURNS))
        order = np.argsort(-areas, kind="stable").tolist()
        shapes = [
            [Shape.of(outlines[k], columns * turn) for turn in self._turns(outlines[k], n_turns)]
            for k in order
        ]
        texels = columns * unit * self.size  # a unit of the surface, by the side of the square
        side = texels / self.density if self.density else 0.0
        found = self._skyline(shapes, side) if self.density else None
        if not found:
            side, found = self._smallest_square(shapes)
            if self.density:
                raise ValueError(
                    f"density must be at most {texels / side:.6g} texels a unit, for the charts to "
                    f"fit into {self.size:,} x {self.size:,}, not {self.density!r}"
                )
        factor, move = np.empty((2, len(outlines)), np.complex128)
        for k, (shape, corner) in zip(order, found, strict=True):
            factor[k], move[k] = shape.factor / side, (corner - shape.low) / side
        return factor, move

    def _turns(self, z: Complex, count: int) -> Complex:
        """(k,) numbers of modulus 1."""
        if not self.rotate:
            return np.ones(1, np.complex128)
        return laid_flat(z) * np.exp(2j * np.pi * np.arange(count) / count)

    def _smallest_square(self, shapes: list[list[Shape]]) -> tuple[float, list[Placed]]:
        """Return the side of the smallest square into which shapes go, and where they are."""
        side = float(COLUMNS)
        while not (found := self._skyline(shapes, side)):
            side *= 1 + STEP
            if side > HOPELESS * COLUMNS:
                raise ValueError(
                    f"{counted(len(shapes), 'chart does', 'charts do')} not fit into {self.size:,} "
                    f"x {self.size:,} texels with a padding of {self.padding:g}"
                )
        low = side / (1 + STEP)
        for _ in range(BISECTIONS):
            middle = (low + side) / 2
            if better := self._skyline(shapes, middle):
                side, found = middle, better
            else:
                low = middle
        return side, found

    def _skyline(self, shapes: list[list[Shape]], side: float) -> list[Placed] | None:
        """Place shapes in a square, each in one of its directions; None if there is no room."""
        padding = max(self.padding, APART) * side / self.size
        room, aside = side - 2 * padding, int(np.ceil(padding))
        skyline, placed = np.zeros(int(room)), list[Placed]()  # where the next shape may begin
        for directions in shapes:
            best, end = None, room
            for shape in directions:
                if len(shape.bottom) > len(skyline):
                    continue
                over = sliding_window_view(skyline, len(shape.bottom)) - shape.bottom
                level = np.maximum(over.max(axis=1), 0)
                x = int(level.argmin())
                if (top := float(level[x]) + shape.height) <= end and (top < end or not best):
                    best, end = (shape, x, float(level[x])), top
            if not best:
                return None
            shape, x, y = best
            for first in range(x - aside, x + aside + 1):
                start, stop = max(first, 0), max(first + len(shape.top), 0)
                near = skyline[start:stop]
                end_there = y + padding + shape.top[start - first :][: len(near)]
                np.maximum(near, end_there, out=near)
            placed.append((shape, x + padding + (y + padding) * 1j))
        return placed


@dataclass(frozen=True, eq=False)
class Shape:
    """A polygon that was turned and scaled: its lower and upper end over columns of width 1."""

    factor: complex
    low: complex  # corner of its box
    height: float
    bottom: Floats  # (w,) from the lowest point on
    top: Floats

    @classmethod
    def of(cls, outline: Complex, factor: complex) -> Shape:
        """Turn and scale a closed polygon (n,)."""
        z = factor * outline
        low = complex(z.real.min(), z.imag.min())
        z -= low
        width = max(int(np.ceil(z.real.max())), 1)
        after = np.roll(z, -1)
        rising = z.real <= after.real
        left, right = np.where(rising, z, after), np.where(rising, after, z)
        first = np.minimum(left.real.astype(np.int64), width - 1)
        count = np.maximum(np.ceil(right.real).astype(np.int64) - first, 1)
        edge = np.repeat(np.arange(len(z)), count)
        column = np.arange(len(edge)) + np.repeat(first - np.cumsum(count) + count, count)
        run = np.maximum(right.real - left.real, np.finfo(float).tiny)[edge]
        start, slope = left[edge], (right.imag - left.imag)[edge]
        # Where each edge enters each column, and where it leaves it.
        ends = [
            start.imag + np.clip((x - start.real) / run, 0, 1) * slope for x in (column, column + 1)
        ]
        bottom, top = np.full(width, np.inf), np.full(width, -np.inf)
        np.minimum.at(bottom, column, np.minimum(*ends))
        np.maximum.at(top, column, np.maximum(*ends))
        return cls(factor, low, float(z.imag.max()), bottom, top)


Placed = tuple[Shape, complex]  # with the lower left corner of its box


def laid_flat(z: Complex) -> complex:
    """Return the number of modulus 1 that turns points so that their smallest box lies flat.

    One side of the smallest rectangle around points lies along their convex hull.
    """
    try:
        hull = z[ConvexHull(coordinates(z)).vertices]
    except QhullError:  # they lie on a line
        return 1
    edges = np.roll(hull, -1) - hull
    turns = abs(edges) / edges
    turned = turns[:, None] * hull
    width, height = np.ptp(turned.real, axis=1), np.ptp(turned.imag, axis=1)
    best = int((width * height).argmin())
    return complex(turns[best] * (1 if width[best] >= height[best] else 1j))
