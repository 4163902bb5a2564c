"""A page in which a surface turns beside its image."""

from __future__ import annotations

import gzip
import json
import webbrowser
from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from importlib.resources import files
from io import BytesIO
from os import PathLike
from pathlib import Path
from string import Template
from tempfile import mkdtemp
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import typed
from ..arrays import Floats, Ints, as_complex, places
from ..extras import from_extra
from ..fields import Field, Labelled
from ..io.images import MIME, Texture, as_image
from ..io.output import write_text
from ..surface.location import z_order
from ..surface.topology import group_by_edge, heads, tails
from ..surface.triangles import vertex_areas
from ..verdict.any_map import certify
from ..verdict.distortion import angle_distortion, area_distortion, conformal_factor
from .layout import Layout
from .pictures import side_by_side
from .scene import angle_to_view, vertex_normals
from .viewpoint import choose_viewpoint

with from_extra("plot"):
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

STEPS = 2**16 - 1  # of a coordinate, and of what is given as a field
MEASURE_STEPS = 255  # of what is measured here: no eye tells more colours apart
BEYOND = 0.005  # share of the vertices, at either end, that may lie beyond the scale of colours
RAMPS = {"viridis": "viridis", "magma": "magma_r", "diverging": "RdBu_r", "cyclic": "twilight"}
SURFACE = "Surface"  # what the shape that was mapped is called
FLAT = 1e-6  # thickness of a flat shape, by its size: one looks straight at it


@runtime_checkable
class Viewed(Protocol):
    """A result such as a `DiskMap`."""

    def _layout(self) -> Layout: ...


@typed
def view(
    results: Mapping[str, Viewed],
    path: str | PathLike[str] | None = None,
    *,
    fields: Mapping[str, Labelled] | None = None,
    beside: Mapping[str, ArrayLike] | None = None,
    title: str = "",
) -> Path:
    """Write a page that shows several results, one at a time, or open it in the browser.

    As `DiskMap.view` does, with a switch between the results, such as the two hemispheres of a
    brain. Colours are on one scale.

    Parameters
    ----------
    results : mapping of str to result
        By the names that the switch has.
    path
        As in `DiskMap.view`.
    fields, beside : mapping, optional
        As in `DiskMap.view`, the rows of one result after those of the other: (n, ...) array_like,
        where n is the sum of the vertices. A map or a shape that is NaN at all vertices of a
        result is left out there.
    title : str
        The heading.

    Returns
    -------
    Path
        Where the page is.

    Raises
    ------
    ValueError, OSError, ImportError
        As `DiskMap.view`; also if there is no result.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.spherical_cap(10)
    >>> left, right = (cdcp_igl.disk_map(V * [x, 1, 1], F[:, ::x]) for x in (-1, 1))
    >>> with TemporaryDirectory() as folder:
    ...     page = cdcp_igl.plot.view(
    ...         {"left": left, "right": right},
    ...         Path(folder, "caps.html"),
    ...         fields={"height": np.concatenate([V[:, 2], V[:, 2]])},
    ...     )
    ...     page.stat().st_size < 200_000
    True
    """
    if not results:
        raise ValueError("results must name a result at least")
    layouts = {name: result._layout() for name, result in results.items()}
    return show(page(layouts, fields or {}, None, beside or {}, title), path)


def show(page: str, path: str | PathLike[str] | None) -> Path:
    """Write a page to a file, or to a temporary folder and open it in the browser."""
    target = Path(mkdtemp(prefix="cdcp_igl-"), "map.html") if path is None else Path(path)
    write_text(target, page)
    if path is None:
        webbrowser.open(target.as_uri())
    return target


