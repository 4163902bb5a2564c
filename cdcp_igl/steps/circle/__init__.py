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
from .spread import spread

__all__ = [
    "FALLBACKS",
    "BoundaryMethod",
    "CircleMap",
    "Rejected",
    "arc_length_map",
    "by_trace",
    "spread",
    "whitened_geodesic_map",
]
