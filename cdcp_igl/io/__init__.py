"""Meshes from files and maps to files, a module for each format.

All formats are read in Python: libigl's readers of obj, off and ply end the process on truncated
files and on faces with fewer than three corners, and print on standard output, as that of stl
does on damaged ones; its writers do not notice a full disk. SciPy's reader of mat files ends the
process on some damaged ones. Readers raise `Damage` (or what their libraries raise) on what they
cannot read.
"""

from .reading import READABLE, read_mesh, read_polygons
from .texture import read_texture
from .values import read_patch, read_values, read_vertices
from .writing import WRITABLE, write_map

__all__ = [
    "READABLE",
    "WRITABLE",
    "read_mesh",
    "read_patch",
    "read_polygons",
    "read_texture",
    "read_values",
    "read_vertices",
    "write_map",
]
