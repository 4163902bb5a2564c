"""Optional dependencies: which extra of the package provides them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


class MissingExtra(ImportError):
    """A package is missing that an extra of cdcp_igl would have installed."""


@contextmanager
def from_extra(name: str) -> Iterator[None]:
    """Name the extra if an import in the body finds no such package."""
    try:
        yield
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        if package == "cdcp_igl":
            raise
        raise MissingExtra(
            f"{package} is missing; needs the extra: pip install '.[{name}]' "
            "in a checkout of cdcp_igl"
        ) from error
