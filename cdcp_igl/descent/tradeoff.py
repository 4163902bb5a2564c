"""What a map keeps, between angles, lengths and areas: measured, and found by descent."""

from __future__ import annotations

import numpy as np

from ..arrays import Bools, Complex, coordinates
from ..options import MOST
from ..records import Kept
from ..starts.boundary import arc_length_map
from ..starts.tutte import tutte_embedding
from ..surface.mesh import Mesh
from ..surface.triangles import flipped_faces
from ..verdict.distortion import DENSITIES, weighted_quantiles
from ..verdict.outline import certify_outline
from .descent import keeping
from .energies import SymmetricDirichlet, resized
from .scaffold import keeping_apart
from .targets import DISK, PLANE, Target

# Where a bound on texel density is looked for: one after the other, then halves of what is between.
TRIED, HALVINGS = (0.02, 0.1, 0.3, 0.5, 0.7, 0.9, MOST), 3


def measured(mesh: Mesh, f: Complex, t: float, target: Target, steps: int) -> Kept:
    """Measure what a map (n,) without flipped faces keeps."""
    energy = SymmetricDirichlet.of(mesh, t)
    s, q, _ = energy.stretch(f, slice(None))
    free = np.ones(len(s), dtype=bool)
    if target is DISK and len(mesh.inscribed) < len(s):
        free[mesh.inscribed] = False
    s, q, area = s[free], q[free], energy.area[free]
    shear = area * np.cosh(s) / area.sum()
    low, high = weighted_quantiles(q / 2, area, DENSITIES)
    dirichlet = np.sqrt((shear @ np.exp(q)) * (shear @ np.exp(-q)))
    return Kept(t, float(dirichlet), float(np.exp(high - low)), float(np.exp(s.max())), steps)


class Tradeoff:
    """Maps of a mesh onto a target that keep one t after the other; `held` vertices (n,) stay.

    Attributes
    ----------
    steps : int
        Steps of descent so far.
    """

    def __init__(self, mesh: Mesh, target: Target, held: Bools | None) -> None:
        self.mesh, self.target, self.held, self.steps = mesh, target, held, 0

    def at(self, t: float, f: Complex, *, near: bool) -> Complex:
        """Go down to the map that keeps t, from a map f (n,), which may be near it."""
        mesh, target, held = self.mesh, self.target, self.held
        energy = SymmetricDirichlet.of(mesh, t, target=target)
        start = f if near or held is not None else self._start(energy, f)
        descent = keeping(mesh, start, t, target, near=near, held=held)
        g, self.steps = descent.f, self.steps + descent.steps
        may_overlap = target is PLANE and held is None
        if may_overlap and not certify_outline(mesh, coordinates(g)).simple:
            g, steps = keeping_apart(mesh, start, t, near=near)
            self.steps += steps
        return g

    def least(self, bound: float, f: Complex, t: float) -> tuple[Complex, float]:
        """Find the least t, and its map (n,), at which the density of texels holds a bound.

        Where none holds it, the last. The map f keeps t.
        """

        def holds(f: Complex, t: float) -> bool:
            return measured(self.mesh, f, t, self.target, 0).texels <= bound

        if t == 0 and holds(f, t):
            return f, t
        low, near = 0.0, t > 0
        for t in TRIED:
            f, near = self.at(t, f, near=near), True
            if holds(f, t):
                break
            low = t
        else:
            return f, t
        for _ in range(HALVINGS):
            between = (low + t) / 2
            g = self.at(between, f, near=near)
            if holds(g, between):
                f, t = g, between
            else:
                low = between
        return f, t

    def _start(self, energy: SymmetricDirichlet, f: Complex) -> Complex:
        """Return f, which keeps angles, or a Tutte embedding if that is lower.

        Parts that a conformal map crowds together, along seams above all, are hard to draw apart.
        On the disk they always are; else an embedding costs more than it gives, as a rule.
        """
        mesh, on_disk = self.mesh, self.target is DISK
        start = f if on_disk else resized(energy, f)
        if not (on_disk or energy.is_crowded(start)):
            return start
        even = np.zeros_like(f)
        even[mesh.loop] = arc_length_map(mesh)
        even, _ = tutte_embedding(mesh, even, on_disk=True)
        if len(flipped_faces(even, mesh.F)[0]):
            return start
        even = even if on_disk else resized(energy, even)
        return min(start, even, key=lambda g: np.nan_to_num(energy.value(g), nan=np.inf))
