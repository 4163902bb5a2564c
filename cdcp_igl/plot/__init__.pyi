from .pictures import MapRow, picture, side_by_side
from .viewer import view, view_html

__all__ = ["MapRow", "picture", "side_by_side", "view", "view_html"]
