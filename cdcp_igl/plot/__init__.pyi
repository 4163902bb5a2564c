from .pictures import side_by_side
from .viewer import view

__all__ = ["side_by_side", "view"]
