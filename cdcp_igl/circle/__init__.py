"""From the boundary trace to the unit circle."""

from .fallback import BoundaryMethod, map_to_circle

__all__ = ["BoundaryMethod", "map_to_circle"]
