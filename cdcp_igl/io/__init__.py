"""Meshes from files and maps to files, a module for each format.

libigl reads STL files here. Its readers of obj, off and ply end the process on truncated
files and on faces with fewer than three corners, and print on standard output, so those
formats are read in Python, which takes no longer; and its writers do not notice a full
disk. Readers raise ValueError (or what their libraries raise) on what they cannot read.
"""

from .files import READABLE, WRITABLE, read_mesh, whole_file, write_map

__all__ = ["READABLE", "WRITABLE", "read_mesh", "whole_file", "write_map"]