def page(
    layouts: Mapping[str, Layout],
    fields: Mapping[str, Any],
    texture: Texture | None,
    beside: Mapping[str, ArrayLike],
    title: str,
    steps: Mapping[str, Layout] | None = None,
) -> str:
    """Return the page of some results, one at a time, by the names of their images.

    Fields, texture, beside and title as in `Result.view`, of several results as in `view`. The
    `steps` are maps that the image of one result goes through, this one among them.
    """
    given = {
        name: _drawn_rows(f"map {name!r}", x, layouts, [(2,), (3,)]) for name, x in beside.items()
    }
    scenes = [
        _Scene.of(name, layout, steps, {other: parts[k] for other, parts in given.items()})
        for k, (name, layout) in enumerate(layouts.items())
    ]
    # The page opens on the first.
    colorings: list[dict[str, Any]] = []
    if texture is not None:
        colorings.append({"name": "texture", "kind": "image"})
    for name, values in fields.items():
        colorings.append(_put_field(name, values, layouts, scenes))
    colorings.append({"name": "checkerboard", "kind": "checkerboard"})
    colorings += _put_charts(scenes)
    colorings.append({"name": "normals", "kind": "normals"})
    colorings += _put_measures(scenes)

    about = {
        "scenes": [scene.about() for scene in scenes],
        "colorings": colorings,
        "ramps": {name: _ramp(colors) for name, colors in RAMPS.items()},
        "image": None if texture is None else _image(texture),
    }
    source = files(__package__) / "browser"
    return Template((source / "viewer.html").read_text("utf-8")).substitute(
        title=escape(title or "Conformal map"),
        facts=escape(scenes[0].facts),
        style=(source / "viewer.css").read_text("utf-8"),
        script=(source / "viewer.js").read_text("utf-8"),
        poster=poster(scenes[0].layout),
        # A closing tag in a name would end the script element.
        about=json.dumps(about).replace("<", "\\u003c"),
        data="\n".join(_pack(scene.arrays) for scene in scenes),
    )


@dataclass(frozen=True, eq=False)
class _Map:
    """A map on a page: of which panel, which step there, where it is, and what is said of it."""

    panel: str
    step: str
    uv: Floats  # (n, 2) in the square from -1 to 1
    image: Floats  # (n, 2) or, on the sphere, (n, 3)
    middle: tuple[float, float]  # the map is middle + scale * uv
    scale: float
    facts: str

    @classmethod
    def of(cls, panel: str, step: str, layout: Layout) -> _Map:
        """Take the map of a result."""
        V, F, image = layout.V, layout.F, layout.image
        facts = _in_words(layout.distortion.mean, area_distortion(V, F, image), layout.verdict)
        return cls(panel, step, layout.uv, image, layout.middle, layout.scale, facts)

    @classmethod
    def beside(cls, name: str, V: Floats, F: Ints, uv: Floats) -> _Map:
        """Take a map that was given, moved and scaled into the square."""
        low, high = np.nanmin(uv, axis=0), np.nanmax(uv, axis=0)
        scale = float((high - low).max()) / 2 or 1.0
        x, y = ((low + high) / 2).tolist()
        verdict = "valid" if certify(V, F, uv).valid else "NOT VALID"
        facts = _in_words(angle_distortion(V, F, uv).mean(), area_distortion(V, F, uv), verdict)
        return cls(name, "", (uv - [x, y]) / scale, uv, (x, y), scale, facts)


def _in_words(mean: float, areas: Floats, verdict: str) -> str:
    """Say of a map what `compare` has of it: mean of angles, SD of areas, and the verdict."""
    sd = areas.std() if np.isfinite(areas).all() else np.inf
    return f"mean {mean:.3g}° · area {sd:.3g} · {verdict}"


