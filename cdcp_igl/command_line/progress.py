"""A progress bar for people who wait at a terminal."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Timer
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..steps.phases import Progress

__all__ = ["progress_bar"]

PATIENCE = 1.0  # seconds before the bar appears


@contextmanager
def progress_bar() -> Iterator[Progress]:
    """Show progress on stderr while the body runs.

    The bar appears after a second and vanishes at the end. Where stderr is no terminal,
    there is none.

    Yields
    ------
    callable
        To be called as ``progress(phase, fraction)``.
    """
    if not sys.stderr.isatty():
        yield lambda phase, fraction: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, SpinnerColumn, TaskProgressColumn, TextColumn
    from rich.progress import Progress as Bar
    from rich.progress import TimeElapsedColumn as Elapsed

    columns = (SpinnerColumn(), TextColumn("{task.description:<11}"), BarColumn())
    bar = Bar(
        *columns, TaskProgressColumn(), Elapsed(), console=Console(stderr=True), transient=True
    )
    task = bar.add_task("", total=1)
    appear = Timer(PATIENCE, bar.start)
    appear.start()
    try:
        yield lambda phase, fraction: bar.update(task, description=phase, completed=fraction)
    finally:
        appear.cancel()
        appear.join()  # it may just have fired
        if bar.live.is_started:
            bar.stop()
