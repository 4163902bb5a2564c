"""What several functions have in common is told once, in the docstring of one of them."""

from __future__ import annotations

import re
from collections.abc import Callable
from inspect import getdoc, signature
from typing import Any, TypeVar

Function = TypeVar("Function", bound=Callable[..., Any])


def like(model: Callable[..., Any]) -> Callable[[Function], Function]:
    """Complete the docstring of a function by that of another, which tells what is the same.

    Parameters and errors that it does not describe are described as there, and sections that it
    does not have are those of the model; in its example the function takes the model's place.
    """

    def complete(function: Function) -> Function:
        given, own = _sections(model), _sections(function)
        named = [name.lstrip("*") for name in signature(function).parameters]
        for title, order in (("Parameters", named), ("Raises", None)):
            entries = _entries(given.get(title, "")) | _entries(own.get(title, ""))
            kept = dict.fromkeys(entries[name] for name in order or entries if name in entries)
            if kept:
                own[title] = "\n".join([title, "-" * len(title), *kept])
        text = "\n\n".join((given | own).values())
        function.__doc__ = text.replace(f".{model.__name__}(", f".{function.__name__}(")
        return function

    return complete


def _sections(function: Callable[..., Any]) -> dict[str, str]:
    """Take a docstring apart at the titles of its sections; what is before them has none."""
    before, *sections = re.split(r"\n\n(?=\w+\n-+\n)", getdoc(function) or "")
    return {"": before} | {section.partition("\n")[0]: section for section in sections}


def _entries(section: str) -> dict[str, str]:
    """Return what a section says of each parameter or error; of several at once, for each."""
    found = re.split(r"\n(?=\S)", section)[2:]
    return {name: entry for entry in found for name in re.split(r" : |\n", entry)[0].split(", ")}
