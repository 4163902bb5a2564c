from .pictures import side_by_side

__all__ = ["side_by_side"]
