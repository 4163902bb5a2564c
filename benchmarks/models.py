"""The surfaces that are measured: by name, by path, by glob."""

from __future__ import annotations

import glob
import hashlib
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fnmatch import fnmatch
from functools import partial
from pathlib import Path

import numpy as np

from cdcp_igl import datasets
from cdcp_igl.arrays import Floats, Ints
from cdcp_igl.io import READABLE, read_mesh

from .paper import PAPER

__all__ = ["Model", "digest", "find", "quick"]

Surface = tuple[Floats, Ints]


@dataclass(frozen=True)
class Model:
    """A named surface; `load` raises if it is not to be had."""

    name: str
    load: Callable[[], Surface]


def _of_size(function: Callable[[int], tuple[Floats, Ints, Floats]], resolution: int) -> Surface:
    V, F, _ = function(resolution)
    return V, F


def _coarse_terrain(step: int = 8) -> Surface:
    """Every eighth row and column of the terrain."""
    V, _ = datasets.load("jacksboro_fault")
    columns = len(np.unique(V[:, 0]))
    grid = V.reshape(-1, columns, 3)[::step, ::step]
    corner = np.arange(grid.shape[0] * grid.shape[1]).reshape(grid.shape[:2])
    nw, ne, sw, se = corner[:-1, :-1], corner[:-1, 1:], corner[1:, :-1], corner[1:, 1:]
    F = np.concatenate([np.stack([sw, se, ne], axis=2), np.stack([sw, ne, nw], axis=2)])
    return grid.reshape(-1, 3), F.reshape(-1, 3)


GENERATED = (
    Model("spherical_cap_20", partial(_of_size, datasets.spherical_cap, 20)),
    Model("ellipse_20", partial(_of_size, datasets.ellipse, 20)),
    Model("square_80", partial(_of_size, datasets.square, 80)),
    Model("paraboloid_100", partial(_of_size, datasets.paraboloid, 100)),
    Model("terrain_coarse", _coarse_terrain),
    Model("jacksboro_fault", partial(datasets.load, "jacksboro_fault")),
)


def _known() -> list[Model]:
    """List the paper's models or what stands for them; then what else is at hand."""
    models = [
        _named(row.model) if row.model else _missing(row.name, "nothing of this size at hand")
        for row in PAPER
    ]
    models.append(_named("human_face"))
    folder = os.environ.get("CDCP_IGL_DATA")
    if not folder:
        return [*models, *GENERATED]
    taken = tuple(model.name for model in models)
    files = sorted(path for path in Path(folder).iterdir() if path.suffix in READABLE)
    others = [_file(path) for path in files if not path.stem.startswith(taken)]
    return [*models, *others]


def _named(name: str) -> Model:
    def load() -> Surface:
        try:
            return datasets.load(name)
        except ValueError as error:  # it tells where it looked, which is nobody's business
            raise ValueError("no mesh of this name") from error

    return Model(name, load)


def _file(path: Path) -> Model:
    return Model(path.stem, partial(read_mesh, path))


def _missing(name: str, reason: str) -> Model:
    def load() -> Surface:
        raise ValueError(reason)

    return Model(name, load)


def quick() -> list[Model]:
    """Three small surfaces."""
    if os.environ.get("CDCP_IGL_DATA"):
        return [_named(name) for name in ("nefertiti_299", "femur_2411", "camelhead_11381")]
    return [
        model
        for model in GENERATED
        if model.name in ("spherical_cap_20", "ellipse_20", "terrain_coarse")
    ]


def find(wanted: Sequence[str] = ()) -> list[Model]:
    """Look up models.

    Parameters
    ----------
    wanted : sequence of str
        Names or patterns of names, paths or patterns of paths; none at all means everything.
        What matches nothing becomes a model that is not to be had.

    Returns
    -------
    list of Model
    """
    known = _known()
    if not wanted:
        return known
    found: dict[str, Model] = {}
    for text in wanted:
        matches = [model for model in (*known, *GENERATED) if fnmatch(model.name, text)]
        if not matches:
            paths = [Path(path) for path in sorted(glob.glob(text, recursive=True))]
            matches = [_file(path) for path in paths if path.suffix in READABLE]
        for model in matches or [_named(text)]:
            found.setdefault(model.name, model)
    return list(found.values())


def digest(V: Floats, F: Ints) -> str:
    """Fingerprint of a surface."""
    positions = np.ascontiguousarray(V, dtype=np.float64)
    faces = np.ascontiguousarray(F, dtype=np.int64)
    return hashlib.sha256(positions.tobytes() + faces.tobytes()).hexdigest()[:12]
