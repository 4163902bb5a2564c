"""What keeps a triangle mesh from being a disk, and what mends it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..arrays import Floats, Ints
from ..errors import Defect, counted
from .topology import Topology, duplicate_faces, outer_loop

__all__ = [
    "CUT",
    "MENDED",
    "degenerate_defect",
    "degenerate_faces",
    "duplicate_defect",
    "one_sided_defect",
    "topological_defects",
    "turned_defect",
]


# A face is degenerate when area / longest edge^2 is below this: a relative measure, so
# that metres and microns are judged alike. The worst faces of real scans are near 1e-5;
# cotangents above 1e10 would leave the other faces at a vertex too few digits.
DEGENERATE = 1e-10

# What `clean` mends, and what it leaves for `cut` to open.
MENDED = frozenset(
    {
        "non-finite coordinate",
        "repeated corner",
        "unreferenced vertex",
        "duplicate face",
        "non-manifold edge",
        "inconsistent orientation",
        "several components",
        "non-manifold vertex",
        "several boundary loops",
        "degenerate face",
    }
)
CUT = frozenset({"closed surface", "handle", "several boundary loops", "several components"})


def topological_defects(surface: Topology, V: Floats) -> tuple[Defect, ...]:
    """Everything that keeps a surface from being a disk, the most fundamental defect first.

    Where an edge has three faces or more, or a vertex several fans, what comes after is
    not looked at. V (n, 3) tells which loop is the outer one; its rows may be non-finite.
    """
    return tuple(_topological_defects(surface, V))


def _topological_defects(surface: Topology, V: Floats) -> Iterator[Defect]:
    yield from _faces_and_edges(surface)
    if surface.singular.any():
        return
    yield from _sides_and_parts(surface, V)
    if len(surface.pinched):
        pinched = surface.pinched
        yield Defect(
            "non-manifold vertex",
            f"{counted(len(pinched), 'vertex joins', 'vertices join')} several fans of faces",
            "Split each into one copy a fan, as cdcp_igl.clean does.",
            "vertices",
            pinched,
        )
        return
    yield from _boundary_and_handles(surface, V)


def _faces_and_edges(surface: Topology) -> Iterator[Defect]:
    if not surface.used.all():
        unused = np.flatnonzero(~surface.used)
        yield Defect(
            "unreferenced vertex",
            f"{counted(len(unused), 'vertex belongs', 'vertices belong')} to no face",
            "Drop them and renumber F, as cdcp_igl.clean does.",
            "vertices",
            unused,
        )
    singular = surface.singular
    if singular.any() or len(surface.border) == 0:  # the copy of a face leaves no edge with one
        duplicates = duplicate_faces(surface.F)
        if len(duplicates):
            yield duplicate_defect(duplicates)
    if singular.any():
        ends = surface.edges.ends(singular)
        yield Defect(
            "non-manifold edge",
            f"{counted(len(ends), 'edge lies', 'edges lie')} on three or more faces",
            "Drop the surplus faces, or part the sheets that meet there: cdcp_igl.clean keeps the "
            "largest of them, cdcp_igl.surface_map maps them all.",
            "edges",
            ends,
        )


def _sides_and_parts(surface: Topology, V: Floats) -> Iterator[Defect]:
    if surface.against is None:
        yield one_sided_defect()
    elif len(surface.against):
        yield turned_defect(surface.against)
    n_parts, part = surface.components
    if n_parts > 1:
        sizes = np.bincount(part)
        finite = V[np.isfinite(V).all(axis=1)]
        coincide = len(np.unique(finite, axis=0)) < len(finite)
        yield Defect(
            "several components",
            f"{n_parts:,} components, the largest with {sizes.max():,} of {len(part):,} faces",
            "cdcp_igl.clean keeps the largest, cdcp_igl.surface_map maps each of them."
            + (
                " Some vertices coincide: merging them, as clean does, may join the parts."
                * coincide
            ),
            "faces",
            np.flatnonzero(part != sizes.argmax()),
        )


def _boundary_and_handles(surface: Topology, V: Floats) -> Iterator[Defect]:
    if len(surface.border) == 0:
        yield Defect(
            "closed surface",
            "The surface has no boundary",
            "cdcp_igl.cut opens it, cdcp_igl.surface_map maps it as it is (map --cut).",
        )
    if len(surface.loops) > surface.components[0]:
        outer = outer_loop(V, surface.loops)
        yield Defect(
            "several boundary loops",
            f"{len(surface.loops):,} boundary loops, the outer one with {len(outer):,} vertices",
            "cdcp_igl.clean fills the holes (map --clean), cdcp_igl.cut joins the loops by cuts "
            "(map --cut).",
            "vertices",
            np.concatenate([loop for loop in surface.loops if loop is not outer]),
        )
    if surface.genus:
        yield Defect(
            "handle",
            f"The surface has genus {surface.genus}, a disk has 0",
            "cdcp_igl.cut opens each handle, cdcp_igl.surface_map maps it as it is (map --cut).",
        )


def duplicate_defect(faces: Ints) -> Defect:
    """Faces that repeat the corners of another, as a defect."""
    return Defect(
        "duplicate face",
        f"{counted(len(faces), 'face repeats', 'faces repeat')} the corners of another",
        "Drop these faces, as cdcp_igl.clean does.",
        "faces",
        faces,
    )


def turned_defect(faces: Ints) -> Defect:
    """Faces that are turned over, as a defect."""
    return Defect(
        "inconsistent orientation",
        f"{counted(len(faces), 'face is', 'faces are')} oriented against the others",
        "Reverse the corners of these faces, as cdcp_igl.clean and surface_map do.",
        "faces",
        faces,
    )


def one_sided_defect(faces: Ints | None = None) -> Defect:
    """One-sidedness, as a defect; of the components that have these faces, or of all."""
    return Defect(
        "not orientable",
        "The surface is one-sided, like a Möbius strip",
        "Cut it across with cdcp_igl.cut(V, F, path), or take faces out, until it has two sides.",
        "faces",
        np.empty(0, np.int64) if faces is None else faces,
    )


def degenerate_defect(cotangents: Floats) -> Defect | None:
    """Faces without area, as a defect; None if there are none."""
    bad = degenerate_faces(cotangents)
    if len(bad) == 0:
        return None
    return Defect(
        "degenerate face",
        f"{counted(len(bad), 'face has', 'faces have')} no area to speak of",
        "Merge coinciding vertices, and collapse or flip the slivers; cdcp_igl.clean merges, and "
        "drops what is left of them.",
        "faces",
        bad,
    )


def degenerate_faces(cotangents: Floats) -> Ints:
    """Faces without area, by the square of their longest edge."""
    # The cotangents at the ends of an edge add up to its squared length by twice the area.
    i, j, k = cotangents.T
    with np.errstate(invalid="ignore"):  # of faces without any area
        longest_squared = np.maximum(np.maximum(i + j, j + k), k + i)
    return np.flatnonzero(~(longest_squared < 1 / (2 * DEGENERATE)))
