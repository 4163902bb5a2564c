"""What a batch does with every surface."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from ..io import WRITABLE
from ..steps.options import Options

__all__ = ["Settings"]

OF_CUT = ("fill", "spread")  # options that only `surface_map` has


@dataclass(frozen=True)
class Settings:
    """The options that decide what the results are; ValueError if one is none of those allowed.

    Attributes
    ----------
    format : str
        Suffix of the results, without its dot.
    disk : bool
        Texture coordinates in the unit disk, not in the unit square.
    clean : bool
        Mend each surface first.
    cut : bool
        Map surfaces that are no disks as well, see `surface_map`.
    options : mapping
        Those of `disk_map`, or of `surface_map`.
    """

    format: str = "npz"
    disk: bool = False
    clean: bool = False
    cut: bool = False
    options: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if f".{self.format}" not in WRITABLE:
            formats = ", ".join(suffix[1:] for suffix in WRITABLE)
            raise ValueError(f"format must be one of {formats}, not {self.format!r}")
        if self.cut and self.clean:
            raise ValueError("cut mends what it must by itself; leave out clean")
        of_map = {name: value for name, value in self.options.items() if name not in OF_CUT}
        checked = Options(**of_map)
        if self.cut and not isinstance(checked.center, str):
            raise ValueError("center must be a method, not a face, where surfaces are cut")
        if self.cut and isinstance(checked.align, int | np.integer):
            raise ValueError("align must be a direction, not a vertex, where surfaces are cut")
        if not self.cut and len(of_map) < len(self.options):
            raise ValueError(f"{' and '.join(OF_CUT)} are for surfaces that are cut")

    @property
    def digest(self) -> str:
        """Tells these settings from others."""
        text = json.dumps(asdict(self), sort_keys=True, default=_plain)
        return hashlib.sha256(text.encode()).hexdigest()[:16]


def _plain(value: object) -> object:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"{value!r} is no option of a batch: it cannot be written down")
