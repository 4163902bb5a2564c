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
from ..arrays import Floats, Ints
from ..atlas.surface import SurfaceMap, surface_map
from ..distortion import area_distortion
from ..io import whole_file, write_map
from ..io.polygons import naming_polygons
from ..io.writing import MapResult
from ..result.disk_map import DiskMap
from ..steps.phases import Progress
from ..surface.cleaning import clean
from .settings import Settings
from .stamps import Stamp, put_stamp

__all__ = ["Mapped", "map_surface"]

Array = NDArray[Any]


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
        What was changed before, a sentence each.
    n_written : int
        Vertices that are written; the others fill holes.
    written : (k,) ndarray of int64
        Faces that are written; the others fill holes, or are on no disk.
    indices : dict of str to ndarray
        What an npz file says beside V, F and uv: of a surface that was mended or cut, the rows
        that the vertices and faces come from, and the disk of each face.
    """

    V: Array
    F: Array
    result: DiskMap | SurfaceMap
    changes: tuple[str, ...]
    n_written: int
    written: Ints
    indices: dict[str, Array]

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
        suffix, disk = target.suffix.lower(), settings.disk
        V, F, like = self.V[: self.n_written], self.F[self.written], None
        uv: MapResult | Floats
        mended = settings.clean and self.changes
        if {suffix, source.suffix.lower()} == {".obj"} and not mended:
            # It keeps whatever else is in it, and faces on no disk as well.
            F, uv, like = self.F, self.result, source
        elif isinstance(self.result, DiskMap):
            uv = self.result.uv[: self.n_written]
        elif disk or suffix == ".npz":
            uv = self.result.uv[self.written]
        else:
            uv, disk = self.result.packed()[self.written], True  # in the unit square already
        with whole_file(target) as unfinished:
            write_map(unfinished, V, F, uv, disk=disk, like=like)
            if suffix == ".npz" and self.indices:
                _add_arrays(unfinished, self.indices)
            put_stamp(unfinished, stamp)

    def measures(self) -> dict[str, Any]:
        """Return what a `Record` has of the map."""
        return {
            "changes": self.changes,
            "disks": len(self.disks),
            "flips": sum(len(disk.certificate.flipped) for disk in self.disks),
            "mean": self.result.distortion.mean,
            "sd": self.result.distortion.sd,
            "area": float(np.abs(self._area_distortion()).mean()),
            "conformal": all(disk.conformal for disk in self.disks),
            "boundary": ", ".join(dict.fromkeys(disk.boundary.name for disk in self.disks)),
        }

    def report(self) -> dict[str, Any]:
        """Return everything but the coordinates, as JSON types."""
        if isinstance(self.result, DiskMap):
            return self.result.report()
        return {
            "faces": len(self.F),
            "valid": self.result.valid,
            "changes": list(self.changes),
            "angular_distortion_degrees": asdict(self.result.distortion),
            "spread": self.result.spread,
            "disks": [disk.report() for disk in self.disks],
        }

    def _area_distortion(self) -> Floats:
        if isinstance(self.result, DiskMap):
            return area_distortion(self.V, self.F, self.result.uv)
        # The disks side by side, by area, and each corner on its own.
        corners, packed = self.V[self.F[self.written]], self.result.packed()[self.written]
        (x, y), (p, q) = (packed[:, 1] - packed[:, 0]).T, (packed[:, 2] - packed[:, 0]).T
        turned = x * q < y * p  # in the given surface, which is left as it is
        for array in (corners, packed):
            array[turned] = array[turned, ::-1]
        V, uv = (array.reshape(-1, array.shape[-1]) for array in (corners, packed))
        return area_distortion(V, np.arange(len(V)).reshape(-1, 3), uv)


def map_surface(
    V: Array, F: Array, whole: Array, settings: Settings, progress: Progress | None = None
) -> Mapped:
    """Mend a surface or cut it open around its polygons, if that is asked for, and map it.

    Raises
    ------
    MeshError, SolverError, MapError, ValueError
        As `disk_map` and `surface_map`.
    """
    if settings.clean:  # which numbers the faces anew
        return _mended_and_mapped(V, F, settings, progress)
    with naming_polygons(whole):
        if settings.cut:
            return _cut_and_mapped(V, F, whole, settings, progress)
        result = disk_map(V, F, progress=progress, **settings.options)
    return Mapped(V, F, result, (), len(V), np.arange(len(F)), {})


def _mended_and_mapped(V: Array, F: Array, settings: Settings, progress: Progress | None) -> Mapped:
    V, F, vertex_index, face_index = cleaned = clean(V, F)
    n, m = int((vertex_index >= 0).sum()), int((face_index >= 0).sum())  # the filling comes last
    note = ("The filling is not in the file.",) if m < len(F) else ()
    options = dict(settings.options)
    for name, kind, index in (("align", "vertex", vertex_index), ("center", "face", face_index)):
        if isinstance(row := options.get(name), int | np.integer):  # of the file
            options[name] = _mended_row(index, row, f"{name} is {kind} {row}")
    result = disk_map(V, F, progress=progress, **options)
    indices = {"vertex_index": vertex_index[:n], "face_index": face_index[:m]}
    return Mapped(V, F, result, (*cleaned.changes, *note), n, np.arange(m), indices)


def _mended_row(index: Ints, row: int | np.integer, what: str) -> int:
    """Find a given row among those that are left; ValueError if it is not there."""
    rows = np.flatnonzero(index == row)
    if not len(rows):
        raise ValueError(f"{what}, which is not in the mended surface")
    return int(rows[0])


def _cut_and_mapped(
    V: Array, F: Array, whole: Array, settings: Settings, progress: Progress | None
) -> Mapped:
    result = surface_map(V, F, whole=whole, progress=progress, **settings.options)
    rows = np.flatnonzero(result.face_disk >= 0)
    left_out = len(F) - len(rows)
    note = (f"faces on no disk: {left_out:,}",) if left_out else ()
    indices = {"face_index": rows, "face_disk": result.face_disk[rows]}
    return Mapped(V, F, result, (*result.changes, *note), len(V), rows, indices)


def _add_arrays(path: Path, arrays: dict[str, Array]) -> None:
    with ZipFile(path, "a") as archive:
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w") as member:
                npy.write_array(member, array)
