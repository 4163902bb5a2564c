"""Surfaces to try things on: real ones by name, and generated ones with known maps."""

from .known import ellipse, paraboloid, spherical_cap, square

__all__ = ["ellipse", "paraboloid", "spherical_cap", "square"]
