"""One object in the place of V and F: a mesh of another library, a tuple, or a path.

Other libraries are known by the attributes of their meshes; none of them is imported.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from functools import wraps
from inspect import signature
from os import PathLike
from pathlib import Path
from typing import Any, Concatenate, ParamSpec, Protocol, TypeAlias, TypeVar, overload

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import check_types, typed
from ..arrays import Floats, Ints
from ..errors import Damage, Defect, MeshError, counted
from .neuro import gifti_surface
from .polygons import naming_polygons, triangulated
from .reading import Array, read_polygons
from .texture import with_texture

log = logging.getLogger("cdcp_igl")

Name: TypeAlias = str | PathLike[str]
Options = ParamSpec("Options")
Made = TypeVar("Made", covariant=True)

# trimesh has vertices and faces, Open3D vertices and triangles, PyVista points and faces, meshio
# points and cells, nilearn coordinates and faces, LaPy v and t, what `clean` and `cut` return V
# and F.
VERTICES = ("vertices", "points", "coordinates", "V", "v")
FACES = ("faces", "triangles", "cells", "F", "t")
# Methods of tensors and grids that give such a mesh.
INSTEAD = ("to_legacy", "extract_surface")
POLYGONS_OF_VTK = (5, 7, 9)  # triangles, polygons, quads


class OfGiven:
    """What is said of a surface, which knows the file that was given, and of which part it is.

    Attributes
    ----------
    source : Path or None
        The file.
    given_rows : ((n,) int64, int) or None
        The row of the whole surface that each vertex comes from, -1 for a new one, and how many
        rows that has: of what `submesh`, `clean` and `cut` return. None if it is the whole.
    given_faces : (k, 3) int64 or None
        The faces of the whole surface, if its rows are known.
    """

    source: Path | None = None
    given_rows: tuple[Ints, int] | None = None
    given_faces: Ints | None = None

    @property
    def left_out(self) -> int:
        """How many vertices of the whole surface are not in the part."""
        if self.given_rows is None:
            return 0
        rows, size = self.given_rows
        return size - len(np.unique(rows[rows >= 0]))

    def _left_out(self) -> str:
        """Say the same in words; nothing if all are there."""
        if self.given_rows is None or not self.left_out:
            return ""
        return f"{self.left_out:,} of {counted(self.given_rows[1], 'vertex', 'vertices')}"


class FromFile(OfGiven):
    """A map of a surface or of a part of it."""

    uv: Floats

    def to_given(self, values: ArrayLike, fill: float | None = None) -> Array:
        """Carry values at the vertices back to the rows of the surface that this is a part of.

        Parameters
        ----------
        values : (n, ...) array_like
            A row for each vertex that was mapped, such as `uv`.
        fill : number, optional
            Where nothing was mapped, and where a vertex that was split or cut has several values:
            NaN for real numbers, -1 for integers, which are labels (a negative one says that there
            is none), False for truth values, and an empty text.

        Returns
        -------
        (k, ...) ndarray
            A row for each vertex of the surface as `submesh`, `clean` or `cut` was given it, of
            the type of `values`; without `fill`, unsigned integers become signed ones.

        Raises
        ------
        ValueError
            If `values` has another number of rows, or `fill` does not fit its type.

        Examples
        --------
        >>> import cdcp_igl
        >>> V, F, _ = cdcp_igl.datasets.spherical_cap(5)
        >>> part = cdcp_igl.submesh(V, F, vertices=V[:, 0] < 0.3)
        >>> result = cdcp_igl.disk_map(part)
        >>> uv = result.to_given(result.uv)
        >>> len(uv) == len(V), bool(np.isnan(uv[V[:, 0] >= 0.3]).all())
        (True, True)
        """
        given = np.array(values)
        if self.given_rows is None:
            return given
        rows, _ = self.given_rows
        if given.ndim == 0 or len(given) != len(rows):
            raise ValueError(f"values has shape {given.shape}; {len(rows)} vertices were mapped")
        nothing: Any = fill
        kind = given.dtype.kind
        if fill is None:
            if kind == "u":
                if given.max(initial=0) > np.iinfo(np.int64).max:
                    raise ValueError("values has integers beyond 64 bits with a sign: give fill")
                given = given.astype(np.int64)
            nothing = {"b": False, "i": -1, "u": -1, "U": ""}.get(kind, np.nan)
        elif not np.can_cast(np.min_scalar_type(fill), given.dtype, "same_kind") or (
            kind in "iu" and not np.iinfo(given.dtype).min <= fill <= np.iinfo(given.dtype).max
        ):
            raise ValueError(f"fill={fill!r} is no {given.dtype}, as values are")
        return in_given_rows(given, self.given_rows, nothing)[0]


def in_given_rows(values: Array, given_rows: tuple[Ints, int], nothing: Any) -> tuple[Array, Ints]:
    """Values in the rows of the whole surface, and its vertices that have several.

    These, and those without one, have `nothing`.
    """
    rows, size = given_rows
    own, of_own = rows[rows >= 0], values[rows >= 0]
    whole = np.full((size, *values.shape[1:]), nothing, values.dtype)
    whole[own] = of_own
    last = whole[own]  # of the copies of a vertex
    same = (last == of_own) | ((last != last) & (of_own != of_own))
    several = np.unique(own[~same.reshape(len(own), same[:1].size).all(axis=1)])
    whole[several] = nothing
    return whole, several


class OfSurface(Protocol[Options, Made]):
    """A function of V and F, or of one object in their place, which may be of any type."""

    @overload
    def __call__(
        self, V: ArrayLike, F: ArrayLike, *more: Options.args, **options: Options.kwargs
    ) -> Made: ...
    @overload
    def __call__(self, mesh: object, *more: Options.args, **options: Options.kwargs) -> Made: ...


class ToFile(Protocol[Options, Made]):
    """A function of a path and then of V and F, or of one object in their place."""

    @overload
    def __call__(
        self, path: Name, V: ArrayLike, F: ArrayLike, *more: Options.args, **options: Options.kwargs
    ) -> Made: ...
    @overload
    def __call__(
        self, path: Name, mesh: object, *more: Options.args, **options: Options.kwargs
    ) -> Made: ...


@overload
def takes_meshes(  # type: ignore[overload-overlap]  # a path might be an array, for who sees types
    function: Callable[Concatenate[ArrayLike, ArrayLike, Options], Made],
) -> OfSurface[Options, Made]: ...
@overload
def takes_meshes(
    function: Callable[Concatenate[Name, ArrayLike, ArrayLike, Options], Made],
) -> ToFile[Options, Made]: ...
def takes_meshes(function: Callable[..., Any]) -> Any:
    """Let one object stand in the place of the arguments V and F.

    Polygons are triangulated; errors name them, and a function that takes `polygon_of_face` is
    told. The other arguments are checked before a file is read, see `typed`.
    """
    names = list(signature(function).parameters)
    at, checked = names.index("V"), typed(function)

    @wraps(function)
    def run(*args: Any, **options: Any) -> Any:
        if len(args) <= at:
            return checked(*args, **options)
        given, alone = args[at], len(args) == at + 1 and "F" not in options
        if not (alone or _is_mesh(given)):
            return checked(*args, **options)
        check_types(function, (*args[: at + 1], None, *args[at + 1 :]), options)
        V, F, polygon_of_face = surface_of(given)
        if isinstance(given, str | PathLike):
            options = with_texture(options, given)
        if "polygon_of_face" in names:
            options.setdefault("polygon_of_face", polygon_of_face)
        with naming_polygons(polygon_of_face):
            made = function(*args[:at], V, F, *args[at + 1 :], **options)
        source = Path(given) if isinstance(given, str | PathLike) else None
        source = getattr(given, "source", source)
        if made is None:  # by the constructor of what maps
            _told_of(args[0], given, source)
        return _told_of(made, given, source)

    return run


def _told_of(made: Any, given: Any, source: Path | None) -> Any:
    """Tell a map, or what `clean` and `cut` return, of the file and the rows of the whole."""
    is_part = hasattr(given, "n_given")
    if isinstance(made, OfGiven):
        told: dict[str, Any] = {"source": source}
        if is_part:
            index, of_map = given.vertex_index, made.given_rows
            if of_map is not None:  # of a map with new vertices
                index = _after(of_map[0], index)
            told |= {"given_rows": (index, given.n_given), "given_faces": given.F_given}
        tell(made, told)
    elif hasattr(made, "n_given"):
        made = made._replace(source=source)
        if is_part:
            before = {"vertex_index": given.vertex_index, "face_index": given.face_index}
            before |= {"edges": given.vertex_index}
            changed = {
                name: _after(getattr(made, name), first)
                for name, first in before.items()
                if hasattr(made, name)
            }
            made = made._replace(n_given=given.n_given, F_given=given.F_given, **changed)
    return made


def tell(made: OfGiven, told: Mapping[str, Any]) -> None:
    """Tell a map, which may be frozen, what `OfGiven` is to say."""
    for name in {"source", "given_rows", "given_faces"} & set(told):
        object.__setattr__(made, name, told[name])


def _after(rows: Ints, before: Ints) -> Ints:
    """Find what rows come from; -1 stays."""
    return np.where(rows >= 0, before[rows], -1)


def _is_mesh(given: Any) -> bool:
    known = (*VERTICES, "to_mesh", "darrays")  # the last of a GIFTI image
    if isinstance(given, str | PathLike) or any(hasattr(given, name) for name in known):
        return True
    return isinstance(given, tuple) and len(given) == 2 and np.ndim(given[0]) == 2


def surface_of(mesh: Any) -> tuple[Array, Array, Ints]:
    """V, F, and the polygon (m,) that each face is a part of; MeshError if it has none of these."""
    if isinstance(mesh, str | PathLike):
        return read_polygons(mesh, log.warning)
    if isinstance(mesh, tuple) and len(mesh) == 2:
        return mesh[0], *triangulated(*mesh)
    if hasattr(mesh, "darrays"):
        try:
            mesh = gifti_surface(mesh)
        except Damage as error:
            raise MeshError(Defect.of("unreadable file", reason=f"{error}")) from None
        return mesh[0], *triangulated(*mesh)
    if not any(hasattr(mesh, name) for name in VERTICES) and hasattr(mesh, "to_mesh"):
        mesh = mesh.to_mesh()  # a scene of trimesh: its meshes in one, each where it stands
    V, faces = (
        next((getattr(mesh, name) for name in names if hasattr(mesh, name)), None)
        for names in (VERTICES, FACES)
    )
    kinds = getattr(mesh, "celltypes", POLYGONS_OF_VTK)
    if V is None or faces is None or not np.isin(kinds, POLYGONS_OF_VTK).all():
        raise MeshError(_no_surface(mesh, [name for name in INSTEAD if hasattr(mesh, name)]))
    if getattr(mesh, "n_strips", 0):
        raise MeshError(_no_surface(mesh, ["triangulate"]))
    return np.asarray(V), *triangulated(V, faces)


def _no_surface(mesh: Any, instead: list[str]) -> Defect:
    kind = type(mesh).__name__
    if instead:
        return Defect.of("no surface, but another", type=kind, method=instead[0])
    return Defect.of("no surface", type=kind)
