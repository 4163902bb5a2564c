"""Entry point of the command line; `program` holds the commands."""

from __future__ import annotations

import os
import signal
import sys
import warnings
from io import TextIOWrapper
from types import FrameType

from ..extras import MissingExtra, from_extra


def main() -> None:
    """Run ``cdcp-igl``."""
    # Before the first slow import, and as an exception, so that no unfinished file stays behind.
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)  # Windows has no SIGHUP
        if number and signal.getsignal(number) != signal.SIG_IGN:  # as nohup has set it
            signal.signal(number, _stop)
    _make_printable()
    # The font of a picture lacks many scripts; a box in a title is no reason to print source lines.
    warnings.filterwarnings("ignore", r"Glyph \d+|Matplotlib currently does not support")
    try:
        with from_extra("cli"):
            import rich  # noqa: F401 - imported again only where something is drawn

            from .program import app
        app(prog_name="cdcp-igl")
    except MissingExtra as error:
        sys.exit(f"cdcp-igl: {error}")
    except Exception as error:
        if _received:  # compiled modules turn the exception into one of their own
            sys.exit(128 + _received[0])
        if isinstance(error, OSError) and _stdout_fails():
            sys.exit(f"Not printed: {error.strerror}")
        raise


def _make_printable() -> None:
    """Let stdout and stderr take any text, whatever the terminal can show, and if it is closed."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115 - to the end
        elif isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")


def _stdout_fails() -> bool:
    """Whether stdout takes no more, not even a line's end; what it still holds is dropped then."""
    try:
        sys.stdout.write("\n")
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return True
    return False


_received: list[int] = []


def _stop(number: int, frame: FrameType | None) -> None:
    _received.append(number)
    if number == signal.SIGINT:
        signal.signal(number, signal.SIG_DFL)  # the second time, nothing is tidied up
        print("Interrupted", file=sys.stderr)  # noqa: T201 - typer may not be there yet
    sys.exit(128 + number)
