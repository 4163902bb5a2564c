"""The table of defects: what can be wrong with a surface or a file, and what to do about it.

A row for each. `errors.Defect.of` makes a defect of a row; who finds one gives its numbers. The
command line says the remedy in the shell (`Defect.remedy_in_shell`, `Defect.in_shell`), and the
page on errors prints this table.
"""

from __future__ import annotations

from typing import NamedTuple


class Row(NamedTuple):
    """What is said of a defect.

    Its name is the key up to a comma: the rows of one name differ in what to do.
    """

    message: str  # in braces what is given for each case; after the number of the subject
    remedy: str
    in_shell: str = ""  # the remedy for who has files and commands; the same if it is empty
    subject: tuple[str, str] | None = None  # of one, of several
    kind: str = "faces"  # what is counted
    cleaned: bool = False  # `clean` mends it
    cut: bool = False  # `surface_map` maps it, cut open


CORRECT = "Correct these faces in the file, or export it again."

DEFECTS = {
    # Arrays
    "not numeric": Row(
        "{array} is not a rectangular array of real numbers",
        "V takes rows of 3 (or 2) real numbers, F rows of 3 integers.",
        "Export the file again: V takes rows of 3 (or 2) real numbers, F rows of 3 integers.",
    ),
    "shape of V": Row(
        "V has shape {shape}",
        "It must be (n, 3), or (n, 2) for a planar mesh, with n at least 3.",
        "Export the file again: a row for each vertex, at least 3, with 3 or 2 columns.",
    ),
    "shape of V, transposed": Row(
        "V has shape {shape}, and F has shape {faces}",
        "V must be (n, 3) and F (m, 3), a row for each: transpose what is not.",
        "V must be (n, 3) and F (m, 3) in the file, a row for each: transpose what is not.",
    ),
    "shape of V, of a mesh": Row(
        "V has {rows:,} rows and the mesh {vertices:,} vertices",
        "Only vertices may move; for another connectivity make a new mesh.",
    ),
    "shape of F": Row(
        "F has shape {shape}",
        "It must be (m, 3) with m at least 1.",
        "Export the file again: a row for each face, at least 1, with 3 columns.",
    ),
    "shape of F, polygons": Row(
        "F has shape {shape}",
        "It must be (m, 3) with m at least 1. Triangulate the polygons first.",
        "Export triangles, or polygons as .obj, .off or .ply, which are triangulated on reading.",
    ),
    "V and F swapped": Row(
        "V has the corners of faces, and F has coordinates",
        "Pass the vertices first: (V, F).",
        "Exchange V and F in the file.",
    ),
    "non-finite coordinate": Row(
        "a NaN or infinite coordinate in V",
        "Restore the coordinates; cdcp_igl.clean drops these vertices with their faces.",
        "Restore the coordinates; cdcp-igl map --clean drops these vertices with their faces.",
        subject=("vertex has", "vertices have"),
        kind="vertices",
        cleaned=True,
    ),
    "non-finite coordinate, of a map": Row(
        "a NaN or infinite coordinate in uv",
        "Restore the coordinates.",
        subject=("vertex has", "vertices have"),
        kind="vertices",
    ),
    "index out of range": Row(
        "an index outside 0..{last}",
        "Correct or drop them.",
        CORRECT,
        subject=("face has", "faces have"),
    ),
    "index out of range, from 1": Row(
        "an index outside 0..{last}",
        "The indices count from 1: pass F - 1.",
        "The indices count from 1: subtract 1 in the file.",
        subject=("face has", "faces have"),
    ),
    "fractional index": Row(
        "an index that is no integer",
        "F takes integers, the rows of V.",
        CORRECT,
        subject=("face has", "faces have"),
    ),
    # Faces
    "repeated corner": Row(
        "the same vertex at two corners",
        "Drop these faces, as cdcp_igl.clean does.",
        "cdcp-igl map --clean drops these faces.",
        subject=("face has", "faces have"),
        cleaned=True,
    ),
    "unreferenced vertex": Row(
        "to no face",
        "Drop them and renumber F, as cdcp_igl.clean does.",
        "cdcp-igl map --clean drops them.",
        subject=("vertex belongs", "vertices belong"),
        kind="vertices",
        cleaned=True,
    ),
    "duplicate face": Row(
        "the corners of another",
        "Drop these faces, as cdcp_igl.clean does.",
        "cdcp-igl map --clean drops these faces.",
        subject=("face repeats", "faces repeat"),
        cleaned=True,
    ),
    "degenerate face": Row(
        "no area to speak of",
        "Merge coinciding vertices, and collapse or flip the slivers; cdcp_igl.clean merges, and "
        "drops what is left of them.",
        "cdcp-igl map --clean merges coinciding vertices, and drops what is left of such faces.",
        subject=("face has", "faces have"),
        cleaned=True,
    ),
    # How faces hang together
    "non-manifold edge": Row(
        "on three or more faces",
        "Drop the surplus faces, or part the sheets that meet there: cdcp_igl.clean keeps the "
        "largest of them, cdcp_igl.surface_map maps them all.",
        "cdcp-igl map --clean keeps the largest of the sheets that meet there, cdcp-igl map --cut "
        "maps them all.",
        subject=("edge lies", "edges lie"),
        kind="edges",
        cleaned=True,
    ),
    "not orientable": Row(
        "The surface is one-sided, like a Möbius strip",
        "Cut it across with cdcp_igl.cut(V, F, path), or take faces out, until it has two sides.",
        "Cut it across, or take faces out, until it has two sides.",
    ),
    "inconsistent orientation": Row(
        "oriented against the others",
        "Reverse the corners of these faces, as cdcp_igl.clean and surface_map do.",
        "cdcp-igl map --clean reverses the corners of these faces, and so does cdcp-igl map --cut.",
        subject=("face is", "faces are"),
        cleaned=True,
    ),
    "several components": Row(
        "{parts:,} components, the largest with {largest:,} of {faces:,} faces",
        "cdcp_igl.clean keeps the largest, cdcp_igl.surface_map maps each of them.",
        "cdcp-igl map --clean keeps the largest, cdcp-igl map --cut maps each of them.",
        cleaned=True,
        cut=True,
    ),
    "several components, coinciding": Row(
        "{parts:,} components, the largest with {largest:,} of {faces:,} faces",
        "cdcp_igl.clean keeps the largest, cdcp_igl.surface_map maps each of them. "
        "Some vertices coincide: merging them, as clean does, may join the parts.",
        "cdcp-igl map --clean keeps the largest, cdcp-igl map --cut maps each of them. "
        "Some vertices coincide: merging them, as --clean does, may join the parts.",
        cleaned=True,
        cut=True,
    ),
    "non-manifold vertex": Row(
        "several fans of faces",
        "Split each into one copy a fan, as cdcp_igl.clean does.",
        "cdcp-igl map --clean splits each into one copy a fan.",
        subject=("vertex joins", "vertices join"),
        kind="vertices",
        cleaned=True,
    ),
    "closed surface": Row(
        "The surface has no boundary",
        "cdcp_igl.cut opens it, cdcp_igl.surface_map maps it as it is.",
        "cdcp-igl map --cut opens and maps it.",
        cut=True,
    ),
    "several boundary loops": Row(
        "{loops:,} boundary loops, the outer one with {outer:,} vertices",
        "cdcp_igl.clean fills the holes, cdcp_igl.cut joins the loops by cuts.",
        "cdcp-igl map --clean fills the holes, cdcp-igl map --cut joins the loops by cuts.",
        kind="vertices",
        cleaned=True,
        cut=True,
    ),
    "handle": Row(
        "The surface has genus {genus}, a disk has 0",
        "cdcp_igl.cut opens each handle, cdcp_igl.surface_map maps it as it is.",
        "cdcp-igl map --cut opens each handle, and maps it.",
        cut=True,
    ),
    # What was asked for
    "nothing left": Row(
        "{done}, and no face is left",
        "Restore the mesh.",
    ),
    "not an edge": Row(
        "{missing:,} of {steps:,} steps of the path are no edge between faces",
        "Go from vertex to vertex along edges that two faces share.",
        kind="edges",
    ),
    # Files
    "too few corners": Row(
        "fewer than three corners",
        "The file may be cut off: export it again, or drop these faces.",
        subject=("face has", "faces have"),
    ),
    "unreadable file": Row(
        "{reason}",
        "Name a file that may be read.",
    ),
    "unreadable file, a folder": Row(
        "{path!r} is a folder",
        "Name a file in it; cdcp_igl.batch maps all of them.",
        "Name a file in it; cdcp-igl batch maps all of them.",
    ),
    "unreadable file, of another type": Row(
        "{name!r} is of no known type; readable are {readable}",
        "Export it as one of these.",
    ),
    "unreadable file, no name": Row(
        "{name!r} is no name of a file: it holds a zero",
        "Name another file.",
    ),
    "unreadable file, a device": Row(
        "{name!r} is a device, a FIFO or a socket",
        "Copy it to a file first.",
    ),
    "unreadable file, damaged": Row(
        "{name!r} is not a readable {type} file: {reason}",
        "Export it again, or in another format.",
    ),
}
