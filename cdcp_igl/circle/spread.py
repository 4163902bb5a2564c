"""Keep the corners of faces inscribed in the circle far enough apart for double precision."""

from __future__ import annotations

import numpy as np

from ..arrays import Complex, Floats
from ..injectivity import increments
from ..mesh import DiskMesh

__all__ = ["around", "spread"]

# A triangle inscribed in the unit circle with short arcs p and q has the area
# p q (p + q) / 4, of which rounding its corners blurs some 1e-16 (p + q). The margin is
# for the Möbius step, which may shrink arcs.
APART = 1e-6


def spread(mesh: DiskMesh, f_B: Complex) -> Complex:
    """Open the arcs under faces that would collapse because all their corners coincide.

    A conformal map puts the corners of an ear in a remote part of the surface so close
    together on the circle that they lie on a line, up to rounding.

    Parameters
    ----------
    mesh : DiskMesh
    f_B : (nB,) complex128
        On the unit circle, strictly counterclockwise, once around, the first at 1.

    Returns
    -------
    (nB,) complex128
        The same, the argument itself where no face collapses.
    """
    if len(mesh.inscribed) == 0:
        return f_B
    place = np.zeros(len(mesh.V), dtype=np.int64)
    place[mesh.loop] = np.arange(len(mesh.loop))
    start = np.sort(place[mesh.F[mesh.inscribed]], axis=1)
    end = np.roll(start, -1, axis=1)
    end[:, 2] += len(f_B)

    steps = increments(f_B)
    angle = np.append(0, np.cumsum(np.tile(steps, 2)))
    arcs = angle[end] - angle[start]
    narrow = np.sort(arcs, axis=1)[:, :2].prod(axis=1) < APART**2
    if not narrow.any():
        return f_B
    short = narrow[:, None] & (arcs < APART)
    for first, last in zip(start[short], end[short], strict=True):
        edges = np.arange(first, last) % len(f_B)
        steps[edges] = np.maximum(steps[edges], APART / len(edges))
    return around(steps)


def around(steps: Floats) -> Complex:
    """Points on the unit circle, from 1, each followed by its step in proportion."""
    return np.exp(2j * np.pi * (np.cumsum(steps) - steps) / steps.sum())
