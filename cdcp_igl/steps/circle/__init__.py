"""From the boundary trace to the unit circle."""

from .bulge import hold_open
from .fallback import (
    FALLBACKS,
    BoundaryMethod,
    CircleMap,
    Rejected,
    arc_length_map,
    by_trace,
    whitened_geodesic_map,
)

__all__ = [
    "FALLBACKS",
    "BoundaryMethod",
    "CircleMap",
    "Rejected",
    "arc_length_map",
    "by_trace",
    "hold_open",
    "whitened_geodesic_map",
]
