"""What can be measured."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

__all__ = ["Candidate"]


@dataclass(frozen=True)
class Candidate:
    """A `reference.Method`, or a way to map that needs more to be told.

    Attributes
    ----------
    function : callable
        ``function(V, F)``, as `run_case` takes it.
    boundary : {"disk", "free", "none"}
        Onto the disk, certified; free, to be compared on angles only; or a time and no map.
    citation : str
        Where it comes from.
    single : bool
        Whether the map is in single precision.
    missing : callable
        Returns why it cannot be run here; empty if it can.
    prepare : callable
        Called in the process that runs it before the clock starts: the import of a package.
    source : str
        Digest of its file, of a method of one's own, which may change.
    """

    function: Callable[..., Any]
    boundary: Literal["disk", "free", "none"]
    citation: str
    single: bool = False
    missing: Callable[[], str] = str
    prepare: Callable[[], object] = str
    source: str = ""
