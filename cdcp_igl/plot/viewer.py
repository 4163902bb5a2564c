"""A page in which a surface turns beside its image."""

from __future__ import annotations

import gzip
import json
import webbrowser
from base64 import b64encode
from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from io import BytesIO
from os import PathLike
from pathlib import Path
from string import Template
from tempfile import mkdtemp
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, Ints, as_complex, places
from ..extras import from_extra
from ..fields import Field
from ..io.images import Texture, as_image
from ..io.output import write_text
from ..surface.location import z_order
from ..surface.topology import group_by_edge, heads, tails
from ..surface.triangles import vertex_areas
from ..verdict.distortion import angle_distortion, conformal_factor
from .layout import Layout
from .pictures import side_by_side
from .scene import angle_to_view, vertex_normals
from .viewpoint import choose_viewpoint

with from_extra("plot"):
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

IMAGES = {".png": "png", ".jpg": "jpeg", ".jpeg": "jpeg", ".webp": "webp"}
STEPS = 2**16 - 1  # of a coordinate
VALUE_STEPS = 255  # of a field: no eye tells more colours apart
BEYOND = 0.005  # share of the vertices, at either end, that may lie beyond the scale of colours


def show(page: str, path: str | PathLike[str] | None) -> Path:
    """Write a page to a file, or to a temporary folder and open it in the browser."""
    target = Path(mkdtemp(prefix="cdcp_igl-"), "map.html") if path is None else Path(path)
    write_text(target, page)
    if path is None:
        webbrowser.open(target.as_uri())
    return target


def page(
    layout: Layout,
    fields: Mapping[str, ArrayLike],
    texture: Texture | None,
    beside: Mapping[str, ArrayLike],
    title: str,
) -> str:
    """Return the page of a map; fields, texture, beside and title as in `Result.view`."""
    V, F, uv = layout.V, layout.F, layout.uv
    # In words, of which map: nothing for that of the result.
    maps = {"": uv}
    for name, given in beside.items():
        maps[f" of {name}"] = _fitted(_at_vertices(f"map {name!r}", given, layout.vertices, (2,)))
    about, arrays = _geometry(V, F, list(maps.values()), turned=layout.turns)
    arrays |= {"vertexOrder": layout.vertices, "faceOrder": layout.faces}
    if layout.ball is not None:
        arrays |= {f"ball {k}": _quantized(x, -1, 1) for k, x in enumerate(layout.ball.T)}
        arrays["cut"] = arrays["cut"][:0]  # between the charts for textures

    def coloring(description: dict[str, Any], values: Floats) -> dict[str, Any]:
        name = f"value {len(arrays)}"
        arrays[name] = _quantized(values, description["low"], description["high"], VALUE_STEPS)
        return description | {"array": name}

    # The page opens on the first.
    colorings: list[dict[str, Any]] = []
    if texture is not None:
        about["image"] = _image(texture)
        colorings.append({"name": "texture", "kind": "image"})
    colorings += [coloring(*field) for field in _given(fields, layout.vertices)]
    colorings += [
        {"name": f"checkerboard{of}", "kind": "checkerboard", "map": k} for k, of in enumerate(maps)
    ]
    colorings.append({"name": "normals", "kind": "normals"})
    colorings += [coloring(*measure) for measure in _measured(V, F, maps | {"": layout.image})]

    arrays = _reordered(arrays, uv, F)
    about |= {
        "arrays": [(name, len(array)) for name, array in arrays.items()],
        "colorings": colorings,
        "planes": [layout.plane, *beside],
        "origin": layout.origin,
        "middle": layout.middle,
        "scale": layout.scale,
    }
    source = files(__package__) / "browser"
    return Template((source / "viewer.html").read_text("utf-8")).substitute(
        title=escape(title or "Conformal map"),
        facts=escape(" · ".join(layout.facts)),
        style=(source / "viewer.css").read_text("utf-8"),
        script=(source / "viewer.js").read_text("utf-8"),
        poster=poster(layout),
        # A closing tag in a name would end the script element.
        about=json.dumps(about).replace("<", "\\u003c"),
        data=_pack(arrays),
    )


