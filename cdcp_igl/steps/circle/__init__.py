"""From the boundary trace to the unit circle."""

from .fallback import (
    FALLBACKS,
    BoundaryMethod,
    CircleMap,
    Rejected,
    arc_length_map,
    by_trace,
    whitened_geodesic_map,
)
from .spread import spread_corners

__all__ = [
    "FALLBACKS",
    "BoundaryMethod",
    "CircleMap",
    "Rejected",
    "arc_length_map",
    "by_trace",
    "spread_corners",
    "whitened_geodesic_map",
]
