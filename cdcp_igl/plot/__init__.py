"""Pictures of a map, and a page in which one can turn it."""

import lazy_loader

# Matplotlib is imported when a name is first used; `__init__.pyi` says from where.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
