"""Arguments of public functions, checked by the annotations of their parameters."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from functools import cache, wraps
from inspect import signature
from os import PathLike, fspath
from reprlib import Repr
from types import NoneType, SimpleNamespace, UnionType
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import ArrayLike

Function = TypeVar("Function", bound=Callable[..., Any])

OF_ARRAYS = set(get_args(ArrayLike))  # none where NumPy has a name for it, which unions keep
# V and F may be other objects, and their reader names the defect; so does `compare`.
OWN_CHECK = ("V", "F", "methods")
LARGEST = 2**63  # from here on, an integer is no number of a row, nor a size
NAMES = {
    Any: "anything",
    bool: "True or False",
    int: "an integer",
    float: "a real number",
    str: "a string",
    NoneType: "None",
}


def typed(function: Function) -> Function:
    """Let a function raise ValueError for an argument that is not what its annotation says."""

    @wraps(function)
    def run(*args: Any, **options: Any) -> Any:
        check_types(function, args, options)
        return function(*args, **options)

    return run  # type: ignore[return-value]


def check_types(
    function: Callable[..., Any], args: tuple[Any, ...], options: Mapping[str, Any]
) -> None:
    """Raise ValueError for the first argument of another type than the annotation says."""
    names, kinds = _parameters(function)
    for name, value in (*zip(names, args, strict=False), *options.items()):
        if name in kinds and not _fits(value, kinds[name]):
            raise ValueError(f"{name} must be {_said(kinds[name])}, not {_shown(value)}")


def is_whole(value: object) -> bool:
    """Whether a value is an integer, and no truth value."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def is_real(value: object) -> bool:
    """Whether a value is a real number, perhaps infinite, and no truth value."""
    return is_whole(value) or isinstance(value, float | np.floating)


@cache
def _parameters(function: Callable[..., Any]) -> tuple[tuple[str, ...], dict[str, Any]]:
    """Names of the parameters, and what may be given for them."""
    parameters = signature(function).parameters
    # What is returned may be of a type that is imported for those who read types alone.
    given = SimpleNamespace(__annotations__={**function.__annotations__, "return": None})
    hints = get_type_hints(given, function.__globals__)
    checked = [
        one.name
        for one in parameters.values()
        if one.name in hints and one.name not in OWN_CHECK and one.kind is not one.VAR_KEYWORD
    ]
    return tuple(parameters), {name: hints[name] for name in checked}


def _alternatives(kind: Any) -> list[Any]:
    """Return the members of a union, among them ArrayLike, which is one itself, as a whole."""
    members = list(get_args(kind)) if get_origin(kind) in (Union, UnionType) else [kind]
    if not OF_ARRAYS or not set(members) >= OF_ARRAYS:
        return members
    paths = [str] if PathLike[str] in members else []  # elsewhere, a string is no array
    return [ArrayLike, *paths, *(one for one in members if one not in OF_ARRAYS)]


def _fits(value: Any, kind: Any) -> bool:
    alternatives = _alternatives(kind)
    if PathLike[str] in alternatives and isinstance(value, str | PathLike):
        return isinstance(fspath(value), str)
    return any(_is(value, one) for one in alternatives)


def _is(value: Any, kind: Any) -> bool:
    """Whether a value is of a kind that is no union."""
    origin, members = get_origin(kind), get_args(kind)
    simple: dict[Any, Callable[[Any], bool]] = {
        Any: lambda value: True,
        ArrayLike: _is_array,
        bool: lambda value: isinstance(value, bool | np.bool_),
        int: lambda value: is_whole(value) and abs(int(value)) < LARGEST,
        float: lambda value: is_real(value) and not (is_whole(value) and abs(value) >= LARGEST),
    }
    if kind in simple:
        return simple[kind](value)
    if origin is Literal:
        return isinstance(value, str) and value in members
    if origin is tuple and members[-1] is not Ellipsis:
        same = isinstance(value, tuple | list) and len(value) == len(members)
        return same and all(map(_fits, value, members))
    named = getattr(origin or kind, "__value__", None)  # of NumPy's names for types
    if not isinstance(value, get_origin(named) or named or origin or kind):
        return False
    if isinstance(value, np.ndarray):
        return True
    if origin is not None and issubclass(origin, Mapping):
        return all(_fits(key, members[0]) and _fits(x, members[1]) for key, x in value.items())
    if not members or callable(value) or not isinstance(value, Collection):
        return True
    if isinstance(value, str | Mapping):  # of strings, of keys: no one means that
        return False
    return all(_fits(x, members[0]) for x in value)


def _is_array(value: Any) -> bool:
    """Whether NumPy makes numbers or truth values of it."""
    try:
        return np.asarray(value).dtype.kind in "biufc"
    except (TypeError, ValueError, OverflowError):
        return False


def _said(kind: Any) -> str:
    said = list(dict.fromkeys(map(_named, _alternatives(kind))))
    return said[0] if len(said) == 1 else f"{', '.join(said[:-1])} or {said[-1]}"


def _named(kind: Any) -> str:
    origin, members = get_origin(kind), get_args(kind)
    if kind in NAMES:
        return NAMES[kind]
    if kind == ArrayLike:
        return "an array of numbers"
    if kind == PathLike[str]:
        return "a path"
    if origin is Literal:
        return ", ".join(f'"{name}"' for name in members)
    if origin is tuple and members[-1] is not Ellipsis:
        return f"({', '.join(map(_said, members))})"
    if origin is Callable or kind is Callable:
        return "a function"
    name = (origin or kind).__name__
    if not members or origin is np.ndarray:
        return f"an {name}" if name[0] in "AEIOU" else f"a {name}"
    within = " to ".join(_said(one) for one in members if one is not Ellipsis)
    return f"a {name.lower()} of {within}"


def _shown(value: Any) -> str:
    if is_whole(value) and abs(int(value)) >= LARGEST:
        return f"one of {int(abs(int(value)).bit_length() * np.log10(2)) + 1} digits"
    try:
        return Repr().repr(value)
    except ValueError:  # integers that Python does not spell
        return f"such a {type(value).__name__}"
