"""What several methods make of a surface, beside each other."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from math import isfinite, nan
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import typed
from ..arrays import Floats, Ints
from ..atlas.surface import surface_map
from ..errors import MeshError
from ..io.given import takes_meshes
from ..maps.disk import disk_map
from ..maps.sphere import sphere_map
from ..phases import Progress
from ..printing import table_as_html, table_as_text
from ..surface.mesh import DiskMesh, SphereMesh
from ..verdict.certificate import certify
from .case import Case, measure, run_case
from .methods import METHODS, Method

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Given: TypeAlias = str | Method | Callable[..., Any]
Surface: TypeAlias = tuple[Floats, Ints]

HEADINGS = ("method", "onto", "mean °", "SD °", "max °", "area", "texels", "valid", "s", "MiB")
FORMATS = {
    **{"mean": ".3f", "sd": ".3f", "max": ".1f", "area_sd": ".3f", "texels": ".3g"},
    **{"verdict": "", "seconds": ".2f", "memory": ",.0f"},
}


@dataclass(frozen=True, eq=False, repr=False)
class Comparison:
    """What methods have made of a surface. Printing it gives a table, a row a method.

    The columns are what the map is onto; mean, standard deviation (SD) and maximum of the angular
    distortion in degrees; the SD of the logarithm of the ratio of areas, and the density of texels,
    see `AreaDistortion`; whether the map is valid, see `certify`; seconds from arrays to map, and
    the peak of memory.

    Attributes
    ----------
    cases : dict of str to reference.Case
        All numbers, and why there is no map, by the name of the method.
    maps : dict of str to (n, 2) or (n, 3) float64
        The maps that there are, of the vertices of the `disk`, or onto the sphere.
    disk : (V, F)
        What was mapped to the plane: the surface, cut open if it is closed.
    closed : (V, F) or None
        The surface if it is closed, which is mapped onto the sphere.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.spherical_cap(10, angle=60)
    >>> compared = cdcp_igl.compare(V, F, [cdcp_igl.free_map, cdcp_igl.cdcp])
    >>> compared.cases["cdcp"].verdict, compared.maps["cdcp"].shape
    ('yes', (331, 2))
    >>> print(compared.to_dict()["free_map"]["boundary"])
    free
    """

    cases: Mapping[str, Case]
    maps: Mapping[str, Floats]
    disk: Surface
    closed: Surface | None = None

    def to_dict(self) -> dict[str, dict[str, Any]]:
        """Return a row for each method, as JSON types: None for what is not a finite number.

        Returns
        -------
        dict of str to dict
            The fields of a `reference.Case`. ``pandas.DataFrame(c.to_dict().values())`` is a table.
        """
        return {name: case.as_json() for name, case in self.cases.items()}

    def rows(self) -> list[tuple[Floats, Ints, list[tuple[str, float, Floats | None]]]]:
        """Return what `plot.side_by_side` draws: a surface and its maps, of a closed one two."""
        surfaces = [(self.disk, False), *([(self.closed, True)] if self.closed else [])]
        drawn = (
            (*surface, [(name, case.mean, self.maps.get(name)) for name, case in of.items()])
            for surface, spheres in surfaces
            if (of := {n: c for n, c in self.cases.items() if self._on_sphere(c) == spheres})
        )
        return list(drawn)

    def _on_sphere(self, case: Case) -> bool:
        return self.closed is not None and case.boundary == "sphere"

    @typed
    def plot(self, name: str = "") -> np.ndarray[Any, np.dtype[np.object_]]:
        """Draw the surface and all maps in its colours, side by side.

        Parameters
        ----------
        name : str
            Of the surface.

        Returns
        -------
        (k,) ndarray of matplotlib.axes.Axes
            In a figure that does not depend on pyplot: ``axes[0].figure.savefig``.
        """
        from ..plot import side_by_side

        rows = self.rows()
        axes: list[Axes] = side_by_side(rows, names=[name] * len(rows)).axes
        return np.array(axes)

    @typed
    def view(self, path: str | PathLike[str] | None = None, *, title: str = "") -> Path:
        """Write the page of `Result.view`, of CDCP's map with all others beside it, or open it.

        Of a closed surface, it switches to the sphere; other maps onto it are shapes there.

        Parameters
        ----------
        path : path-like, optional
            Named .html. Without it, the page is opened in the browser.
        title : str
            The heading, such as the name of the surface.

        Returns
        -------
        Path
            Where the page is.
        """
        from ..plot import view

        shown: dict[str, tuple[Callable[..., Any], Surface]] = {}
        if not all(map(self._on_sphere, self.cases.values())):
            shown["cdcp"] = disk_map, self.disk
        if self.closed:
            shown["sphere"] = sphere_map, self.closed
        beside = {
            other: np.vstack([self._of(other, uv, *shown[name]) for name in shown])
            for other, uv in self.maps.items()
            if other not in shown
        }
        results = {name: function(*surface) for name, (function, surface) in shown.items()}
        return view(results, path, beside=beside, title=title)

    def _of(self, name: str, uv: Floats, function: Callable[..., Any], surface: Surface) -> Floats:
        """Rows of a map for a surface: NaN if it is of the other one."""
        n = int(surface[1].max()) + 1
        of_other = self._on_sphere(self.cases[name]) != (function is sphere_map)
        return np.full((n, uv.shape[1]), nan) if of_other else uv[:n]

    def _table(self) -> tuple[str, list[list[str]], list[str]]:
        """Title, rows, and why some have no map."""
        n = len((self.closed or self.disk)[0])
        opened = ", cut open for maps to the plane" if self.closed else ""
        rows = [
            [
                name,
                case.boundary,
                *(_written(getattr(case, k), form) for k, form in FORMATS.items()),
            ]
            for name, case in self.cases.items()
        ]
        failed = [f"{name}: {case.outcome}" for name, case in self.cases.items() if not case.ok]
        return f"{n:,} vertices{opened}", rows, failed

    def __str__(self) -> str:
        title, rows, failed = self._table()
        return "\n".join([table_as_text(title, HEADINGS, rows), *failed])

    __repr__ = __str__

    def _repr_html_(self) -> str:
        title, rows, failed = self._table()
        return table_as_html(title, HEADINGS, rows, failed)


def _written(value: float | str, form: str) -> str:
    return value if isinstance(value, str) else format(value, form) if isfinite(value) else "–"


@takes_meshes
def compare(
    V: ArrayLike,
    F: ArrayLike,
    methods: Iterable[Given] | Mapping[str, Given] | None = None,
    *,
    time_limit: float = 600.0,
    progress: Progress | None = None,
) -> Comparison:
    """Compare methods on a surface: distortion of angles and areas, validity, time, memory.

    Each method of `METHODS` runs in a process of its own, which it may crash; a function of one's
    own runs in this one. What fails has a row that says why.

    Parameters
    ----------
    V : (n, 3) or (n, 2) array_like
        Vertex positions.
    F : (m, 3) array_like of integers
        Corners of the faces: a disk; or a closed surface of genus 0, which is mapped onto the
        sphere, and cut open for the methods that map to the plane.
    methods : sequence of str, function or Method; or mapping of str to these; optional
        Names of `METHODS`, and functions ``f(V, F)`` that return (n, 2) float64, rows as in V, or a
        result such as a `FreeMap`. A function goes by its name, in a mapping by the key. By
        default all of `METHODS` that map the surface.
    time_limit : float
        Seconds, of each method in a process of its own.
    progress : callable, optional
        Called as ``progress(name, share)`` before each method.

    Returns
    -------
    Comparison

    Raises
    ------
    MeshError
        If the surface is neither a disk nor a closed surface of genus 0.
    ValueError
        If a method is none of `METHODS` and no function, has no name, or one that is there twice.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F, exact = cdcp_igl.datasets.spherical_cap(10)
    >>> def from_above(V, F):
    ...     return V[:, :2]
    >>> compared = cdcp_igl.compare(V, F, [from_above, cdcp_igl.cdcp])
    >>> [case.mean < 3 for case in compared.cases.values()]
    [False, True]
    >>> compared.cases["from_above"].boundary, compared.cases["cdcp"].boundary
    ('free', 'disk')
    """
    V, F = np.asarray(V), np.asarray(F)
    opened = _opened(V, F)
    wanted = _named(methods)
    if methods is None:
        spheres = [name for name, given in METHODS.items() if given.boundary == "sphere"]
        wanted = {name: name for name in METHODS if opened or name not in spheres}
    made: dict[str, tuple[Case, Floats | None]] = {}
    of = {
        name: METHODS[given] if isinstance(given, str) else given for name, given in wanted.items()
    }
    whole = {
        name: opened is not None and getattr(method, "boundary", "") == "sphere"
        for name, method in of.items()
    }
    for name in sorted(wanted, key=whole.__getitem__):  # those to the plane first
        if progress:
            progress(name, len(made) / len(wanted))
        given = wanted[name]
        surface = (V, F) if whole[name] or opened is None else opened
        if isinstance(given, str):
            case, uv = run_case(given, *surface, time_limit=time_limit)
            made[name] = replace(case, method=name), uv
        else:
            made[name] = _here(name, given, *surface)
    cases = {name: case for name, (case, _) in made.items()}
    maps = {name: uv for name, (_, uv) in made.items() if uv is not None}
    return Comparison(cases, maps, opened or (V, F), (V, F) if opened else None)


def _named(methods: Iterable[Given] | Mapping[str, Given] | None) -> dict[str, Given]:
    """Name what is to be compared; ValueError if that is not possible."""
    if isinstance(methods, str | Method) or callable(methods):
        methods = [methods]
    if not isinstance(methods, Iterable | None):
        raise ValueError(f"methods must be names, functions, or a mapping to them, not {methods!r}")
    if isinstance(methods, Mapping):
        pairs = list(methods.items())
    else:
        pairs = [(_name(given), given) for given in methods or ()]
    for name, given in pairs:
        known_by_name = isinstance(given, str) and given in METHODS
        if not (isinstance(given, Method) or callable(given) or known_by_name):
            known = ", ".join(METHODS)
            raise ValueError(f"{given!r} is not one of {known}, and no function of V and F")
        if sum(name == other for other, _ in pairs) > 1:
            raise ValueError(f"two methods are called {name!r}: pass a mapping from names to them")
    return dict(pairs)


def _name(given: Given) -> str:
    if isinstance(given, str):
        return given
    name = getattr(given, "__name__", None)
    if name is None:
        raise ValueError(f"{given!r} has no name: pass a mapping from names to functions")
    return str(name)


def _here(name: str, given: Any, V: Floats, F: Ints) -> tuple[Case, Floats | None]:
    """Run a function in this process, whose peak of memory says nothing about it."""
    method = given if isinstance(given, Method) else Method(given, "free", "")
    measured, uv = measure(method, V, F)
    boundary = method.boundary
    if method is not given and uv is not None and certify(DiskMesh(V, F), uv).valid:
        boundary = "disk"
    return Case(name, boundary, **measured | {"memory": nan}), uv


def _opened(V: Floats, F: Ints) -> Surface | None:
    """Cut a closed surface of genus 0 open; None of a disk, MeshError of any other."""
    try:
        DiskMesh(V, F)
        return None
    except MeshError as error:
        if error.defect != "closed surface":
            raise
    SphereMesh(V, F)
    chart = surface_map(V, F, outline="disk", max_charts=1).charts[0].mesh
    return chart.V, chart.F