@dataclass(frozen=True, eq=False)
class _Scene:
    """A result on a page: shapes of its surface, its maps, and the arrays of both.

    Neighbours follow one another: vertices come along a Z-shaped curve in the plane, faces by their
    vertices. Those of the rows that they had stay with them.
    """

    name: str
    layout: Layout
    shapes: Mapping[str, Floats]  # (n, 3) each
    maps: Sequence[_Map]
    order: Ints  # (n,) of the vertices
    arrays: dict[str, Ints] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        name: str,
        layout: Layout,
        steps: Mapping[str, Layout] | None,
        beside: Mapping[str, Floats],
    ) -> _Scene:
        """Take a result with the steps of its image, and the maps and shapes beside it."""
        V, F = layout.V, layout.F
        maps = [_Map.of(name, step, made) for step, made in (steps or {"": layout}).items()]
        shapes = {SURFACE: V}
        for other, values in beside.items():
            if other in (name, SURFACE):
                raise ValueError(f"{other!r} is on the page already: give the map another name")
            if np.isnan(values).all():
                continue
            if values.shape[1] == 2:
                maps.append(_Map.beside(other, V, F, values))
            elif np.isfinite(values).all():
                shapes[other] = values
            else:
                raise ValueError(f"map {other!r} is not finite: leave such vertices out (submesh)")
        made = cls(name, layout, shapes, maps, z_order(as_complex(layout.uv)))
        made._locate()
        return made

    @property
    def facts(self) -> str:
        """What the header says: of one map all, of several what they share."""
        return " · ".join(self.layout.facts[: None if len(self.maps) == 1 else 1])

    def put(self, name: str, values: Floats, scale: Mapping[str, Any]) -> None:
        """Add values at the vertices."""
        low, high, steps = scale["from"], scale["to"], scale["steps"]
        self.arrays[name] = _quantized(values, low, high, steps, missing=-1)[self.order]

    def put_edges(self, name: str, edges: Ints) -> None:
        """Add edges (k, 2)."""
        self.arrays[name] = places(self.order, len(self.order))[edges].ravel()

    def _locate(self) -> None:
        """Add the faces, and all places."""
        layout, rank = self.layout, places(self.order, len(self.order))
        rows = np.lexsort(np.sort(rank[layout.F], axis=1).T[::-1])
        corners = rank[layout.F[rows]]
        first = corners.argmin(axis=1)[:, None]
        corners = np.take_along_axis(corners, (first + np.arange(3)) % 3, axis=1)
        self.arrays["vertexOrder"] = layout.vertices[self.order]
        self.arrays["faceOrder"] = layout.faces[rows]
        self.arrays["faces"] = corners.ravel()
        rim, cut = _rim_and_cut(layout.V, layout.F)
        self.put_edges("rim", rim)
        # The seam of a sphere is one of its texture.
        self.put_edges("cut", cut if layout.ball is None else cut[:0])
        for k, V in enumerate(self.shapes.values()):
            low = V.min(axis=0)
            size = float(np.ptp(V, axis=0).max()) or 1.0
            for c, x in enumerate(V.T):
                self.arrays[f"{'xyz'[c]} {k}"] = _quantized(x, low[c], low[c] + size)[self.order]
        images = {f"{k}": drawn.uv for k, drawn in enumerate(self.maps)}
        images |= {} if layout.ball is None else {"ball": layout.ball}
        for name, image in images.items():
            for c, x in enumerate(image.T):
                self.arrays[f"{'uvw'[c]} {name}"] = _quantized(x, -1, 1)[self.order]

    def about(self) -> dict[str, Any]:
        """Describe the arrays."""
        layout = self.layout
        home = choose_viewpoint(layout.V, layout.F)
        seen = layout.V @ home.T
        normals = vertex_normals(seen, layout.F)
        panels = list(dict.fromkeys(drawn.panel for drawn in self.maps))
        turned: dict[str, float] = {}  # steps of a map lie as it does
        for drawn in self.maps:
            if drawn.panel not in turned:
                spin = angle_to_view(seen, normals, drawn.uv) if layout.turns else 0.0
                turned[drawn.panel] = spin
        return {
            "name": self.name,
            "facts": self.facts,
            "ball": layout.ball is not None,
            "origin": layout.origin,
            "shapes": [self._shape(name, home) for name in self.shapes],
            "panels": panels,
            "maps": [
                {
                    "panel": panels.index(drawn.panel),
                    "step": drawn.step,
                    "middle": drawn.middle,
                    "scale": drawn.scale,
                    "spin": turned[drawn.panel],
                    "facts": drawn.facts if len(self.maps) > 1 else "",
                }
                for drawn in self.maps
            ],
            "arrays": [(name, len(array)) for name, array in self.arrays.items()],
        }

    def _shape(self, name: str, home: Floats) -> dict[str, Any]:
        """Describe a shape: one sees it as the surface, and a flat one from above."""
        V = self.shapes[name]
        extent = np.ptp(V, axis=0) / (np.ptp(V, axis=0).max() or 1.0)
        if name != SURFACE and extent.min() < FLAT:
            home = choose_viewpoint(V, self.layout.F)
        return {"name": name, "extent": extent.tolist(), "home": home.ravel().tolist()}


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


