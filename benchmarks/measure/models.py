"""The surfaces that are measured: by name, by path, by glob."""

from __future__ import annotations

import glob
import hashlib
import itertools
import os
import re
from collections.abc import Callable, Container, Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatch
from functools import partial
from pathlib import Path

import igl
import numpy as np
import typer

from cdcp_igl import check, datasets, surface_map
from cdcp_igl.arrays import Floats, Ints
from cdcp_igl.io import READABLE, read_mesh
from cdcp_igl.surface.mesh import SphereMesh

from ..records.paper import PAPER
from ..records.record import CLOSED, OPENED
from ..records.store import Work
from .fuzzing import surface

Surface = tuple[Floats, Ints]

SEED = 1  # of the patches
TIERS = {"quick": 8, "standard": 60, "large": 300}  # surfaces of CDCP-bench, each in the next


@dataclass(frozen=True)
class Model:
    """A named surface; `load` raises if it is not to be had."""

    name: str
    load: Callable[[], Surface]


def data() -> Path | None:
    """Return the folder that CDCP_IGL_DATA names, None if it is not set."""
    named = os.environ.get("CDCP_IGL_DATA")
    if not named:
        return None
    if not Path(named).is_dir():
        raise typer.BadParameter(
            f"{named!r} is no folder: set it to one with surfaces, or unset it",
            param_hint="CDCP_IGL_DATA",
        )
    return Path(named)


def files_of(folder: Path | None, kinds: Container[str]) -> list[Path]:
    """List the files of a folder, by default of `any` in that of the data, that end so."""
    above = data() if folder is None else None
    folder = above / "any" if above else folder
    if folder is None:
        text = "give one, or set CDCP_IGL_DATA to a folder in which `any` has surfaces"
        raise typer.BadParameter(text, param_hint="FOLDER")
    files = sorted(path for path in folder.glob("*") if path.suffix in kinds)
    if not files:
        text = f"there are no surfaces in {str(folder)!r}: give another folder"
        raise typer.BadParameter(text, param_hint="FOLDER")
    return files


def _generated(shape: Callable[[int], tuple[Floats, Ints, Floats]], resolution: int) -> Model:
    return Model(f"{shape.__name__}_{resolution}", lambda: shape(resolution)[:2])


def _coarse_terrain(step: int = 8) -> Surface:
    """Every eighth row and column of the terrain."""
    V, _ = datasets.load("jacksboro_fault")
    columns = len(np.unique(V[:, 0]))
    grid = V.reshape(-1, columns, 3)[::step, ::step]
    corner = np.arange(grid.shape[0] * grid.shape[1]).reshape(grid.shape[:2])
    nw, ne, sw, se = corner[:-1, :-1], corner[:-1, 1:], corner[1:, :-1], corner[1:, 1:]
    F = np.concatenate([np.stack([sw, se, ne], axis=2), np.stack([sw, ne, nw], axis=2)])
    return grid.reshape(-1, 3), F.reshape(-1, 3)


SMALL = (
    _generated(datasets.spherical_cap, 20),
    _generated(datasets.ellipse, 20),
    _generated(datasets.square, 20),
    _generated(datasets.paraboloid, 20),
    Model("terrain_coarse", _coarse_terrain),
)
GENERATED = (
    *SMALL,
    _generated(datasets.square, 80),
    _generated(datasets.paraboloid, 100),
    Model("jacksboro_fault", partial(datasets.load, "jacksboro_fault")),
)


def _known() -> list[Model]:
    """List the paper's models or what stands for them; then what else is at hand."""
    models = [
        _named(row.model) if row.model else _missing(row.name, "nothing of this size at hand")
        for row in PAPER
    ]
    models.append(_named("human_face"))
    folder = data()
    if not folder:
        return [*models, *GENERATED]
    taken = tuple(model.name for model in models)
    files = sorted(path for path in folder.iterdir() if path.suffix in READABLE)
    others = [_file(path) for path in files if not path.stem.startswith(taken)]
    return [*models, *others]


def _named(name: str) -> Model:
    def load() -> Surface:
        try:
            return datasets.load(name)
        except ValueError as error:  # it tells where it looked, which is nobody's business
            raise ValueError("no mesh of this name") from error

    return Model(name, load)


def _file(path: Path, whole: bool = False) -> Model:
    """Name a file by its stem, or by the whole path where another has the same."""
    return Model(path.as_posix() if whole else path.stem, partial(read_mesh, path))


def _missing(name: str, reason: str) -> Model:
    def load() -> Surface:
        raise ValueError(reason)

    return Model(name, load)


