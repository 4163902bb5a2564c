"""The side to which the faces of a surface point, where it can be known."""

from __future__ import annotations

import numpy as np

from ..arrays import Floats, Ints
from .topology import Topology

INWARD, CLOCKWISE = "faces point inward", "faces are clockwise"
CLEAR = 1e-9  # of what faces enclose without their signs: less may be rounding


def points_inward(V: Floats, F: Ints) -> bool:
    """Whether the faces of an oriented closed surface in one piece enclose a negative volume."""
    volume = _enclosed(V, F, V[F[0, 0]])
    return bool(volume.sum() < -CLEAR * abs(volume).sum())


def wrong_side(V: Floats, surface: Topology) -> tuple[str, Ints]:
    """Say what is wrong with the side that faces point to, if anything is, and of which faces (k,).

    Those of a component that is closed and encloses a negative volume point inward; in a plane
    z = const they may be clockwise, seen from above. Of a component, the majority counts.
    """
    F, m = surface.F, len(surface.F)
    if surface.singular.any() or surface.misoriented is None:
        return "", np.empty(0, np.int64)
    count, component = surface.components
    flat = not np.ptp(V[:, 2])
    known = flat | (np.bincount(component[surface.border % m], minlength=count) == 0)
    if not known.any():
        return "", np.empty(0, np.int64)
    _, first = np.unique(component, return_index=True)
    # From a vertex of the component: it may be small and far from 0.
    size = _enclosed(V, F, V[F[first, 0]][component][:, None], flat=flat)
    size[surface.misoriented] *= -1
    total, most = (np.bincount(component, x, count) for x in (size, abs(size)))
    wrong = known & (total < -CLEAR * most)
    rows = np.flatnonzero(wrong[component])
    return (CLOCKWISE if flat else INWARD) if len(rows) else "", rows


def _enclosed(V: Floats, F: Ints, origin: Floats, *, flat: bool = False) -> Floats:
    """(m,) six times the signed volume between each face and an origin; twice the area if flat."""
    p, q, r = np.moveaxis(V[F] - origin, 1, 0)
    normal = np.cross(q - p, r - p)
    return normal[:, 2] if flat else (p * normal).sum(axis=1)
