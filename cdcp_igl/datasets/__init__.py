"""Surfaces to try things on: real ones by name, and generated ones with known maps."""

from .known import ellipse, paraboloid, spherical_cap, spheroid, square
from .real import NAMES, load

__all__ = ["NAMES", "ellipse", "load", "paraboloid", "spherical_cap", "spheroid", "square"]
