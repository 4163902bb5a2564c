"""Rows in a file that a killed run goes on with: one JSON object a line."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

__all__ = ["Lines"]


class Lines:
    """A file of rows.

    Parameters
    ----------
    path : Path
        It and its folder are made with the first row.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    def read(self) -> list[dict[str, Any]]:
        """All rows, in the order in which they came, NaN for null.

        A half-written last line does not count.
        """
        if not self.path.exists():
            return []
        lines = self.path.read_text(encoding="utf-8").splitlines(keepends=True)
        rows = (json.loads(line) for line in lines if line.endswith("\n"))
        return [{k: np.nan if x is None else x for k, x in row.items()} for row in rows]

    def append(self, row: Mapping[str, Any]) -> None:
        """Add a row, null for NaN and infinity; once this returns, it is on disk."""
        finite = {
            name: None if isinstance(value, float) and not np.isfinite(value) else value
            for name, value in row.items()
        }
        line = json.dumps(finite, ensure_ascii=False, allow_nan=False)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with self.path.open("ab+") as file:
            if file.tell():
                file.seek(-1, os.SEEK_END)
                if file.read(1) != b"\n":  # a line that a killed run left unfinished goes
                    file.truncate(self.path.read_bytes().rfind(b"\n") + 1)
            file.write(line.encode() + b"\n")
            file.flush()
            os.fsync(file.fileno())
