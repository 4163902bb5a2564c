"""Freed memory is kept for what comes next."""

from __future__ import annotations

from contextlib import suppress
from functools import cache

import numpy as np

__all__ = ["keep_freed_memory"]

MOST = 1 << 25  # bytes, to which glibc lets itself be taught
HEADER = 1 << 16  # more than a block takes besides its contents


@cache
def keep_freed_memory() -> None:
    """Let the C library of Linux (glibc) keep what is freed, from the first mesh on.

    What goes back to the system has to be cleared page by page when it is taken again: a first
    map of 17,000 vertices clears 40 to 50 % fewer pages so. The library keeps as much as it has
    seen freed in one block, up to 32 MB. Such a block, which nobody touches, takes no memory.
    """
    with suppress(MemoryError):
        np.empty(MOST - HEADER, dtype=np.uint8)
