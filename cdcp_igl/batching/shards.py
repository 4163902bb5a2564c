"""Shares of the surfaces, for job arrays and several machines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

__all__ = ["Shard", "read_shard", "shard_of"]

Shard = tuple[int, int]  # part i of n, from 1

Item = TypeVar("Item")


def read_shard(text: str) -> Shard:
    """Read ``"i/n"``; ValueError if that is no part."""
    part, slash, parts = text.partition("/")
    if not (slash and part.isdecimal() and parts.isdecimal() and 1 <= int(part) <= int(parts)):
        raise ValueError("must be I/N, with I from 1 to N.")
    return int(part), int(parts)


def shard_of(items: Sequence[Item], shard: Shard | None) -> Sequence[Item]:
    """Take every n-th from the i-th on, or all; ValueError if there is no such part."""
    part, parts = shard or (1, 1)
    if not 1 <= part <= parts:
        raise ValueError(f"shard must be (i, n) with i from 1 to n, not {shard!r}")
    return items[part - 1 :: parts]
