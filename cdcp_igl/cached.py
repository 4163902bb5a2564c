"""functools.cached_property without its lock, which Python has dropped in 3.12, too."""

from __future__ import annotations

import functools
import sys
from contextlib import nullcontext
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING or sys.version_info >= (3, 12):
    cached_property = functools.cached_property
else:

    class cached_property(functools.cached_property):
        """A property that is computed once.

        One lock would serve all instances of a class. A process that is forked while another
        thread computes the property of one would inherit it locked, and wait for ever. Without
        it, two threads may both compute the property, to the same value.
        """

        def __init__(self, function: Any) -> None:
            super().__init__(function)
            self.lock = nullcontext()
