"""Entry point of the command line; `program` holds the commands."""

from __future__ import annotations

import signal
import sys

from ..extras import MissingExtra, from_extra

__all__ = ["main"]


def main() -> None:
    """Run ``cdcp-igl``."""
    try:
        with from_extra("cli"):
            from .program import app
    except MissingExtra as error:
        sys.exit(f"cdcp-igl: {error}")
    # Leave by an exception, so that no unfinished file stays behind.
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))
    app(prog_name="cdcp-igl")