def _geometry(
    V: Floats, F: Ints, maps: Sequence[Floats], *, turned: bool
) -> tuple[dict[str, Any], dict[str, Ints]]:
    """Describe the surface, its images and its boundary."""
    low, high = V.min(axis=0), V.max(axis=0)
    size = float((high - low).max())
    arrays = {
        name: _quantized(x, x.min(), x.min() + size) for name, x in zip("xyz", V.T, strict=True)
    }
    for k, uv in enumerate(maps):
        arrays |= {f"{c}{k}": _quantized(x, -1, 1) for c, x in zip("uv", uv.T, strict=True)}
    arrays["faces"] = F.ravel()
    rim, cut = _rim_and_cut(V, F)
    arrays |= {"rim": rim.ravel(), "cut": cut.ravel()}
    home = choose_viewpoint(V, F)
    seen = V @ home.T
    normals = vertex_normals(seen, F)
    about = {
        "extent": ((high - low) / size).tolist(),
        "home": home.ravel().tolist(),
        "spins": [angle_to_view(seen, normals, uv) if turned else 0.0 for uv in maps],
    }
    return about, arrays


def _rim_and_cut(V: Floats, F: Ints) -> tuple[Ints, Ints]:
    """Edges with one face; where two of them lie in one place, the surface was cut there."""
    tail = tails(F, len(V))
    by_edge = group_by_edge(tail, len(V))
    single = by_edge.border
    edges = np.column_stack([tail[single], heads(tail)[single]]).astype(np.int64)
    ends, place = np.unique(edges), V[np.unique(edges)]
    where = np.unique(place, axis=0, return_inverse=True)[1].ravel()
    name = np.sort(where[np.searchsorted(ends, edges)], axis=1)
    _, which, count = np.unique(name, axis=0, return_inverse=True, return_counts=True)
    twice = count[which.ravel()] > 1
    return edges[~twice], edges[twice]


def _reordered(arrays: Mapping[str, Ints], uv: Floats, F: Ints) -> dict[str, Ints]:
    """Put vertices and faces in an order in which neighbours follow one another.

    Vertices come along a Z-shaped curve in the plane, faces by their vertices. Those of the
    rows that they had stay with them.
    """
    vertices = z_order(as_complex(uv))
    rank = places(vertices, len(uv))
    faces = np.lexsort(np.sort(rank[F], axis=1).T[::-1])
    corners = rank[F[faces]]
    first = corners.argmin(axis=1)[:, None]
    new = {
        name: rank[array] if name in ("rim", "cut") else array[vertices]
        for name, array in arrays.items()
        if name not in ("faces", "faceOrder")
    }
    new["faces"] = np.take_along_axis(corners, (first + np.arange(3)) % 3, axis=1).ravel()
    return new | {"faceOrder": arrays["faceOrder"][faces]}


def _measured(
    V: Floats, F: Ints, maps: Mapping[str, Floats]
) -> list[tuple[dict[str, Any], Floats]]:
    """Angular distortion of each map at the vertices, on one scale, and conformal factors."""
    corners = np.maximum(np.bincount(F.ravel(), minlength=len(V)), 1)  # 0 of unused vertices
    errors = [
        np.bincount(F.ravel(), angle_distortion(V, F, uv).ravel(), len(V)) / corners
        for uv in maps.values()
    ]
    high = max(1e-6, *(float(np.quantile(error, 1 - BEYOND)) for error in errors))
    found = []
    for of, error in zip(maps, errors, strict=True):
        angle = _coloring(f"angle error{of}", "magma_r", 0.0, high, ends=("0°", f"≥ {high:.3g}°"))
        angle |= {"legend": "mean angular distortion at the corners of a vertex", "unit": "°"}
        found.append((angle, error))

    mass = vertex_areas(V, F)
    for of, uv in maps.items():
        factor = conformal_factor(V, F, uv)
        finite = np.isfinite(factor)
        factor = factor - np.average(factor[finite], weights=mass[finite])
        reach = max(float(np.quantile(abs(factor[finite]), 1 - 4 * BEYOND)), 1e-6)
        ends = f"{-reach:.3g}", f"+{reach:.3g}"
        scale = _coloring(f"conformal factor{of}", "RdBu_r", -reach, reach, ends)
        scale |= {"legend": "log of the scale of the map, 0 on the average over the area"}
        found.append((scale, factor))
    return found