def _between_labels(F: Ints, code: Ints) -> Ints:
    """(k, 2) edges between faces of different labels; a face has the middle one of its corners'."""
    tail, of_face = tails(F, len(code)), np.sort(code[F], axis=1)[:, 1]
    one, other = group_by_edge(tail, len(code)).twins
    differ = of_face[one % len(F)] != of_face[other % len(F)]
    return np.column_stack([tail[one], heads(tail)[one]])[differ].astype(np.int64)


def _put_field(
    name: str, given: Any, layouts: Mapping[str, Layout], scenes: Sequence[_Scene]
) -> dict[str, Any]:
    """Add a field; ValueError if it has no value for some vertex that is drawn."""
    names: Mapping[int, str] = {}
    if isinstance(given, tuple) and len(given) == 2 and isinstance(given[1], Mapping):
        given, names = given
    parts = _drawn_rows(f"field {name!r}", given, layouts, [()])
    if are_labels := Field.of(given).nearest:
        parts = [np.where(x < 0, np.nan, x) for x in parts]  # which say that there is none
    values = np.concatenate(parts)
    finite = values[np.isfinite(values)]
    if len(finite) == 0:
        raise ValueError(f"field {name!r} has no finite value")
    array = f"field {name}"
    if are_labels:
        found = np.unique(finite)
        parts = [np.where(np.isnan(x), np.nan, np.searchsorted(found, x)) for x in parts]
        about = _labels(name, array, [names.get(int(x), f"{x:g}") for x in found.tolist()])
        for scene, part in zip(scenes, parts, strict=True):
            code = np.nan_to_num(part, nan=-1).astype(np.int64)
            scene.put_edges(f"edges of {array}", _between_labels(scene.layout.F, code))
    else:
        low, high = np.quantile(finite, [BEYOND, 1 - BEYOND]).tolist()
        about = _values(name, array, "viridis", low, high)
        about |= {"from": float(finite.min()), "to": float(finite.max()), "steps": STEPS}
    for scene, part in zip(scenes, parts, strict=True):
        scene.put(array, part, about)
    return about


def _put_charts(scenes: Sequence[_Scene]) -> list[dict[str, Any]]:
    """Add the charts where there are several."""
    charts = [scene.layout.charts for scene in scenes]
    count = max((int(chart.max()) for chart in charts if chart is not None), default=0) + 1
    if count == 1:
        return []
    about = _labels("charts", "charts", [f"{chart:,}" for chart in range(count)])
    for scene, chart in zip(scenes, charts, strict=True):
        code = np.zeros(len(scene.order)) if chart is None else chart.astype(np.float64)
        scene.put("charts", np.where(code < 0, np.nan, code), about)
    return [about]


def _put_measures(scenes: Sequence[_Scene]) -> list[dict[str, Any]]:
    """Add angular distortion at the vertices and the conformal factor of each map, on one scale."""
    drawn = [
        (scene, k, scene.layout, made) for scene in scenes for k, made in enumerate(scene.maps)
    ]
    errors, factors, reach = [], [], 1e-6
    for _, _, layout, made in drawn:
        V, F = layout.V, layout.F
        corners = np.maximum(np.bincount(F.ravel(), minlength=len(V)), 1)  # 0 of unused vertices
        error = angle_distortion(V, F, made.image)
        errors.append(np.bincount(F.ravel(), error.ravel(), len(V)) / corners)
        factor = conformal_factor(V, F, made.image)
        finite = np.isfinite(factor)
        factor -= np.average(factor[finite], weights=vertex_areas(V, F)[finite])
        reach = max(reach, float(np.quantile(abs(factor[finite]), 1 - 4 * BEYOND)))
        factors.append(factor)
    high = max(1e-6, *(float(np.quantile(error, 1 - BEYOND)) for error in errors))
    angle = _values("angle error", "angle", "magma", 0.0, high)
    angle |= {"legend": "mean angular distortion at the corners of a vertex, in °", "unit": "°"}
    scale = _values("conformal factor", "factor", "diverging", -reach, reach)
    scale |= {"legend": "log of the scale of the map, 0 on the average over the area"}
    for about, measured in ((angle, errors), (scale, factors)):
        about |= {"each": True}  # map has an array of its own
        for (scene, k, _, _), values in zip(drawn, measured, strict=True):
            scene.put(f"{about['array']} {k}", np.nan_to_num(values, nan=0.0), about)
    return [angle, scale]


