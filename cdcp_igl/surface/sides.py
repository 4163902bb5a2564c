"""The four sides of a disk with four corners."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Complex, Ints
from ..errors import counted, spell
from .mesh import DiskMesh

__all__ = ["boundary_sides", "is_monotone", "refuse_chords"]


def boundary_sides(mesh: DiskMesh, corners: ArrayLike) -> list[Ints]:
    """Split the boundary loop: the vertices of each side with its corners, in order."""
    chosen = np.asarray(corners)
    if chosen.shape != (4,) or chosen.dtype.kind not in "iu":
        raise ValueError(f"corners must be four vertices, not {corners!r}")
    place, nB = mesh.place, len(mesh.loop)
    if not ((chosen >= 0) & (chosen < len(place))).all() or (place[chosen] < 0).any():
        raise ValueError(f"corners={chosen.tolist()} must be boundary vertices")
    steps = (np.roll(place[chosen], -1) - place[chosen]) % nB
    if (steps == 0).any() or steps.sum() != nB:
        order = mesh.loop[np.sort(place[chosen])].tolist()
        raise ValueError(
            f"corners={chosen.tolist()} must be four vertices in the order of the boundary, "
            f"the surface on the left, which is {order}"
        )
    return [
        mesh.loop[(place[corner] + np.arange(step + 1)) % nB]
        for corner, step in zip(chosen, steps, strict=True)
    ]


def refuse_chords(mesh: DiskMesh, sides: list[Ints]) -> None:
    """Raise ValueError for edges inside that join two vertices of one side."""
    for number, side in enumerate(sides, 1):
        on_side = np.zeros(len(mesh.V), dtype=bool)
        on_side[side] = True
        chords = mesh.edges.ends(mesh.edges.chords(on_side))
        if len(chords):
            found = counted(len(chords), "edge inside joins", "edges inside join")
            raise ValueError(
                f"{found} two vertices of side {number}, so that the faces cut off would have no "
                f"area in a rectangle: {spell(chords)}. Choose a corner among these faces, or "
                "split the edges."
            )


def is_monotone(sides: list[Ints], f: Complex) -> bool:
    """Whether each side is run through forwards, no two vertices in one place."""
    bottom, right, top, left = sides
    return bool(
        (np.diff(f.real[bottom]) > 0).all()
        and (np.diff(f.imag[right]) > 0).all()
        and (np.diff(f.real[top]) < 0).all()
        and (np.diff(f.imag[left]) < 0).all()
    )
