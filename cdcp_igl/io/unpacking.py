"""How much a packed file may hold."""

from __future__ import annotations

from .damage import Damage

__all__ = ["check_unpacking"]

# Arrays of a mesh pack to a fifth or a tenth of their size, those of a plane grid to a
# thirteenth; zeros pack to a thousandth, and a file of them that fits into an email would
# fill the memory. Up to a size that is read in a tenth of a second nothing is refused.
MOST_PACKED = 100
NEVER_REFUSED = 1 << 26  # bytes


def check_unpacking(name: str, size: int, packed: int) -> None:
    """Refuse what would unpack to much more than a mesh does; sizes in bytes."""
    if size > max(NEVER_REFUSED, MOST_PACKED * packed):
        raise Damage(
            f"{name} would unpack from {packed:,} to {size:,} bytes: more than "
            f"{MOST_PACKED} times its size, which is no mesh"
        )
