"""Keep the corners of faces inscribed in the circle far enough apart for double precision."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...arrays import Complex, Floats
from ...certificate import increments
from ...surface.mesh import DiskMesh

__all__ = ["around", "spread_corners"]

# A triangle inscribed in the unit circle with arcs p and q, both short, is p q / 2 high, and
# rounding moves its corners by 1e-16 or two. So p q must not be much smaller than this.
APART = 5e-8


def spread_corners(
    mesh: DiskMesh, f: Complex, extend: Callable[[Complex], Complex]
) -> tuple[Complex, int]:
    """Open the arcs under faces that would collapse because all their corners coincide.

    A conformal map puts the corners of an ear in a remote part of the surface so close
    together on the circle that they lie on a line, up to rounding.

    Parameters
    ----------
    mesh : DiskMesh
    f : (n,) complex128
        Map onto the disk, boundary counterclockwise on the circle, its first vertex at 1.
    extend : callable
        Extends boundary values to all of the surface; called only when needed.

    Returns
    -------
    f : (n,) complex128
        The argument itself where no face collapses.
    int
        The number of faces that would have collapsed.
    """
    if len(mesh.inscribed) == 0:
        return f, 0
    place = np.zeros(len(mesh.V), dtype=np.int64)
    place[mesh.loop] = np.arange(len(mesh.loop))
    start = np.sort(place[mesh.F[mesh.inscribed]], axis=1)
    end = np.roll(start, -1, axis=1)
    end[:, 2] += len(mesh.loop)

    steps = increments(f[mesh.loop])
    angle = np.append(0, np.cumsum(np.tile(steps, 2)))
    arcs = angle[end] - angle[start]
    narrow = np.sort(arcs, axis=1)[:, :2].prod(axis=1) < APART**2
    if not narrow.any():
        return f, 0
    short = narrow[:, None] & (arcs < APART)
    for first, last in zip(start[short], end[short], strict=True):
        edges = np.arange(first, last) % len(mesh.loop)
        steps[edges] = np.maximum(steps[edges], APART / len(edges))
    return extend(around(steps)), int(narrow.sum())


def around(steps: Floats) -> Complex:
    """Points on the unit circle, from 1, each followed by its step in proportion."""
    return np.exp(2j * np.pi * (np.cumsum(steps) - steps) / steps.sum())