def _given(fields: Mapping[str, ArrayLike], vertices: Ints) -> list[tuple[dict[str, Any], Floats]]:
    """Fields at the vertices that are drawn; ValueError if one has no value for some."""
    found = []
    for name, given in fields.items():
        values = _at_vertices(f"field {name!r}", given, vertices, ())
        finite = values[np.isfinite(values)]
        if len(finite) == 0:
            raise ValueError(f"field {name!r} has no finite value")
        labels = Field.of(given).nearest
        beyond = 0 if labels else BEYOND
        low, high = map(float, np.quantile(finite, [beyond, 1 - beyond]))
        ends = f"{low:.3g}", f"{high:.3g}"
        about = _coloring(name, "viridis", low, high, ends) | {"labels": labels}
        found.append((about, values))
    return found


def _at_vertices(name: str, given: ArrayLike, vertices: Ints, shape: tuple[int, ...]) -> Floats:
    """Return what was given at the vertices that are drawn; ValueError if it has another shape."""
    values, n = Field.of(given).values, int(vertices.max()) + 1
    # Of vertices that no face uses, the last ones may be there or not.
    if values.ndim != 1 + len(shape) or values.shape[1:] != shape or len(values) < n:
        raise ValueError(f"{name} has shape {values.shape}; it must be {(n, *shape)}")
    return values[vertices]


def _fitted(uv: Floats) -> Floats:
    """Return a map moved and scaled into the square from -1 to 1."""
    low, high = uv.min(axis=0), uv.max(axis=0)
    return (2 * uv - low - high) / (high - low).max()


def _coloring(
    name: str, colors: str, low: float, high: float, ends: tuple[str, str]
) -> dict[str, Any]:
    """Describe a colouring by values from `low` to `high`, whose texts are `ends`."""
    ramp = [to_hex(color) for color in colormaps[colors](np.linspace(0, 1, 9))]
    scale = {"low": low, "high": high, "ends": ends, "ramp": ramp}
    return {"name": name, "kind": "values", "legend": name, "unit": "", **scale}


def _image(texture: Texture) -> str:
    """Return the image as a data URI."""
    if isinstance(texture, str | PathLike):
        path = Path(texture)
        if path.suffix.lower() not in IMAGES:
            raise ValueError(f"{path.name!r} is no image a browser shows: {', '.join(IMAGES)}")
        return _uri(path.read_bytes(), IMAGES[path.suffix.lower()])
    return _uri(as_image(texture).data, "png")


def poster(layout: Layout) -> str:
    """Return a picture of a map, for where a browser cannot draw, as a data URI."""
    V, F, image = layout.drawn
    maps = [(layout.plane, layout.distortion.mean, image)]
    figure = side_by_side([(V, F, maps)], turns=layout.turns)
    file = BytesIO()
    figure.savefig(file, format="jpeg", dpi=120, pil_kwargs={"quality": 75})
    return _uri(file.getvalue(), "jpeg")


def _uri(image: bytes, kind: str) -> str:
    return f"data:image/{kind};base64,{b64encode(image).decode()}"


def _quantized(x: Floats, low: float, high: float, steps: int = STEPS) -> Ints:
    """(n,) whole steps of x from `low`, which is 0, to `high`; the ends for all beyond, and NaN."""
    share = (x - low) / (high - low if high > low else 1)
    return np.rint(steps * np.clip(np.nan_to_num(share, nan=0.0), 0, 1)).astype(np.int64)


def _pack(arrays: Mapping[str, Ints]) -> str:
    """Base64 of the arrays, one after the other: zigzag deltas, compressed by planes of bytes.

    Differences of neighbours are small, so that the upper planes are nearly empty.
    """
    differences = np.concatenate([np.diff(array, prepend=0) for array in arrays.values()])
    numbers = ((differences << 1) ^ (differences >> 63)).astype("<u4")
    planes = numbers.view(np.uint8).reshape(-1, 4).T.tobytes()
    # No time stamp, so that equal input gives equal files.
    return b64encode(gzip.compress(planes, 6, mtime=0)).decode()
