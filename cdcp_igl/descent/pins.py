"""Vertices of a map with a free boundary are brought to their places, and the rest gives way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..arrays import Complex, Ints, coordinates, marked
from ..errors import SolverError
from ..surface.mesh import Mesh
from ..verdict.outline import certify_outline
from .descent import PULLS, Descent, Progress, pulled
from .energies import SymmetricDirichlet
from .scaffold import in_space, lowered_with_scaffold, with_scaffold


def pinned(mesh: Mesh, f: Complex, t: float, rows: Ints, goal: Complex) -> tuple[Complex, int]:
    """Bring `rows` of a map f (n,) to their places (k,) while the rest keeps t; count the steps.

    A map that keeps angles has the least further shear: at rest are its own faces, so that places
    where its vertices already lie change nothing. If some are not reached, at rest are the faces of
    the surface. Where the boundary overlaps itself then, vertices are pulled with a scaffold.
    Without success it is the map in which the farthest vertex is nearest to its place.
    """
    of_surface = SymmetricDirichlet.of(mesh, t)
    energies = [of_surface]
    if t == 0:
        at_rest = SymmetricDirichlet.of(Mesh(in_space(f), mesh.F, mesh.loop), t)
        energies.insert(0, replace(at_rest, weight=of_surface.weight))
    found, taken = list[Complex](), 0
    for energy in energies:
        descent = Descent(mesh, f, held=marked(len(f), rows))
        is_there, g = pulled(descent, energy, rows, goal), descent.f
        taken += descent.steps
        if is_there and not certify_outline(mesh, coordinates(g)).simple:
            g, steps = _pulled_with_scaffold(mesh, f, energy, rows, goal)
            taken += steps
        if np.array_equal(g[rows], goal):
            return g, taken
        found.append(g)
    return min(found, key=lambda g: float(abs(g[rows] - goal).max())), taken


def _pulled_with_scaffold(
    mesh: Mesh, f: Complex, energy: SymmetricDirichlet, rows: Ints, goal: Complex
) -> tuple[Complex, int]:
    """Bring `rows` as near to their places as no face flips, the boundary simple; count steps."""
    n, taken, progress = len(f), 0, Progress()
    try:
        for _ in range(PULLS):
            if np.array_equal(f[rows], goal):
                f, steps = lowered_with_scaffold(mesh, f, energy, rows)
                return f, taken + steps
            descent, joined = with_scaffold(mesh, f, energy, rows)
            goes_on = descent.pull(joined, rows, goal)
            f, taken = descent.f[:n], taken + descent.steps
            if not (goes_on and progress.made(float(abs(f[rows] - goal).max()))):
                break
    except SolverError:  # faces are all but flipped
        pass
    return f, taken
