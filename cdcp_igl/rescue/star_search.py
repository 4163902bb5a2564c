"""Search for a place where a vertex has no flipped face around it."""

from __future__ import annotations

import numpy as np

from ..arrays import Bools, Complex, Floats, Ints

__all__ = ["search_stars"]

SCALES = 2.0 ** -np.arange(0, 12, 2)  # of the places that are tried, by the size of the star
PLACES = 24  # on each scale
GRID = 3  # last digits up, down, left and right that are tried
LAST_DIGIT = 2.0**-53  # of coordinates next to 1


def search_stars(F: Ints, g: Complex, flipped: Ints, free: Bools) -> tuple[Complex, Bools]:
    """Move the corners of flipped faces, one after the other, to where the fewest are flipped.

    Places all over the star of a vertex are tried, and those next to it in the last digits of
    its coordinates: where faces are hardly larger than the distance between doubles, averages
    and derivatives are of no use, but there may be a place.

    Parameters
    ----------
    F : (m, 3) int64
    g : (n,) complex128
    flipped : (k,) int64
        Rows of F.
    free : (n,) bool
        Vertices that may be moved.

    Returns
    -------
    g : (n,) complex128
    (n,) bool
        Which vertices have been moved.
    """
    g, moved = g.copy(), np.zeros(len(g), dtype=bool)
    offsets = _offsets()
    steps = np.arange(-GRID, GRID + 1) * LAST_DIGIT
    digits = (steps[:, None] + 1j * steps).ravel()
    vertices = np.unique(F[flipped])
    for vertex in vertices[free[vertices]]:
        star = F[(vertex == F).any(axis=1)]
        first = (star == vertex).argmax(axis=1)
        rows = np.arange(len(star))
        after, before = star[rows, (first + 1) % 3], star[rows, (first + 2) % 3]
        size = abs(g[after] - g[vertex]).max()
        places = np.concatenate([[g[vertex]], g[vertex] + size * offsets, g[vertex] + digits])
        e, d = g[after] - places[:, None], g[before] - places[:, None]
        area = (e.conj() * d).imag / np.maximum(abs(e) * abs(d), np.finfo(float).tiny)
        count = (area <= 0).sum(axis=1)
        best = int(np.lexsort((-area.min(axis=1), count))[0])
        if best and count[0]:  # fewer, or as many that are nearer to being turned
            g[vertex], moved[vertex] = places[best], True
    return g, moved


def _offsets() -> Complex:
    """Places around 0, evenly turned: a golden-angle spiral, on several scales."""
    k = np.arange(1, PLACES + 1)
    spiral: Floats = np.sqrt(k / PLACES)
    turned = spiral * np.exp(1j * k * np.pi * (3 - np.sqrt(5)))
    return (SCALES[:, None] * turned).ravel()
