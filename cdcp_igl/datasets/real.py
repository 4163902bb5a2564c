"""Real surfaces: the paper's models that are public, and a terrain."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from .. import libigl
from ..arrays import Floats, Ints
from ..extras import from_extra
from ..io import read_mesh

__all__ = ["NAMES", "load"]

# Apache-2.0 files of garyptchoi/disk-conformal-map at one commit, with their SHA-256.
_URL = (
    "https://raw.githubusercontent.com/garyptchoi/disk-conformal-map/"
    "9961ed1f7ebc75e481b9b32f77a0af662ca81fe7/"
)
_FILES = {
    "chinese_lion": (
        "chinese_lion.mat",
        "1a54710cfdfecca95546ca61cd4035e5e02e8b142e81b968c838b5c62957840e",
    ),
    "human_brain": (
        "human_brain.mat",
        "e6f8c9cd972a465b6affff3233795b208a2a224679c2a9d9c65b2a32b50d43cc",
    ),
    "human_face": (
        "human_face.mat",
        "705421e733d7368ec2aa80daa1ca8751bc0afd0d71fa21157049bbc160a64571",
    ),
    "left_hand": (
        "hand.mat",
        "a88112a32b7f9d351c5ecfbd17042253ca79b50ab1a2e86b424e317487935386",
    ),
}
_TERRAIN = "jacksboro_fault"

NAMES = (*_FILES, _TERRAIN)


def load(name: str) -> tuple[Floats, Ints]:
    """Load a real surface by name.

    Parameters
    ----------
    name : str
        One of

        - ``"chinese_lion"``, ``"human_brain"``, ``"human_face"``, ``"left_hand"``: scans
          that the papers on disk conformal maps use, downloaded once, checked by SHA-256
          and cached (needs the extra ``data``);
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
    file, sha256 = _FILES[name]
    try:
        return Path(
            pooch.retrieve(_URL + file, f"sha256:{sha256}", file, pooch.os_cache("cdcp_igl"))
        )
    except Exception as error:  # requests' errors have no common base worth naming
        raise OSError(
            f"{name} is not cached and could not be downloaded ({type(error).__name__}). Either "
            f"connect to the network once, or put {file} (SHA-256 {sha256}) into a directory "
            "and set the environment variable CDCP_IGL_DATA to it."
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
    # libigl has the rows of a grid from the lowest up, so here every face is turned over.
    return V, np.ascontiguousarray(libigl.grid_faces(columns, rows)[:, ::-1])
