"""A surface from a file, mapped, and what is written of it."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from ..algorithm import disk_map
from ..atlas import SurfaceMap, surface_map
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
    result : DiskMap or SurfaceMap
    changes : tuple of str
        What was changed on mending, a sentence each.
    indices : dict of str to ndarray
        Of a mended surface, the rows of the file that its vertices and faces come from; of one
        that was cut, the disk of each face.
    n, m : int
        The rows that are written; others fill holes.
    """

    V: NDArray[Any]
    F: NDArray[Any]
    result: DiskMap | SurfaceMap
    changes: tuple[str, ...]
    indices: dict[str, NDArray[Any]]
    n: int
    m: int

    @property
    def disks(self) -> tuple[DiskMap, ...]:
        """The maps, that of the part with most faces first."""
        return (self.result,) if isinstance(self.result, DiskMap) else self.result.disks

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
            V, F, uv = self.V[: self.n], self.F[: self.m], self.result
            if isinstance(uv, DiskMap):
                write_map(unfinished, V, F, uv.uv[: self.n], disk=settings.disk, like=like)
            else:
                write_map(unfinished, V, F, uv, disk=settings.disk, like=like)
            if target.suffix.lower() == ".npz":
                _add_arrays(unfinished, self.indices)
            put_stamp(unfinished, stamp)

    def measures(self) -> dict[str, Any]:
        """Return what a `Record` has of the map."""
        result = self.result
        if isinstance(result, DiskMap):
            area = area_distortion(self.V, self.F, result.uv)
        else:  # the disks side by side, by area, and each corner on its own
            corners = np.arange(self.F.size).reshape(-1, 3)
            packed = result.packed().reshape(-1, 2)
            area = area_distortion(self.V[self.F].reshape(len(packed), -1), corners, packed)
        return {
            "changes": self.changes,
            "disks": len(self.disks),
            "flips": sum(len(disk.certificate.flipped) for disk in self.disks),
            "mean": result.distortion.mean,
            "sd": result.distortion.sd,
            "area": float(np.abs(area).mean()),
            "conformal": all(disk.conformal for disk in self.disks),
            "boundary": ", ".join(dict.fromkeys(disk.trace.name for disk in self.disks)),
        }

    def report(self) -> dict[str, Any]:
        """Return everything but the coordinates, as JSON types."""
        if isinstance(self.result, DiskMap):
            return self.result.report()
        disks = [disk.report() for disk in self.disks]
        return {
            "faces": self.m,
            "valid": self.result.valid,
            "changes": list(self.changes),
            "angular_distortion_degrees": asdict(self.result.distortion),
            "spread": self.result.spread,
            "disks": disks,
        }


def map_surface(
    V: NDArray[Any], F: NDArray[Any], settings: Settings, progress: Progress | None = None
) -> Mapped:
    """Mend a surface or cut it open, if that is asked for, and map it.

    Raises
    ------
    MeshError, SolverError, MapError, ValueError
        As `disk_map` and `surface_map`.
    """
    if settings.cut:
        cut = surface_map(V, F, progress=progress, **settings.options)
        return Mapped(V, F, cut, cut.changes, {"face_disk": cut.face_disk}, len(V), len(F))
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


def _add_arrays(path: Path, arrays: dict[str, NDArray[Any]]) -> None:
    with ZipFile(path, "a") as archive:
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w") as member:
                npy.write_array(member, array)
