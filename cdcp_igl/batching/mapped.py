"""A surface from a file, mapped, and what is written of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import numpy as np
from numpy.lib import format as npy
from numpy.typing import ArrayLike, NDArray

from ..algorithm import disk_map
from ..arrays import Floats
from ..distortion import area_distortion
from ..io import whole_file, write_map
from ..result import DiskMap
from ..steps.phases import Progress
from ..surface.cleaning import clean
from .settings import Settings
from .stamps import Stamp, put_stamp

__all__ = ["Mapped", "map_surface"]


@dataclass(frozen=True, eq=False)
class Mapped:
    """A surface, its map, and what came before.

    Attributes
    ----------
    V : (n, 3) ndarray
    F : (m, 3) ndarray
        The surface that was mapped: that of the file, or what it was mended to.
    result : DiskMap
    changes : tuple of str
        What was changed on mending, a sentence each.
    indices : dict of str to ndarray
        Where the rows come from, if they are not those of the file.
    n, m : int
        The rows that are written; others fill holes.
    """

    V: NDArray[Any]
    F: NDArray[Any]
    result: DiskMap
    changes: tuple[str, ...]
    indices: dict[str, NDArray[Any]]
    n: int
    m: int

    def write(self, target: Path, source: Path, settings: Settings, stamp: Stamp) -> None:
        """Write the map, with the mark of what it was made from.

        Raises
        ------
        OSError
            If it cannot be written.
        """
        obj = {target.suffix.lower(), source.suffix.lower()} == {".obj"}
        like = source if obj and not settings.clean else None
        with whole_file(target) as unfinished:
            V, F, uv = self.V[: self.n], self.F[: self.m], self.result.uv[: self.n]
            write_map(unfinished, V, F, uv, disk=settings.disk, like=like)
            if target.suffix.lower() == ".npz":
                _add_arrays(unfinished, self.indices)
            put_stamp(unfinished, stamp)

    def measures(self) -> dict[str, Any]:
        """Return what a `Record` has of the map."""
        result = self.result
        return {
            "changes": self.changes,
            "disks": 1,
            "flips": len(result.certificate.flipped),
            "mean": result.distortion.mean,
            "sd": result.distortion.sd,
            "area": _area(self.V, self.F, result.uv),
            "conformal": result.conformal,
            "boundary": result.trace.name,
        }


def map_surface(
    V: NDArray[Any], F: NDArray[Any], settings: Settings, progress: Progress | None = None
) -> Mapped:
    """Mend a surface if that is asked for, and map it.

    Raises
    ------
    MeshError, SolverError, MapError, ValueError
        As `disk_map`.
    """
    n, m, changes, indices = len(V), len(F), list[str](), dict[str, NDArray[Any]]()
    if settings.clean:
        V, F, vertex_index, face_index = cleaned = clean(V, F)
        n, m = int((vertex_index >= 0).sum()), int((face_index >= 0).sum())  # filling comes last
        indices = {"vertex_index": vertex_index[:n], "face_index": face_index[:m]}
        changes += cleaned.changes
        if m < len(F):
            changes.append("The filling is not in the file.")
    result = disk_map(V, F, progress=progress, **settings.options)
    return Mapped(V, F, result, tuple(changes), indices, n, m)


def _area(V: ArrayLike, F: ArrayLike, uv: Floats) -> float:
    return float(np.abs(area_distortion(V, F, uv)).mean())


def _add_arrays(path: Path, arrays: dict[str, NDArray[Any]]) -> None:
    with ZipFile(path, "a") as archive:
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w") as member:
                npy.write_array(member, array)