def _drawn_rows(
    name: str, given: ArrayLike, layouts: Mapping[str, Layout], shapes: Sequence[tuple[int, ...]]
) -> list[Floats]:
    """Rows of each result that are drawn; ValueError if they have none of these shapes."""
    values = Field.of(given).values
    sizes = [int(layout.vertices.max()) + 1 for layout in layouts.values()]
    n, rows = sum(sizes), values.shape[0] if values.ndim else 0
    # Of vertices of one result that no face uses, the last ones may be there or not.
    if not (rows == n or (rows > n and len(sizes) == 1)) or values.shape[1:] not in shapes:
        wanted = " or ".join(str((n, *shape)) for shape in shapes)
        raise ValueError(f"{name} has shape {values.shape}; it must be {wanted}")
    first = np.cumsum([0, *sizes[:-1]])
    return [values[k + x.vertices] for k, x in zip(first, layouts.values(), strict=True)]


def _values(name: str, array: str, ramp: str, low: float, high: float) -> dict[str, Any]:
    """Describe a colouring by values from `low` to `high`."""
    scale = {"low": low, "high": high, "from": low, "to": high, "steps": MEASURE_STEPS}
    about = {"name": name, "kind": "values", "array": array, "ramp": ramp}
    return about | {"legend": "", "unit": ""} | scale


def _labels(name: str, array: str, labels: Sequence[str]) -> dict[str, Any]:
    """Describe a colouring by labels, whose numbers count them."""
    scale = {"from": 0, "to": len(labels) - 1, "steps": len(labels) - 1}
    return {"name": name, "kind": "labels", "array": array, "labels": labels} | scale


def _ramp(colors: str) -> list[str]:
    return [to_hex(color) for color in colormaps[colors](np.linspace(0, 1, 9))]


def _image(texture: Texture) -> str:
    """Return the image as a data URI."""
    if isinstance(texture, str | PathLike):
        path = Path(texture)
        if path.suffix.lower() not in MIME:
            raise ValueError(f"{path.name!r} is no image a browser shows: {', '.join(MIME)}")
        return _uri(path.read_bytes(), MIME[path.suffix.lower()])
    return _uri(as_image(texture).data, "image/png")


def poster(layout: Layout) -> str:
    """Return a picture of a map, for where a browser cannot draw, as a data URI."""
    V, F, image = layout.drawn
    maps = [(layout.plane, layout.distortion.mean, image)]
    figure = side_by_side([(V, F, maps)], turns=layout.turns)
    file = BytesIO()
    figure.savefig(file, format="jpeg", dpi=120, pil_kwargs={"quality": 75})
    return _uri(file.getvalue(), "image/jpeg")


def _uri(image: bytes, mime: str) -> str:
    return f"data:{mime};base64,{b64encode(image).decode()}"


def _quantized(x: Floats, low: float, high: float, steps: int = STEPS, missing: int = 0) -> Ints:
    """(n,) whole steps of x from `low`, which is 0, to `high`; the ends for all beyond."""
    share = (x - low) / (high - low if high > low else 1)
    found = np.rint(steps * np.clip(np.nan_to_num(share, nan=0.0), 0, 1)).astype(np.int64)
    return np.where(np.isnan(x), missing, found)


def _pack(arrays: Mapping[str, Ints]) -> str:
    """Base64 of the arrays, one after the other: zigzag deltas, compressed by planes of bytes.

    Differences of neighbours are small, so that the upper planes are nearly empty.
    """
    differences = np.concatenate([np.diff(array, prepend=0) for array in arrays.values()])
    numbers = ((differences << 1) ^ (differences >> 63)).astype("<u4")
    planes = numbers.view(np.uint8).reshape(-1, 4).T.tobytes()
    # No time stamp, so that equal input gives equal files.
    return b64encode(gzip.compress(planes, 6, mtime=0)).decode()
