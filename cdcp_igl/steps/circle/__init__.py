"""From the boundary trace to the unit circle."""

from .bulge import bulge
from .fallback import BoundaryMethod, OnCircle, by_arc_length, maps_to_circle

__all__ = ["BoundaryMethod", "OnCircle", "bulge", "by_arc_length", "maps_to_circle"]
