"""What can be measured."""

from __future__ import annotations

import hashlib
import sys
from ast import literal_eval
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, Literal


@dataclass(frozen=True)
class Candidate:
    """A `reference.Method`, or a way to map that needs more to be told.

    Attributes
    ----------
    function : callable
        ``function(V, F)``, as `run_case` takes it.
    boundary : {"disk", "free", "sphere", "none"}
        Onto the disk or the sphere, certified; free, to be compared on angles only; or a time and
        no map.
    citation : str
        Where it comes from.
    single : bool
        Whether the map is in single precision.
    missing : callable
        Returns why it cannot be run here; empty if it can.
    prepare : callable
        Called in the process that runs it before the clock starts: the import of a package.
    onto_disk : bool
        Whether a map that counts as free is meant to be onto the disk, in too few digits to be
        certified.
    source : str
        Digest of its file, of a method of one's own, which may change.
    """

    function: Callable[..., Any]
    boundary: Literal["disk", "free", "sphere", "none"]
    citation: str
    single: bool = False
    missing: Callable[[], str] = str
    prepare: Callable[[], object] = str
    onto_disk: bool = False
    source: str = ""


class Methods(dict[str, Candidate]):
    """Known by name, or found by ``package.module:function`` if they are somebody's own.

    ``"cdcp refine=3"``, with options of its function behind it, is one more method.
    """

    def __missing__(self, name: str) -> Candidate:
        base, options = split(name)
        if not options:
            return of_ones_own(name)
        of = self[base]
        values = {key: _value(text) for key, text in options.items()}
        return replace(of, function=partial(of.function, **values))


def split(name: str) -> tuple[str, dict[str, str]]:
    """Part the name of a method from the options behind it."""
    words = name.split()
    options = dict(word.split("=", 1) for word in words if "=" in word)
    return " ".join(word for word in words if "=" not in word), options


def _value(text: str) -> Any:
    """Read an option as Python does, or as a word."""
    with suppress(ValueError, SyntaxError):
        return literal_eval(text)
    return text


def of_ones_own(name: str) -> Candidate:
    """Import a method of one's own.

    Parameters
    ----------
    name : str
        ``"package.module:function"``, of a function that maps onto the disk, or of a `Method`
        or `Candidate`, which says what its boundary is.

    Raises
    ------
    ValueError
        If there is none.
    """
    module, _, attribute = name.partition(":")
    try:
        found = getattr(import_module(module), attribute)
    except (ImportError, AttributeError, ValueError) as error:
        raise ValueError(f"There is no method {name!r}: {error}") from error
    own = found if hasattr(found, "boundary") else Candidate(found, "disk", name)
    source = hashlib.sha256(Path(sys.modules[module].__file__ or "").read_bytes()).hexdigest()[:12]
    return Candidate(own.function, own.boundary, own.citation, source=source)
