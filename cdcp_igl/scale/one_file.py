"""One surface, from what a file holds to a file: cleaned or cut open if asked for, mapped, written.

The command ``map`` and the workers of a batch both go this way.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, fields, replace
from difflib import get_close_matches
from functools import partial
from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Ints
from ..atlas.surface import surface_map
from ..errors import MeshError
from ..io import WRITABLE, read_vertices, write_map
from ..io.output import whole_file
from ..io.polygons import naming_polygons
from ..io.texture import with_texture
from ..io.writing import carries, warn_of_loss
from ..maps.annulus import annulus_map
from ..maps.disk import disk_map
from ..maps.free import free_map
from ..maps.rectangle import rectangle_map
from ..maps.sphere import sphere_map
from ..phases import Progress
from ..result.base import Result
from ..result.disk_map import DiskMap
from ..result.rectangle_map import RectangleMap
from ..result.sphere_map import SphereMap
from ..result.surface_map import SurfaceMap
from ..surface.cleaning import Cleaned, clean, submesh
from ..surface.triangles import face_areas
from ..verdict.distortion import AreaDistortion, area_distortion

Array = NDArray[Any]

# The maps that a file can be mapped by, and which flags of `Settings` mean something to each. What
# else it takes is in its signature.
MAPS: dict[str, tuple[Callable[..., Result], set[str]]] = {
    "disk": (disk_map, {"disk", "clean"}),
    "free": (free_map, {"free", "clean"}),
    "surface": (surface_map, {"cut", "disk", "free", "clean"}),
    "sphere": (sphere_map, {"clean"}),
    "annulus": (annulus_map, {"clean"}),
    "rectangle": (rectangle_map, {"clean"}),
}
ONTO = ("sphere", "annulus", "rectangle")
FLAGS = ("disk", "clean", "cut", "free")
# Arguments that are no options: the surface, what the file and the flags say, and who is told.
BY_ROWS = "boundary_scale", "seams", "forbidden"
OWN = ("V", "F", "folder", "polygon_of_face", "executor", "progress")
NOTHING = np.empty((0, 3)), np.empty((0, 3), np.int64)


@dataclass(frozen=True)
class Settings:
    """What decides how a surface is mapped and written; ValueError if something is not allowed.

    With `disk`, texture coordinates lie in the unit disk, not in the unit square. A surface that
    is to be `cut` is mapped onto charts with free outlines or, with `disk`, onto disks; a disk may
    have a `free` outline, too; or a surface is mapped `onto` something else. The `options` are
    those of this map.
    Vertices along seams that lie `within` a distance of each other are merged by `clean`.
    With `bake`, the image that the file shows is baked with so many pixels along each side.
    Of the vertices, `only` some are mapped, or all `without` some: a file, see `read_vertices`.
    """

    disk: bool = False
    clean: bool = False
    cut: bool = False
    free: bool = False
    onto: str | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    only: str | None = None
    without: str | None = None
    within: float = 0.0
    bake: int | None = None

    def __post_init__(self) -> None:
        if self.only and self.without:
            raise ValueError("only and without: give one of them")
        if not self.within >= 0:
            raise ValueError(f"within must be 0 or more, not {self.within!r}")
        if self.within and not self.clean:
            raise ValueError("within is how near clean merges vertices: it needs clean")
        if self.bake is not None and (self.disk or self.clean or self.is_part):
            raise ValueError(
                "bake is over the unit square, of whole surfaces: leave out disk, clean"
            )
        if self.bake is not None and self.bake < 1:
            raise ValueError(f"bake must be 1 or more pixels, not {self.bake!r}")
        if self.onto not in (None, *ONTO):
            raise ValueError(f"onto must be one of {', '.join(ONTO)}, not {self.onto!r}")
        if self.disk and self.free:
            raise ValueError("with a free outline there is no disk; leave out disk")
        function, flags = MAPS[self.kind]
        given = [*(name for name in FLAGS if getattr(self, name)), *self.options]
        refuse_unknown(self.kind, function, given, flags)
        by_rows = [name for name in self.options if name in BY_ROWS]
        if (self.clean or self.is_part) and by_rows:
            raise ValueError(f"{by_rows[0]} is by rows, which clean and parts change")
        if (self.clean or self.is_part) and self.options.get("split"):
            raise ValueError("split is for surfaces as they are: clean them first, to a file")
        with suppress(MeshError):  # of no surface, which comes when the options have been looked at
            self.map(NOTHING)

    @property
    def kind(self) -> str:
        """Which of the maps it is."""
        return self.onto or ("surface" if self.cut else "free" if self.free else "disk")

    @property
    def is_part(self) -> bool:
        """Whether some vertices are left out."""
        return bool(self.only or self.without)

    def map(
        self,
        surface: tuple[Array, Array] | Cleaned,
        polygon_of_face: Array | None = None,
        progress: Progress | None = None,
    ) -> Result:
        """Map a surface; the errors are those of `disk_map` and its kin."""
        own: dict[str, Any] = {"progress": progress}
        if self.cut:
            outline = "disk" if self.disk else "free"
            own |= {"polygon_of_face": polygon_of_face, "outline": outline}
        return MAPS[self.kind][0](surface, **own | dict(self.options))


NAMES = tuple(field.name for field in fields(Settings) if field.name != "options")


def refuse_unknown(
    kind: str, function: Callable[..., Any], given: Collection[str], flags: Collection[str] = ()
) -> None:
    """Raise ValueError for what a map does not take, with the nearest name, or what it lacks."""
    options = [one for one in signature(function).parameters.values() if one.name not in OWN]
    known = [*flags, *(option.name for option in options)]
    if unknown := [name for name in given if name not in known]:
        first, hint = unknown[0], ""
        if others := [name for name in MAPS if first in signature(MAPS[name][0]).parameters]:
            named = " or ".join(others).replace("surface", "surface (cut)")
            hint = f"; the {named} map has it" if first not in OWN else ""
        elif near := get_close_matches(first, known, 1):
            hint = f"; did you mean {near[0]}?"
        raise ValueError(f"{', '.join(unknown)}: no option of the {kind} map{hint}")
    needed = [option.name for option in options if option.default is option.empty]
    if missing := [name for name in needed if name not in given]:
        raise ValueError(f"the {kind} map needs {', '.join(missing)}")


@dataclass(frozen=True, eq=False)
class Mapped:
    """The surface that was mapped, as given or cleaned, its map, and what came before.

    `indices` is what an npz file holds beside V, F and uv: of a surface that was cleaned or cut,
    the rows that the vertices and faces come from, and the disk of each face.
    """

    V: Array
    F: Array
    result: Result
    changes: tuple[str, ...]  # before the map, a sentence each
    n_written: int  # vertices that are written; the others fill holes
    written: Ints  # faces that are written; the others fill holes, or are on no disk
    indices: dict[str, Any]
    as_read: bool = True  # whether nothing was changed by cleaning

    def write(self, target: Path, source: Path, settings: Settings) -> None:
        """Write the map in the format of its suffix; OSError if the file cannot be written.

        If `target` has the type of `source`, which the surface was read from, and nothing was
        cleaned, the rest of that file is kept.
        """
        suffix, result, V, F = target.suffix.lower(), self.result, self.V, self.F
        if settings.bake:
            image = result.bake(source, settings.bake)
            write_map(target, V, F, result, like=source, image=image)
            return
        if suffix not in WRITABLE:  # but by its whole name
            write_map(target, V, F, result, like=source)
            return
        if self.as_read and suffix != ".npz" and carries(source, suffix):
            write_map(target, V, F, result, disk=settings.disk, like=source)
            return
        warn_of_loss(source, target, rows=False)
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
        charts = result.charts if isinstance(result, SurfaceMap) else (result,)
        V, F, image = result._layout().drawn
        areas = AreaDistortion.of(np.exp(area_distortion(V, F, image)), face_areas(V, F))
        return {
            "left_out": result.left_out,
            "charts": len(charts),
            "flips": len(result.certificate.flipped),
            "mean": result.distortion.mean,
            "sd": result.distortion.sd,
            "area_sd": areas.sd,
            "texels": areas.texels,
            "conformal": result.conformal,
            "reasons": "; ".join(result.conformality.reasons),
            "boundary": ", ".join(dict.fromkeys(map(_boundary, charts))),
        }

    def report(self) -> dict[str, Any]:
        """Return everything but the coordinates, as JSON types."""
        return self.result.report() | ({"changes": list(self.changes)} if self.changes else {})


def _boundary(chart: Any) -> str:
    """How the boundary of a map was laid out."""
    if isinstance(chart, SphereMap):
        return "none"
    return chart.boundary.name if isinstance(chart, DiskMap) else chart.boundary


def map_one(
    V: Array,
    F: Array,
    polygon_of_face: Array,
    settings: Settings,
    progress: Progress | None = None,
    *,
    source: Path,
) -> Mapped:
    """Map a surface as `read_polygons` has read it from `source`, cleaned or cut open if asked to.

    The errors are those of `disk_map` and its kin; MeshError names polygons of the file.
    """
    if not settings.clean and not settings.is_part:
        settings = replace(settings, options=with_texture(settings.options, source))
        with naming_polygons(polygon_of_face):
            return _map((V, F), polygon_of_face, settings, progress)
    cleaned = _prepared(V, F, settings, source)  # where faces have other numbers
    vertex_index, face_index = cleaned.vertex_index, cleaned.face_index
    n, m = int((vertex_index >= 0).sum()), int((face_index >= 0).sum())  # the filling comes last
    filling = polygon_of_face.max() + np.arange(1, len(face_index) - m + 1)
    polygon = np.append(polygon_of_face[face_index[:m]], filling)
    options = {
        name: _after_cleaning(name, value, face_index if name == "center" else vertex_index)
        for name, value in settings.options.items()
    }
    settings = replace(settings, options=options)
    mapped = _map(cleaned, polygon, settings, progress)
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


def _prepared(V: Array, F: Array, settings: Settings, source: Path) -> Cleaned:
    """Take the part that is to be mapped, and clean it if asked to."""
    cleaning = partial(
        clean,
        within=settings.within,
        fill=settings.onto != "annulus",
        close=settings.onto == "sphere",
    )
    if not settings.is_part:
        return cleaning(V, F)
    which = {
        name: read_vertices(given, len(V), source)
        for name, given in (("vertices", settings.only), ("without", settings.without))
        if given
    }
    part = submesh(V, F, **which)
    if not settings.clean:
        return part
    cleaned = cleaning(part)
    return cleaned._replace(changes=part.changes + cleaned.changes)


def _after_cleaning(name: str, value: Any, index: Ints) -> Any:
    """Find the rows of the file that an option names among those left; ValueError if one is not."""
    if name not in ("align", "center", "corners", "pins"):
        return value
    if isinstance(value, Mapping):
        return {_after_cleaning(name, row, index): value[row] for row in value}
    if name == "corners" and np.ndim(value) == 1:
        return [_after_cleaning(name, row, index) for row in value]
    if not isinstance(value, int | np.integer):
        return value
    rows = np.flatnonzero(index == value)
    if not len(rows):
        kind = "face" if name == "center" else "vertex"
        raise ValueError(f"{name} is {kind} {value}, which is not in the cleaned surface")
    return int(rows[0])


def _map(
    surface: tuple[Array, Array] | Cleaned,
    polygon_of_face: Array,
    settings: Settings,
    progress: Progress | None,
) -> Mapped:
    V, F = surface[:2]
    result = settings.map(surface, polygon_of_face, progress)
    if isinstance(result, RectangleMap) and result.change:
        V, F = result._surface()
        return Mapped(V, F, result, (result.change,), len(V), np.arange(len(F)), {}, False)
    if not isinstance(result, SurfaceMap):
        return Mapped(V, F, result, (), len(V), np.arange(len(F)), {})
    rows = np.flatnonzero(result.face_chart >= 0)
    left_out = len(F) - len(rows)
    note = (f"faces in no chart: {left_out:,}",) if left_out else ()
    indices = {"face_index": rows, "face_chart": result.face_chart[rows]}
    return Mapped(V, F, result, (*result.changes, *note), len(V), rows, indices)