def find(wanted: Sequence[str] = ()) -> list[Model]:
    """Look up models.

    Parameters
    ----------
    wanted : sequence of str
        Names or patterns of names, paths or patterns of paths, ``"patches:300"`` for so many
        random disks; none at all means everything.

    Returns
    -------
    list of Model

    Raises
    ------
    ValueError
        If one of them matches nothing.
    """
    known = _known()
    if not wanted:
        return known
    named: dict[str, Model] = {}
    files: dict[Path, None] = {}
    for text in wanted:
        matches = [model for model in (*known, *GENERATED) if fnmatch(model.name, text)]
        if re.fullmatch(r"patches:\d+", text):
            matches = list(itertools.islice(patches(), int(text.partition(":")[2])))
        paths = [] if matches else [Path(path) for path in sorted(glob.glob(text, recursive=True))]
        paths = [path for path in paths if path.suffix in READABLE]
        if not matches and not paths:
            raise ValueError(f"{text!r} is neither the name of a surface nor a file that is there")
        named |= {model.name: model for model in matches}
        files |= dict.fromkeys(paths)
    stems = [*named, *(path.stem for path in files)]
    alone = [stems.count(path.stem) == 1 for path in files]
    read = [_file(path, whole=not one) for path, one in zip(files, alone, strict=True)]
    return [*named.values(), *read]


def patches() -> Iterator[Model]:
    """Yield random disks without end: those among the cases of the command fuzz."""
    for case in itertools.count():
        patch = surface(SEED, case)
        if check(patch.V, patch.F).is_disk:
            yield Model(f"patch {case:04}", partial(given, patch.V, patch.F))


def tier(name: str) -> list[Model]:
    """Return the first so many surfaces of CDCP-bench, the same on every machine.

    Those that are generated and patches of the terrain, which need no network; the public ones,
    by address and digest; patches of all of these.
    """
    return list(itertools.islice(_bench(), TIERS[name]))


def _bench() -> Iterator[Model]:
    near = range(TIERS["quick"] - len(SMALL))
    yield from SMALL
    yield from (_bench_patch(case, datasets.NAMES[-1:]) for case in near)
    yield from by_name(datasets.NAMES)
    yield from (_bench_patch(case, datasets.NAMES) for case in itertools.count(len(near)))


def _bench_patch(case: int, sources: Sequence[str]) -> Model:
    def load() -> Surface:
        made = surface(SEED, case, sources, damage=0)
        return made.V, made.F

    return Model(f"patch {case:03}", load)


def given(V: Floats, F: Ints) -> Surface:
    """Return a surface that is there already, as a `Model` loads it."""
    return V, F


def by_name(names: Sequence[str]) -> list[Model]:
    """Surfaces of these names; `load` of one that is not at hand raises."""
    return [_named(name) for name in names]


def subdivided(rounds: int) -> list[Model]:
    """One terrain of 1,000 vertices, and with each triangle cut into 4, 16, 64, ...

    The shape stays, so that times and memory tell their growth; six rounds make 4 million.
    """
    return [Model(f"terrain x {4**k}", partial(_upsampled, k)) for k in range(rounds + 1)]


def _upsampled(rounds: int) -> Surface:
    V, F = _coarse_terrain(12)
    return igl.upsample(V, F, rounds) if rounds else (V, F)


def as_disk(model: Model, work: Work) -> tuple[str, Floats, Ints]:
    """Load a model and open it if it is no disk; the work folder has it then.

    Of a surface that is none, the largest disk of its `surface_map` is taken, whose cut has
    grown and whose holes are filled.

    Returns
    -------
    mesh : str
        Its name in the work folder.
    V : (n, 3) float64
    F : (m, 3) int64
    """
    V, F = model.load()
    mesh = digest(V, F)
    for name in (mesh, mesh + OPENED):
        kept = work.surface(name)
        if kept is not None:
            return name, *kept
    if not check(V, F).is_disk:
        disks = surface_map(V, F, outline="disk").charts
        largest = max((disk.mesh for disk in disks), key=lambda disk: len(disk.F))
        mesh, V, F = mesh + OPENED, largest.V, largest.F
    work.keep_surface(mesh, V, F)
    return mesh, V, F


def as_sphere(model: Model, work: Work) -> tuple[str, Floats, Ints]:
    """Load a model as `as_disk` does; MeshError if it is no closed surface of genus 0."""
    V, F = model.load()
    SphereMesh(V, F)
    mesh = digest(V, F) + CLOSED
    work.keep_surface(mesh, V, F)
    return mesh, V, F


def digest(V: Floats, F: Ints) -> str:
    """Fingerprint of a surface."""
    positions = np.ascontiguousarray(V, dtype=np.float64)
    faces = np.ascontiguousarray(F, dtype=np.int64)
    return hashlib.sha256(positions.tobytes() + faces.tobytes()).hexdigest()[:12]
