"""The table of defects: what can be wrong with a surface or a file, and what to do about it.

A row for each. `errors.Defect.of` makes a defect of a row; who finds one gives its numbers. The
command line says the remedy in the shell (`Defect.remedy_in_shell`, `Defect.in_shell`), and the
page on errors prints this table.
"""

from __future__ import annotations

import re
from typing import NamedTuple

# What the remedies call: functions for who has arrays, commands for who has files.
CALLS = {
    "clean": ("cdcp_igl.clean", "cdcp-igl map --clean"),
    "close": ("cdcp_igl.clean with close=True", "cdcp-igl map --sphere --clean"),
    "from_1": ("pass F - 1", "subtract 1 from each in the file"),
    "within": ("cdcp_igl.clean with within=", "cdcp-igl map --clean --within "),
    "flip": ("cdcp_igl.clean with flip_ears=True", "in Python, clean with flip_ears=True"),
    "sew": ("cdcp_igl.clean with fill=False", "cdcp-igl map --annulus --clean"),
    "cut": ("cdcp_igl.cut", "cdcp-igl map --cut"),
    "with_path": ("with cdcp_igl.cut(V, F, path)", "in a program for meshes"),
    "surface_map": ("cdcp_igl.surface_map", "cdcp-igl map --cut"),
    "disk_map": ("cdcp_igl.disk_map", "cdcp-igl map"),
    "sphere_map": ("cdcp_igl.sphere_map", "cdcp-igl map --sphere"),
    "annulus_map": ("cdcp_igl.annulus_map", "cdcp-igl map --annulus"),
    "clean_and_cut": ("cdcp_igl.clean and cdcp_igl.surface_map", "cdcp-igl map --clean --cut"),
    "batch": ("cdcp_igl.batch", "cdcp-igl batch"),
    "parts": ("cdcp_igl.partition, cdcp_igl.parts_map", "cdcp-igl partition, then cdcp-igl map"),
}
IN_PYTHON, IN_SHELL = ({call: names[k] for call, names in CALLS.items()} for k in (0, 1))
CLEAN, CUT = "--clean", "--cut"


def as_commands(text: str) -> str:
    """Name commands in a text in the place of functions."""
    commands = dict(CALLS.values())
    longest_first = sorted(commands, key=len, reverse=True)
    return re.sub("|".join(map(re.escape, longest_first)), lambda call: commands[call[0]], text)


class Row(NamedTuple):
    """What is said of a defect.

    Its name is the key up to a comma: the rows of one name differ in what to do.
    """

    message: str  # in braces what is given for each case; after the number of the subject
    call: str  # what to do; in braces a key of the names above
    subject: tuple[str, str] | None = None  # of one, of several
    kind: str = "faces"  # what is counted
    by: tuple[str, ...] = ()  # what copes with it: CLEAN mends it, CUT maps it, cut open

    @property
    def remedy(self) -> str:
        """What to do in Python."""
        return self.call.format(**IN_PYTHON)

    @property
    def remedy_in_shell(self) -> str:
        """What to do on the command line."""
        return self.call.format(**IN_SHELL)


