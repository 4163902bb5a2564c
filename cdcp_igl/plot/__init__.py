"""Pictures of a map, as in the paper's Figures 5 and 6."""

from .pictures import MapRow, picture, side_by_side

__all__ = ["MapRow", "picture", "side_by_side"]
