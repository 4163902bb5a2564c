"""Optional dependencies."""

from __future__ import annotations

from importlib import import_module
from typing import Any

__all__ = ["require"]


def require(module: str, *, extra: str) -> Any:
    """Import a module that comes with an extra.

    Raises
    ------
    ImportError
        If it is missing; the message says how to install it.
    """
    try:
        return import_module(module)
    except ImportError as error:
        package = module.partition(".")[0]
        raise ImportError(
            f"this needs {package}, which comes with: pip install 'cdcp_igl[{extra}]'"
        ) from error
