"""From the boundary trace to the unit circle, eqs. (1)-(6): whitened, and if it can be used."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..arrays import Complex, Floats, shifted
from ..verdict.certificate import increments, is_around
from .zipper import geodesic_map

# On nefertiti_299 (34 boundary vertices) points along the edges lower the mean angular distortion
# from 2.500 to 2.463 degrees. So many, by the lengths of the edges, are within 0.1 % of the limit
# on this and nine other surfaces of 34 to 160.
ENOUGH_POINTS = 120

# The trace has errors of some 1e-16 of its size, so that arcs shorter than this, in radians, are
# known to five digits at most.
RESOLVED = 1e-11

# The trace of a dipole of size 1 is as small as this on surfaces that are closed but for a small
# hole, or long. Its errors are some 1e-17 whatever its size, and 10 to 100 times larger in the map.
SMALLEST_TRACE = 1e-10

WHITENINGS = 3

# Lengths of edges that differ by less are equal, and so many edges tell where to begin.
EQUAL, COMPARED = 1e-9, 100


class Rejected(Exception):
    """A method that gives no map of the boundary onto the circle; the message says why."""


def whitened_geodesic_map(trace: Complex) -> Complex:
    """Run the geodesic algorithm on the trace as a round polygon with enough points.

    The algorithm follows circular arcs from point to point; on a short boundary, points
    along the edges of the trace keep it to the harmonic map, which is linear there. It runs in the
    direction, and from the longest edge, that are the same in another order of the points, and in a
    mirror.
    """
    z = whiten_trace(trace)
    edge = shifted(z) - z
    length = abs(edge)
    # Of a trace without area all lengths are NaN, and one point an edge is enough to show that.
    share = np.nan_to_num(length / length.sum())
    pieces = np.maximum(np.rint(ENOUGH_POINTS * share), 1).astype(np.int64)
    first = np.cumsum(pieces) - pieces
    which = np.repeat(np.arange(len(z)), pieces)
    along = (np.arange(len(which)) - first[which]) / pieces[which]
    curve = z[which] + along * edge[which]
    start, forwards = first_edge(abs(shifted(curve) - curve))
    if forwards:
        f = shifted(geodesic_map(shifted(curve, start)), -start)
    else:  # the mirror image, which is clockwise the other way
        last = -(start + 2) % len(curve)
        f = geodesic_map(shifted(curve[::-1].conj(), last))
        f = shifted(f.conj(), -last)[::-1]
    return f[first]


def first_edge(length: Floats) -> tuple[int, bool]:
    """Choose with which edge of a closed curve to begin, and whether forwards.

    By the lengths (N,) of edges: with the longest, of several with that after which the next are
    longer; so is the direction chosen.
    """
    start = np.flatnonzero(length >= (1 - EQUAL) * length.max())
    start, way = np.append(start, start), np.repeat([1, -1], len(start))
    for further in range(1, min(COMPARED, len(length))):
        if len(start) < 2:
            break
        after = length[(start + further * way) % len(length)]
        longest = after >= (1 - EQUAL) * after.max()
        start, way = start[longest], way[longest]
    return (int(start[0]), bool(way[0] > 0)) if len(start) else (0, True)


def onto_circle(
    trace: Complex, zipper: Callable[[Complex], Complex] = whitened_geodesic_map
) -> Complex:
    """Map the exterior of the boundary trace onto the disk: (nB,) its boundary, the first at 1.

    Raises `Rejected` if slivers or a bad dipole have made the clockwise trace cross itself, or if
    the dipole is so far from the boundary that the trace has too few digits.
    """
    if 0 < abs(trace - trace[0]).max() < SMALLEST_TRACE:
        raise Rejected("geodesic: the trace is too small for the digits of the dipole")
    if _turns_back(trace):
        raise Rejected("geodesic: the trace turns back")
    f_B = zipper(trace)
    if not np.isfinite(f_B).all():
        raise Rejected("geodesic: not finite")
    if not is_around(f_B):
        raise Rejected("geodesic: not monotone")
    if increments(f_B).min() < RESOLVED:
        raise Rejected("geodesic: arcs too short for the digits of the trace")
    f_B = f_B / f_B[0]
    return f_B / abs(f_B)


def _turns_back(trace: Complex) -> bool:
    """Whether an edge of a clockwise curve turns by more than 90 degrees from the one before.

    Next to a circle, a chord turns from the one before by half of both arcs.
    """
    edge = shifted(trace) - trace
    length = abs(edge)
    both = length + shifted(length)
    half_arcs = np.pi * both / max(length.sum(), SMALLEST_TRACE)
    turn = shifted(edge) * edge.conj() * np.exp(1j * half_arcs)
    return bool((turn.real < 0).any())


def whiten_trace(z: Complex) -> Complex:
    """Make the moments of inertia of a closed polygon (N,) equal, and its area pi.

    The trace of a dipole on one face is sum a_k zeta^k + b_k zeta^-k with a dominant
    b_1, since the face has a shape. Subtracting a multiple of the conjugate removes b_1
    and leaves a rounder curve, on which the geodesic algorithm loses fewer digits; the
    exterior map does not change to first order. Not in the paper. A polygon that crosses itself so
    much that it has no moments of inertia is only moved and scaled; one without area becomes NaN.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        return _whitened(z)


def _whitened(z: Complex) -> Complex:
    for _ in range(WHITENINGS):
        area, centroid = _area_and_centroid(z)
        z = z - centroid
        q = _anisotropy(z)
        if 0 < abs(q) < 1:
            kappa = (1 - np.sqrt(1 - abs(q) ** 2)) / abs(q)
            z = z - kappa * q / abs(q) * z.conj()
    area, centroid = _area_and_centroid(z)
    return (z - centroid) / np.sqrt(abs(area) / np.pi)


def _area_and_centroid(z: Complex) -> tuple[float, complex]:
    origin = z.mean()  # near the polygon, so that the products below do not cancel
    z = z - origin
    after = shifted(z)
    cross = (z.conj() * after).imag
    area = cross.sum() / 2
    return area, origin + (cross * (z + after)).sum() / (6 * area)


def _anisotropy(z: Complex) -> complex:
    """Integral of z^2 over integral of |z|^2, both over the enclosed area."""
    after = shifted(z)
    cross = (z.conj() * after).imag
    squares = (cross * (z * z + z * after + after * after)).sum()
    moduli = (cross * (abs(z) ** 2 + (z.conj() * after).real + abs(after) ** 2)).sum()
    return squares / moduli
