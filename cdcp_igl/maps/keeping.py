"""Maps that keep lengths or areas, by as much as is asked for, from maps that keep angles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from ..arrays import Bools, Complex, coordinates, marked
from ..errors import MapError
from ..options import MOST, Keep
from ..phases import Phases
from ..refine.apart import kept_apart
from ..refine.balance import Energy, balanced, resized
from ..refine.targets import DISK, PLANE, Target
from ..result.base import valid_map
from ..result.disk_map import DiskMap
from ..result.free_map import FreeMap
from ..result.keeping import KeepingMap
from ..result.records import Kept
from ..starts.boundary import arc_length_map
from ..starts.tutte import tutte_embedding
from ..surface.mesh import Mesh
from ..surface.triangles import flipped_faces
from ..verdict.conformality import NOT_ASKED
from ..verdict.distortion import DENSITIES, weighted_quantiles
from ..verdict.outline import certify_outline

# Where a bound on texel density is looked for: one after the other, then halves of what is between.
TRIED, HALVINGS = (0.02, 0.1, 0.3, 0.5, 0.7, 0.9, MOST), 3

Map = TypeVar("Map", bound=KeepingMap)


def continued(made: Map, keep: float | str) -> Map:
    """Do what `KeepingMap.continued` does."""
    asked = Keep.of(keep)
    if not asked:
        raise ValueError(f"keep={keep!r}: the map that keeps angles is that without keep")

    def turned(f: Complex) -> Complex:
        moment = np.vdot(f, made._f)
        return f * (moment / abs(moment) if moment else 1)

    return keeping(made, asked, turned, Phases())


def keeping(made: Map, asked: Keep, placed: Callable[[Complex], Complex], phase: Phases) -> Map:
    """Let a valid map keep what is asked for; `placed` turns it, about its centroid if free.

    Vertices that are pinned stay. MapError if no map is certified, or none holds the bound.
    """
    descent = _Keeping(made)
    f, t = made._f, made.kept.keep if made.kept else 0.0
    with phase("refine"):
        if asked.texels == np.inf:
            f, t = descent.at(asked.t, f, near=t > 0), asked.t
        else:
            f, t = descent.least(asked.texels, f, t)
    f = f if descent.held is not None else placed(f)
    made = replace(_moved(made, f, phase), conformality=NOT_ASKED)
    valid_map(made, "", "Keep less of it, or cut the surface.")
    kept = measured(made.mesh, made._f, t, descent.target, descent.steps)
    made = replace(made, kept=kept)
    if kept.texels > asked.texels:
        raise MapError(
            f"Texel density is within {kept.texels:.3g} at keep={t}, not {asked.texels:g}. Cut "
            "the surface where it is long or branches (cdcp_igl.cut)",
            made,
        )
    return made


def _moved(made: Map, f: Complex, phase: Phases) -> Map:
    """Return a map moved to f (n,): repaired, certified and judged."""
    from .disk import moved_on_disk  # which needs this module
    from .free import moved_in_plane

    moved: Any = moved_on_disk if isinstance(made, DiskMap) else moved_in_plane
    return moved(made, f, phase)


def target_of(made: KeepingMap) -> Target:
    """Return what a map is onto."""
    return DISK if isinstance(made, DiskMap) else PLANE


def measured(mesh: Mesh, f: Complex, t: float, target: Target, steps: int) -> Kept:
    """Measure what a map (n,) without flipped faces keeps."""
    energy = Energy.of(mesh, t)
    s, q, _ = energy.stretch(f, slice(None))
    free = np.ones(len(s), dtype=bool)
    if target is DISK and len(mesh.inscribed) < len(s):
        free[mesh.inscribed] = False
    s, q, area = s[free], q[free], energy.area[free]
    shear = area * np.cosh(s) / area.sum()
    low, high = weighted_quantiles(q / 2, area, DENSITIES)
    dirichlet = np.sqrt((shear @ np.exp(q)) * (shear @ np.exp(-q)))
    return Kept(t, float(dirichlet), float(np.exp(high - low)), float(np.exp(s.max())), steps)


class _Keeping:
    """The descent of one map from t to t; it counts its steps.

    Attributes
    ----------
    held : (n,) bool or None
        Vertices that stay.
    steps : int
        Steps of Newton's method so far.
    """

    def __init__(self, made: KeepingMap) -> None:
        self.mesh, self.target, self.steps = made.mesh, target_of(made), 0
        self.held: Bools | None = None
        if isinstance(made, FreeMap) and len(made.pins):
            self.held = marked(len(made.mesh.V), made.pins)

    def at(self, t: float, f: Complex, *, near: bool) -> Complex:
        """Go down to the map that keeps t, from a map f (n,), which may be near it."""
        mesh, target, held = self.mesh, self.target, self.held
        start = f if near or held is not None else self._start(Energy.of(mesh, t, target=target), f)
        newton = balanced(mesh, start, t, target, near=near, held=held)
        g, self.steps = newton.f, self.steps + newton.steps
        may_overlap = target is PLANE and held is None
        if may_overlap and not certify_outline(mesh, coordinates(g)).simple:
            g, steps = kept_apart(mesh, start, t, near=near)
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

    def _start(self, energy: Energy, f: Complex) -> Complex:
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
