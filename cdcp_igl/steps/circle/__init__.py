"""From the boundary trace to the unit circle."""

from .fallback import BoundaryMethod, by_arc_length, maps_to_circle
from .spread import spread_corners

__all__ = ["BoundaryMethod", "by_arc_length", "maps_to_circle", "spread_corners"]
