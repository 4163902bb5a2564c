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
    options : mapping
        Those of `disk_map`.
    """

    format: str = "npz"
    disk: bool = False
    clean: bool = False
    options: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if f".{self.format}" not in WRITABLE:
            formats = ", ".join(suffix[1:] for suffix in WRITABLE)
            raise ValueError(f"format must be one of {formats}, not {self.format!r}")
        Options(**self.options)

    @property
    def digest(self) -> str:
        """Tells these settings from others."""
        text = json.dumps(asdict(self), sort_keys=True, default=_plain)
        return hashlib.sha256(text.encode()).hexdigest()[:16]


def _plain(value: object) -> object:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"{value!r} is no option of a batch: it cannot be written down")
