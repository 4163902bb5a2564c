"""What is baked into an image: values at vertices, a function of space, or another image."""

from __future__ import annotations

from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, Ints, size_exponent
from ..fields import Field, Method
from ..io.painted import Painted, colours_at, images_of, pixels
from ..io.reading import READABLE
from ..io.texture import read_texture
from ..plot.layout import Layout

Function = Callable[[Floats], ArrayLike]  # of points (k, 3) of the surface
Paint = Callable[[Ints, Floats], Floats]  # of faces (k,) of a layout and weights (k, 3)


class WithSurface(Protocol):
    """What a result knows of its surface."""

    source: Path | None
    given_rows: tuple[Ints, int] | None
    given_faces: Ints | None

    @property
    def _faces(self) -> Ints: ...

    def _surface(self) -> tuple[Floats, Ints]: ...

    def _field(self, values: ArrayLike, method: Method | None = None) -> Field: ...


def painter(
    result: WithSurface,
    layout: Layout,
    values: ArrayLike | str | PathLike[str] | Function,
    method: Method | None,
    uv: ArrayLike | None,
) -> Paint:
    """Return what paints the points of faces; the arguments are those of `Result.bake`."""
    if callable(values):
        if uv is not None:
            raise ValueError("uv= is for an image, not for a function")
        exponent = size_exponent(result._surface()[0])
        return lambda face, weights: _at(values, layout, face, weights, exponent)
    if uv is None and not isinstance(values, str | PathLike):
        field = result._field(values, method)
        return lambda face, weights: field.at(layout.vertices[layout.F[face]], weights)
    old = _painted(result, values, uv)
    faces = result._faces
    if old.uv.shape != (len(faces), 3, 2):
        raise ValueError(f"uv has shape {old.uv.shape}; the surface has {len(faces)} faces")
    of_face, corners = old.of_face[layout.faces], old.uv[layout.faces]
    turned = layout.vertices[layout.F[:, 0]] != faces[layout.faces, 0]
    corners[turned] = corners[turned, ::-1]

    def paint(face: Ints, weights: Floats) -> Floats:
        at = np.einsum("kc,kcx->kx", weights, corners[face])
        there = np.where(np.isfinite(at).all(axis=1), of_face[face], -1)
        channels = max(image.shape[2] for image in old.images)
        colours = np.ones((len(face), channels))
        for k, image in enumerate(old.images):
            rows = np.flatnonzero(there == k)
            colours[rows, : image.shape[2]] = colours_at(
                image, at[rows], nearest=method == "nearest"
            )
        return colours

    return paint


def _at(function: Function, layout: Layout, face: Ints, weights: Floats, exponent: int) -> Floats:
    points = np.einsum("kc,kcx->kx", weights, layout.V[layout.F[face]])
    values = np.asarray(function(np.ldexp(points, exponent)), dtype=np.float64)
    if values.ndim == 0 or len(values) != len(points):
        raise ValueError(
            f"the function returned shape {values.shape} for {len(points)} points: it must return "
            "a row for each"
        )
    return values


def _painted(result: WithSurface, values: Any, uv: ArrayLike | None) -> Painted:
    """Take an image with its texture coordinates, or a file that has both."""
    is_file, faces = isinstance(values, str | PathLike), result._faces
    if is_file and uv is None:
        rows, whole = result.given_rows, result.given_faces
        if rows and (whole is None or not np.array_equal(rows[0][faces], whole)):
            raise ValueError("a part of a surface has other faces than its file: give uv=, too")
        if Path(values).suffix.lower() in READABLE:
            return images_of(Path(values))
        if result.source is None:
            raise ValueError("where the image lay, no file says: give uv=, too")
        uv = read_texture(result.source)[2]
    at = np.array(uv, dtype=np.float64)
    if at.ndim == 2 and len(at) > faces.max(initial=-1):
        at = at[faces]
    image = pixels(Path(values)) if is_file else np.asarray(values, dtype=np.float64)
    if image.ndim != 3 or image.size == 0:
        raise ValueError(f"the image has shape {image.shape}; it must be (height, width, channels)")
    return Painted([image], np.zeros(len(at), np.int64), at)
