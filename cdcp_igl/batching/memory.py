"""How much memory a surface will need, guessed from its file before it is read."""

from __future__ import annotations

import os
from pathlib import Path
from zipfile import ZipFile

import numpy as np

__all__ = ["memory_needed"]

# Peak memory of a map; `cdcp-igl batch` writes it down for every surface, and on those from
# 100,000 to a million vertices it is less than this, cut open or not.
MIB_PER_VERTEX = 2.5e-3
MIB_OF_PYTHON = 150.0

# The fewest bytes that a vertex and its two faces take in each kind of file.
BYTES_PER_VERTEX = {".obj": 40, ".off": 40, ".ply": 36, ".stl": 100, ".mat": 12, ".npz": 12}


def memory_needed(path: str) -> float:
    """Return MiB, rather too many than too few."""
    try:
        return MIB_OF_PYTHON + MIB_PER_VERTEX * _vertices(Path(path))
    except Exception:  # whatever is wrong with the file, its worker will find out and say
        return MIB_OF_PYTHON


def _vertices(path: Path) -> float:
    if path.suffix.lower() == ".npz":
        return _vertices_of_archive(path)
    return os.stat(path).st_size / BYTES_PER_VERTEX.get(path.suffix.lower(), 12)


def _vertices_of_archive(path: Path) -> int:
    """Read the shape of V from its header, without unpacking what follows."""
    with ZipFile(path) as archive:
        name = next(name for name in ("V.npy", "v.npy") if name in archive.namelist())
        with archive.open(name) as file:
            version = np.lib.format.read_magic(file)
            read = np.lib.format.read_array_header_1_0
            if version != (1, 0):
                read = np.lib.format.read_array_header_2_0
            shape, _, _ = read(file)
    return int(shape[0]) if shape else 0
