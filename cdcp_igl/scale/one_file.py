"""One surface, from what a file holds to a file: cleaned or cut open if asked for, mapped, written.

The command ``map`` and the workers of a batch both go this way.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Ints
from ..atlas.charts import Outline
from ..atlas.surface import SurfaceMap, surface_map
from ..io import write_map
from ..io.output import whole_file
from ..io.polygons import naming_polygons
from ..maps.annulus import AnnulusMap, annulus_map
from ..maps.disk import disk_map
from ..maps.free import FreeMap, free_map
from ..maps.sphere import SphereMap, sphere_map
from ..options import Options
from ..phases import Progress
from ..result.disk_map import DiskMap
from ..surface.cleaning import clean

Array = NDArray[Any]

# Options that `surface_map` has and `disk_map` has not, and those that `free_map` has not.
ONLY_OF_CUT = ("fill", "scale_variation", "max_charts")
ONLY_OF_DISKS = ("center", "mobius", "preset")
# What a surface may be mapped onto, besides disks, and the options of that.
REFINED = {"refine", "refine_norm", "refine_seconds", "solver"}
TARGETS: dict[str, tuple[Callable[..., SphereMap | AnnulusMap], set[str]]] = {
    "annulus": (annulus_map, REFINED),
    "sphere": (sphere_map, REFINED | {"mobius"}),
}


@dataclass(frozen=True)
class Settings:
    """What decides how a surface is mapped and written; ValueError if something is not allowed.

    With `disk`, texture coordinates lie in the unit disk, not in the unit square. The `options`
    are those of `disk_map`; with `cut`, of `surface_map`, which maps surfaces that are no disks;
    with `free`, of `free_map`, and with both the charts have free outlines; or those of what maps
    `onto` something else, one of `TARGETS`.
    """

    disk: bool = False
    clean: bool = False
    cut: bool = False
    free: bool = False
    onto: str | None = None
    options: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.onto is not None:
            self._check_target(self.onto)
            return
        if self.free and self.disk:
            raise ValueError("with a free outline there is no disk; leave out disk")
        if self.free and (of_disks := [name for name in ONLY_OF_DISKS if name in self.options]):
            raise ValueError(f"a map with a free outline has no {' and no '.join(of_disks)}")
        of_map = {name: value for name, value in self.options.items() if name not in ONLY_OF_CUT}
        checked = Options(**of_map)
        if self.cut and not isinstance(checked.center, str):
            raise ValueError("center must be a method, not a face, where surfaces are cut")
        if self.cut and isinstance(checked.align, int | np.integer):
            raise ValueError("align must be a direction, not a vertex, where surfaces are cut")
        if not self.cut and (of_cut := [name for name in ONLY_OF_CUT if name in self.options]):
            raise ValueError(f"only a surface that is cut has {' and '.join(of_cut)}")

    def _check_target(self, onto: str) -> None:
        if onto not in TARGETS:
            raise ValueError(f"onto must be one of {', '.join(TARGETS)}, not {onto!r}")
        cleaned = ("clean",) if onto == "annulus" else ()  # which would fill the holes
        others = [name for name in ("disk", "cut", "free", *cleaned) if getattr(self, name)]
        if others := others + sorted(set(self.options) - TARGETS[onto][1]):
            raise ValueError(f"{', '.join(others)}: no option of a map onto the {onto}")


@dataclass(frozen=True, eq=False)
class Mapped:
    """The surface that was mapped, as given or cleaned, its map, and what came before.

    `indices` is what an npz file holds beside V, F and uv: of a surface that was cleaned or cut,
    the rows that the vertices and faces come from, and the disk of each face.
    """

    V: Array
    F: Array
    result: DiskMap | FreeMap | SurfaceMap | SphereMap | AnnulusMap
    changes: tuple[str, ...]  # before the map, a sentence each
    n_written: int  # vertices that are written; the others fill holes
    written: Ints  # faces that are written; the others fill holes, or are on no disk
    indices: dict[str, Any]
    as_read: bool = True  # whether nothing was changed by cleaning

    @property
    def maps(self) -> tuple[DiskMap | FreeMap, ...]:
        """The maps, that of the component with most faces first."""
        if isinstance(self.result, SurfaceMap):
            return self.result.charts
        return (self.result,) if isinstance(self.result, DiskMap | FreeMap) else ()

    def write(self, target: Path, source: Path, settings: Settings) -> None:
        """Write the map in the format of its suffix; OSError if the file cannot be written.

        If `source`, which the surface was read from, is an obj file that was not cleaned, and so
        is `target`, the rest of that file is kept.
        """
        suffix, result, V, F = target.suffix.lower(), self.result, self.V, self.F
        if {suffix, source.suffix.lower()} == {".obj"} and self.as_read:
            write_map(target, V, F, result, disk=settings.disk, like=source)
            return
        V, F = V[: self.n_written], F[self.written]
        rows = slice(self.n_written) if result.uv.ndim == 2 else self.written
        if suffix == ".npz":
            arrays = dict(self.indices)
            if isinstance(result, SphereMap):
                arrays["points"] = result.points[: self.n_written]
            with whole_file(target) as unfinished, unfinished.open("wb") as file:
                np.savez(file, V=V, F=F, uv=result.uv[rows], **arrays)
        else:
            uv = result.uv if settings.disk else result.packed()
            write_map(target, V, F, uv[rows], disk=True)  # as it is

    def measures(self) -> dict[str, Any]:
        """Return what the record of a batch has of the map."""
        result = self.result
        return {
            "disks": len(self.maps),
            "flips": len(result.certificate.flipped),
            "mean": result.distortion.mean,
            "sd": result.distortion.sd,
            "area": float(np.abs(result.area_distortion()).mean()),
            "conformal": result.conformal,
            "reasons": "; ".join(result.conformality.reasons),
            "boundary": ", ".join(dict.fromkeys(_boundary(map_) for map_ in self.maps)),
        }

    def report(self) -> dict[str, Any]:
        """Return everything but the coordinates, as JSON types."""
        return self.result.report() | ({"changes": list(self.changes)} if self.changes else {})


def _boundary(map_: DiskMap | FreeMap) -> str:
    return map_.boundary.name if isinstance(map_, DiskMap) else map_.boundary


def map_one(
    V: Array,
    F: Array,
    polygon_of_face: Array,
    settings: Settings,
    progress: Progress | None = None,
) -> Mapped:
    """Map a surface as `read_polygons` has read it, cleaned or cut open if that is asked for.

    The errors are those of `disk_map` and its kin; MeshError names polygons of the file.
    """
    if not settings.clean:
        with naming_polygons(polygon_of_face):
            return _map(V, F, polygon_of_face, settings, settings.options, progress)
    cleaned = clean(V, F)  # which numbers the faces anew
    vertex_index, face_index = cleaned.vertex_index, cleaned.face_index
    n, m = int((vertex_index >= 0).sum()), int((face_index >= 0).sum())  # the filling comes last
    filling = polygon_of_face.max() + np.arange(1, len(face_index) - m + 1)
    polygon = np.append(polygon_of_face[face_index[:m]], filling)
    options = dict(settings.options)
    for name, kind, index in (("align", "vertex", vertex_index), ("center", "face", face_index)):
        if isinstance(row := options.get(name), int | np.integer):  # of the file
            options[name] = _row_after_cleaning(index, row, f"{name} is {kind} {row}")
    mapped = _map(cleaned.V, cleaned.F, polygon, settings, options, progress)
    kept = mapped.written < m
    indices = {name: rows[kept] for name, rows in mapped.indices.items()}
    indices |= {"vertex_index": vertex_index[:n], "face_index": face_index[mapped.written[kept]]}
    note = ("The filling is not in the file.",) if m < len(face_index) else ()
    return replace(
        mapped,
        changes=(*cleaned.changes, *mapped.changes, *note),
        n_written=n,
        written=mapped.written[kept],
        indices=indices,
        as_read=not cleaned.changes,
    )


def _row_after_cleaning(index: Ints, row: int | np.integer, what: str) -> int:
    """Find a given row among those that are left; ValueError if it is not there."""
    rows = np.flatnonzero(index == row)
    if not len(rows):
        raise ValueError(f"{what}, which is not in the cleaned surface")
    return int(rows[0])


def _map(
    V: Array,
    F: Array,
    polygon_of_face: Array,
    settings: Settings,
    options: Mapping[str, Any],
    progress: Progress | None,
) -> Mapped:
    if not settings.cut:
        function: Callable[..., DiskMap | FreeMap | SphereMap | AnnulusMap]
        function = free_map if settings.free else disk_map
        if settings.onto:
            function = TARGETS[settings.onto][0]
        result = function(V, F, progress=progress, **options)
        return Mapped(V, F, result, (), len(V), np.arange(len(F)), {})
    outline: Outline = "free" if settings.free else "disk"
    cut = surface_map(
        V, F, polygon_of_face=polygon_of_face, outline=outline, progress=progress, **options
    )
    rows = np.flatnonzero(cut.face_chart >= 0)
    left_out = len(F) - len(rows)
    note = (f"faces in no chart: {left_out:,}",) if left_out else ()
    indices = {"face_index": rows, "face_chart": cut.face_chart[rows]}
    return Mapped(V, F, cut, (*cut.changes, *note), len(V), rows, indices)
