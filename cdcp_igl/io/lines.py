"""Lines of text files, as programs on all systems write them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import chain
from pathlib import Path

from .damage import Damage

__all__ = ["BYTE_ORDER_MARK", "culprit", "words_of_lines"]

# Of UTF-8, read as Latin-1: every sequence of bytes is text in Latin-1, and numbers and
# keywords are the same in both.
BYTE_ORDER_MARK = "\xef\xbb\xbf"


def words_of_lines(path: Path, *, continued: bool = False) -> Iterator[tuple[int, list[str]]]:
    r"""Yield number and words of each line that is not empty, comments taken off.

    Parameters
    ----------
    path : Path
    continued : bool
        A line that ends with a backslash goes on in the next; it has the number of the last.

    Raises
    ------
    Damage
        If it is no text: UTF-16, or binary.
    """
    before: list[str] = []
    with path.open(encoding="latin-1") as file:  # \r and \r\n end lines as \n does
        first = file.readline().removeprefix(BYTE_ORDER_MARK)
        if "\0" in first:
            raise Damage("it is no text in UTF-8 or Latin-1")
        for number, line in enumerate(chain([first], file), 1):
            if "#" in line:
                line = line.partition("#")[0]
            words = line.split()
            if continued and "\\" in line and words and words[-1].endswith("\\"):
                before += [*words[:-1], words[-1][:-1]]
                continue
            if before:
                words, before = [word for word in (*before, *words) if word], []
            if words:
                yield number, words
    if before:
        raise Damage("it ends in the middle of a line that goes on")


def culprit(words: list[str], kind: Callable[[str], object], what: str) -> str:
    """Say which of the words is not of a kind; there is one."""
    for word in words:
        try:
            kind(word)
        except (ValueError, OverflowError):
            return f"{word!r} is no {what}"
    return f"it has too few {what}s"
