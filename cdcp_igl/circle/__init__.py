"""From the boundary trace to the unit circle."""

from .crowding import blame_crowding
from .fallback import BoundaryMethod, by_arc_length, map_to_circle
from .spread import spread

__all__ = ["BoundaryMethod", "blame_crowding", "by_arc_length", "map_to_circle", "spread"]