DEFECTS = {
    # Arrays
    "not numeric": Row(
        "{array} is not a rectangular array of real numbers",
        "V takes rows of 3 (or 2) real numbers, F rows of 3 integers.",
    ),
    "shape of V": Row(
        "V has shape {shape}",
        "It must be (n, 3), or (n, 2) for a planar mesh, with n at least 3; transpose it, and F, "
        "if the columns are vertices.",
    ),
    "shape of V, of a mesh": Row(
        "V has {rows:,} rows and the mesh {vertices:,} vertices",
        "Only vertices may move; for another connectivity make a new mesh.",
    ),
    "shape of F": Row(
        "F has shape {shape}",
        "It must be (m, 3) with m at least 1; polygons are taken in one object with V, as (V, F).",
    ),
    "V and F swapped": Row(
        "V has the corners of faces, and F has coordinates",
        "Pass the vertices first, (V, F); in a file, exchange the two.",
    ),
    "non-finite coordinate": Row(
        "a NaN or infinite coordinate in V",
        "Restore the coordinates; {clean} drops these vertices with their faces.",
        subject=("vertex has", "vertices have"),
        kind="vertices",
        by=(CLEAN,),
    ),
    "non-finite coordinate, of a map": Row(
        "a NaN or infinite coordinate in uv",
        "Restore the coordinates.",
        subject=("vertex has", "vertices have"),
        kind="vertices",
    ),
    "points without data": Row(
        "at {place}, far from all others: points that were not measured, as it seems",
        "Make their coordinates NaN; {clean} drops them with their faces, and {surface_map} leaves "
        "these out.",
        subject=("vertex lies", "vertices lie"),
        kind="vertices",
        by=(CLEAN, CUT),
    ),
    "shape of V, transposed": Row(
        "V has shape {shape}", "Its columns are vertices: transpose it, V.T, and F if it is alike."
    ),
    "shape of F, empty": Row(
        "There are no faces", "A cloud of points is no surface: give the mesh with its faces."
    ),
    "shape of F, flat": Row(
        "F has shape {shape}, a list in which the number of corners comes before them",
        "Pass the mesh itself, not mesh.faces.",
    ),
    "not numeric, cells": Row(
        "F is a list of cells by their type", "Pass the mesh itself, not mesh.cells."
    ),
    "no surface": Row(
        "{type} is no surface: it has no vertices, points or V, or no faces, triangles, cells or F",
        "Pass V and F; or in their place a tuple (V, F), the path of a file, or a mesh of trimesh, "
        "Open3D, PyVista, meshio, nilearn or LaPy.",
    ),
    "no surface, but another": Row(
        "{type} has no triangles or polygons of its own, but mesh.{method}() has",
        "Pass that in its place.",
    ),
    "index out of range": Row(
        "an index outside 0..{last}",
        "Correct or drop them.",
        subject=("face has", "faces have"),
    ),
    "index out of range, from 1": Row(
        "an index outside 0..{last}",
        "The indices count from 1: {from_1}.",
        subject=("face has", "faces have"),
    ),
    "indices from 1": Row(
        "No face has vertex 0, and edges would be far shorter if indices counted from 1",
        "They do: {from_1}, and leave out the last row of V, which no face uses then.",
    ),
    "fractional index": Row(
        "an index that is no integer",
        "F takes integers, the rows of V.",
        subject=("face has", "faces have"),
    ),
    # Faces
    "repeated corner": Row(
        "the same vertex at two corners",
        "Drop these faces, as {clean} and {surface_map} do.",
        subject=("face has", "faces have"),
        by=(CLEAN, CUT),
    ),
    "unreferenced vertex": Row(
        "to no face",
        "Drop them and renumber F, as {clean} does; {surface_map} ignores them.",
        subject=("vertex belongs", "vertices belong"),
        kind="vertices",
        by=(CLEAN, CUT),
    ),
    "duplicate face": Row(
        "the corners of another",
        "Drop these faces, as {clean} and {surface_map} do.",
        subject=("face repeats", "faces repeat"),
        by=(CLEAN, CUT),
    ),
    "degenerate face": Row(
        "no area to speak of",
        "Merge coinciding vertices, and collapse or flip the slivers; {clean} and {surface_map} "
        "merge, and drop what is left of them.",
        subject=("face has", "faces have"),
        by=(CLEAN, CUT),
    ),
    # How faces hang together
    "non-manifold edge": Row(
        "on three or more faces",
        "Part the sheets that meet there, as both do: {clean} keeps the largest, {surface_map} "
        "maps them all.",
        subject=("edge lies", "edges lie"),
        kind="edges",
        by=(CLEAN, CUT),
    ),
    "not orientable": Row(
        "The surface is one-sided, like a Möbius strip",
        "{surface_map} cuts it where its orientation turns over, and maps it; or cut it across "
        "elsewhere, {with_path}.",
        by=(CUT,),
    ),
    "inconsistent orientation": Row(
        "oriented unlike the others",
        "Reverse the corners of these faces, as {clean} and {surface_map} do.",
        subject=("face is", "faces are"),
        by=(CLEAN, CUT),
    ),
    "several components": Row(
        "{components:,} components, the largest with {largest:,} of {faces:,} faces",
        "{clean} keeps the largest, {surface_map} maps each of them.",
        by=(CLEAN, CUT),
    ),
    "several components, coinciding": Row(
        "{components:,} components, the largest with {largest:,} of {faces:,} faces",
        "{clean} keeps the largest, {surface_map} maps each of them. Some vertices coincide: both "
        "merge them along seams, which may join the components.",
        by=(CLEAN, CUT),
    ),
    "non-manifold vertex": Row(
        "several fans of faces",
        "Split each into one copy a fan, as {clean} and {surface_map} do.",
        subject=("vertex joins", "vertices join"),
        kind="vertices",
        by=(CLEAN, CUT),
    ),
    "closed surface": Row(
        "The surface has no boundary",
        "{sphere_map} maps it onto a sphere; {surface_map} cuts it open, and maps it.",
        by=(CUT,),
    ),
    "closed surface, with handles": Row(
        "The surface has no boundary",
        "{surface_map} cuts it open, and maps it.",
        by=(CUT,),
    ),
    "boundary": Row(
        "The boundary loops of the surface are {loops:,}, a sphere has none",
        "{close} merges vertices that are there twice, as at seams, and fills all loops; "
        "{disk_map} maps a surface with one loop, {annulus_map} with two or more.",
    ),
    "several boundary loops": Row(
        "{loops:,} boundary loops, the outer one with {outer:,} vertices",
        "{clean} fills the holes, {cut} joins the loops by cuts.",
        kind="vertices",
        by=(CLEAN, CUT),
    ),
    "one boundary loop": Row(
        "The surface has one boundary loop, an annulus has two",
        "{disk_map} maps it; {sew} sews a seam that makes a tube a strip.",
    ),
    "face on the inner circle": Row(
        "all three corners on the loop that would be the inner circle, where it would be flipped",
        "Drop these faces, and vertices that no face uses then; or {clean} fills this hole, "
        "{surface_map} maps the surface as it is.",
        subject=("face has", "faces have"),
        by=(CLEAN, CUT),
    ),
    "edge across the inner circle": Row(
        "two vertices of the loop that would be the inner circle, inside of which it would lie",
        "{clean} fills this hole, {surface_map} maps the surface as it is.",
        subject=("edge inside joins", "edges inside join"),
        kind="edges",
        by=(CLEAN, CUT),
    ),
    "handle": Row(
        "The surface has genus {genus}, a disk has 0",
        "{surface_map} cuts each handle open, and maps it.",
        by=(CUT,),
    ),
    # What was asked for
    "nothing left": Row("{done}, and no face is left", "Restore the mesh."),
    "not an edge": Row(
        "{missing:,} of {steps:,} steps of the path are no edge between faces",
        "Go from vertex to vertex along edges that two faces share.",
        kind="edges",
    ),
    "not an edge, but a pair": Row(
        "{missing:,} of {pairs:,} pairs of {name} are no edge of a face",
        "Name each edge by the two rows of V that it joins, counted from 0.",
        kind="edges",
    ),
    "no way for a cut": Row(
        "The surface cannot be cut to disks, as the only ways are across forbidden edges",
        "Forbid fewer edges: those around a handle or a hole leave no way along it.",
    ),
    # Files
    "too few corners": Row(
        "fewer than three corners",
        "The file may be cut off: export it again, or drop these faces.",
        subject=("face has", "faces have"),
    ),
    "unreadable file": Row("{reason}", "Name a file that may be read."),
    "unreadable file, a folder": Row(
        "{path!r} is a folder", "Name a file in it; {batch} maps all of them."
    ),
    "unreadable file, empty": Row(
        "no vertices were found in {name!r}", "Export it again, or in another format."
    ),
    "unreadable file, a pointer": Row(
        "{name!r} is a pointer of Git LFS, which stands for the file",
        "Get the file: git lfs pull.",
    ),
    "unreadable file, without a map": Row(
        "{name!r} has no texture coordinates",
        "Export them with the surface; {surface_map} makes some.",
    ),
    "unreadable file, of parts": Row(
        "{name!r} is cut off, or damaged", "Part the surface again, to another folder."
    ),
    "unreadable file, damaged": Row(
        "{name!r} is not a readable {type} file: {reason}",
        "Export it again, or in another format.",
    ),
}
