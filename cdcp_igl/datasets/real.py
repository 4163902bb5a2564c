"""Real surfaces: models that are public, the paper's among them, and a terrain."""

from __future__ import annotations

import os
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from .. import libigl
from ..arguments import typed
from ..arrays import Floats, Ints
from ..extras import from_extra
from ..io import read_mesh

# Each line has the name of a surface, that of its file, the SHA-256 of the file and its address,
# which names one commit of a repository.
_FILES = {
    name: (file, sha256, url)
    for name, file, sha256, url in (
        line.split()
        for line in (files(__package__) / "registry.txt").read_text("utf-8").splitlines()
    )
}
_TERRAIN = "jacksboro_fault"

NAMES = (*_FILES, _TERRAIN)


@typed
def load(name: str) -> tuple[Floats, Ints]:
    """Load a real surface by name.

    Parameters
    ----------
    name : str
        One of

        - ``"chinese_lion"``, ``"human_brain"``, ``"human_face"``, ``"left_hand"``: scans
          that the papers on disk conformal maps use;
        - any other of `NAMES`: models that are known in the field. Names that begin with
          ``closed``, ``handles``, ``loops``, ``parts`` and ``defects`` are no disks: closed of
          genus 0, closed with handles, with several boundary loops, of several components, and with
          edges of three faces and the like. Like the scans, they are downloaded once, checked
          by SHA-256 and cached (needs the extra ``data``). The terms are those of the
          repositories that they come from;
        - ``"jacksboro_fault"``: SRTM elevations of a mountain in Tennessee, from
          Matplotlib's sample data (needs the extra ``plot``, and no network);
        - the name of a mesh file, with or without its suffix, in the directory that the
          environment variable ``CDCP_IGL_DATA`` names. This is looked at first.

    Returns
    -------
    V : (n, 3) float64
        Vertex positions; metres for the terrain, whatever the file has for the others.
    F : (m, 3) int64
        Faces, counterclockwise seen from outside.

    Raises
    ------
    ValueError
        If nothing has that name.
    OSError
        If the surface is not at hand and cannot be downloaded.
    ImportError
        If the extra is missing; the message names it.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F = cdcp_igl.datasets.load("jacksboro_fault")
    >>> len(V)
    138632
    """
    if found := _in_data_directory(name):
        return read_mesh(found)
    if name == _TERRAIN:
        return _terrain()
    if name not in _FILES:
        raise ValueError(
            f"no surface is called {name!r}; there are {', '.join(NAMES)}, and the mesh files "
            f"in the directory CDCP_IGL_DATA names (now {os.environ.get('CDCP_IGL_DATA')!r})"
        )
    return read_mesh(_downloaded(name))


def _in_data_directory(name: str) -> Path | None:
    if not os.environ.get("CDCP_IGL_DATA"):
        return None
    directory = Path(os.environ["CDCP_IGL_DATA"])
    if not directory.is_dir():
        raise FileNotFoundError(f"CDCP_IGL_DATA names {str(directory)!r}, which is no directory")
    wanted = {name, _FILES[name][0]} if name in _FILES else {name}
    suffixes = {".npz", ".mat", ".obj", ".off", ".ply", ".stl"}
    return next(
        (
            path
            for path in sorted(directory.rglob("*"))
            if path.suffix in suffixes and (path.name in wanted or path.stem in wanted)
        ),
        None,
    )


def _downloaded(name: str) -> Path:
    with from_extra("data"):
        import pooch
    file, sha256, url = _FILES[name]
    try:
        return Path(pooch.retrieve(url, f"sha256:{sha256}", file, pooch.os_cache("cdcp_igl")))
    except Exception as error:  # requests' errors have no common base worth naming
        raise OSError(
            f"{name} is not cached and could not be downloaded ({type(error).__name__}). Either "
            f"connect to the network once, or put the file of {url} (SHA-256 {sha256}) as {file} "
            "into a directory and set the environment variable CDCP_IGL_DATA to it."
        ) from error


def _terrain() -> tuple[Floats, Ints]:
    """Triangulate the elevation grid, in metres on a local tangent plane."""
    with from_extra("plot"):
        from matplotlib.cbook import get_sample_data
    sample: Any = get_sample_data("jacksboro_fault_dem.npz")
    elevation = sample["elevation"].astype(float)
    rows, columns = elevation.shape
    metres_per_degree = 111_195.0  # on a sphere of 6,371 km
    latitude = np.linspace(sample["ymin"], sample["ymax"], rows)  # from north to south
    longitude = np.linspace(sample["xmin"], sample["xmax"], columns)
    x, y = np.meshgrid(
        (longitude - longitude[0]) * metres_per_degree * np.cos(np.radians(latitude.mean())),
        (latitude - latitude[-1]) * metres_per_degree,
    )
    V = np.stack([x, y, elevation], axis=2).reshape(-1, 3)
    # libigl has the rows of a grid from the lowest up, so here every face is flipped.
    return V, np.ascontiguousarray(libigl.grid_faces(columns, rows)[:, ::-1])
