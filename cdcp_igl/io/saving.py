"""A map to the kind of file that its name asks for."""

from __future__ import annotations

import json
from os import PathLike
from pathlib import Path
from typing import Any, Protocol

from numpy.typing import NDArray

from ..arrays import Floats
from ..surface.mesh import DiskMesh
from .output import whole_file
from .writing import WRITABLE, write_map

__all__ = ["save"]


class Saved(Protocol):
    """A map of a disk that can show itself: a DiskMap or a RectangleMap."""

    @property
    def uv(self) -> Floats:
        """(n, 2) images of the vertices."""

    @property
    def mesh(self) -> DiskMesh:
        """The surface."""

    def plot(self) -> NDArray[Any]:
        """Draw it; return the axes."""

    def view(self, path: str | PathLike[str]) -> Path:
        """Write its page."""

    def report(self) -> dict[str, Any]:
        """Tell all but the coordinates."""


PICTURES = (".pdf", ".png", ".svg")


def save(result: Saved, path: str | PathLike[str]) -> None:
    """Write a map; see `DiskMap.save`."""
    suffix = Path(path).suffix.lower()
    if suffix in WRITABLE:
        write_map(path, result.mesh.positions, result.mesh.F, result)
    elif suffix in PICTURES:
        figure = result.plot()[0].figure
        with whole_file(path) as unfinished:
            figure.savefig(unfinished)
    elif suffix == ".html":
        result.view(path)
    elif suffix == ".json":
        with whole_file(path) as unfinished:
            text = json.dumps(result.report(), indent=2, ensure_ascii=False)
            unfinished.write_text(text + "\n", encoding="utf-8")
    else:
        known = " ".join((*WRITABLE, *PICTURES, ".html", ".json"))
        raise ValueError(f"{Path(path).name!r} is of no known type. Writable: {known}")
