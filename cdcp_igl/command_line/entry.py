"""Entry point of the command line; `program` holds the commands."""

from __future__ import annotations

import signal
import sys
from types import FrameType

from ..extras import MissingExtra, from_extra

__all__ = ["main"]


def main() -> None:
    """Run ``cdcp-igl``."""
    # Before the first slow import, and as an exception, so that no unfinished file stays behind.
    signal.signal(signal.SIGINT, _interrupt)
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))
    try:
        with from_extra("cli"):
            import rich  # noqa: F401 - imported again only where something is drawn

            from .program import app
        app(prog_name="cdcp-igl")
    except MissingExtra as error:
        sys.exit(f"cdcp-igl: {error}")
    except Exception:
        if _interrupted:  # compiled modules turn the exception into one of their own
            sys.exit(128 + signal.SIGINT)
        raise


_interrupted: list[int] = []


def _interrupt(number: int, frame: FrameType | None) -> None:
    signal.signal(number, signal.SIG_DFL)  # the second time, nothing is tidied up
    _interrupted.append(number)
    print("Interrupted", file=sys.stderr)  # noqa: T201 - typer may not be there yet
    sys.exit(128 + number)
