"""Disk conformal maps of triangulated surfaces, accurate, fast and certified."""

import logging

import lazy_loader

# Each name is imported when it is first used; `__init__.pyi` says from where.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

logging.getLogger(__name__).addHandler(logging.NullHandler())

__version__ = "0.1.0"
