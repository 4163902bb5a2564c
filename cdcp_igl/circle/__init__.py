"""From the boundary trace to the unit circle."""

from .fallback import BoundaryMethod, by_arc_length, map_to_circle

__all__ = ["BoundaryMethod", "by_arc_length", "map_to_circle"]
