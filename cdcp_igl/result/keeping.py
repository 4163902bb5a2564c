"""A map that keeps lengths or areas, by as much as is asked for, and what is said of it."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np

from ..arrays import Bools, Complex, coordinates
from ..descent.descent import keeping
from ..descent.energies import SymmetricDirichlet, resized
from ..descent.scaffold import keeping_apart
from ..descent.targets import Disk, Outline, Target
from ..errors import MapError
from ..options import KEPT, MOST, Keep
from ..phases import Phases
from ..plot.layout import Layout
from ..rescue.boundary import arc_length_map
from ..rescue.means import embedding
from ..surface.mesh import Mesh
from ..surface.triangles import flipped_faces
from ..verdict.conformality import NOT_ASKED
from ..verdict.distortion import DENSITIES, weighted_quantiles
from ..verdict.outline import certify_outline
from .base import valid_map
from .making import MadeMap

# Where a bound on texel density is looked for: one after the other, then halves of what is between.
TRIED, HALVINGS = (0.02, 0.1, 0.3, 0.5, 0.7, 0.9, MOST), 3


@dataclass(frozen=True)
class Kept:
    """What a map keeps, and how well; on the disk, of faces that are not inscribed in the circle.

    Attributes
    ----------
    keep : float
        From 0, angles, over 1/2, lengths, to 0.99, areas.
    dirichlet : float
        The symmetric Dirichlet energy by 4, at the size where it is least: 1 for an isometry.
    texels : float
        Density of texels: how many times longer lengths are in the plane where this is so for 95
        percent of the area at most, by where it is for 5 percent. From the areas of faces.
    stretch : float
        How many times a face is longer one way than the other, at most.
    steps : int
        Steps of Newton's method.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.spherical_cap(10)
    >>> cdcp_igl.free_map(V, F, keep="lengths").kept.name
    'lengths (0.5)'
    """

    keep: float
    dirichlet: float
    texels: float
    stretch: float
    steps: int

    @classmethod
    def of(cls, mesh: Mesh, f: Complex, t: float, target: Target, steps: int) -> Kept:
        """Measure a map (n,) without flipped faces."""
        s, q, _ = SymmetricDirichlet.of(mesh, t).stretch(f, slice(None))
        free = np.ones(len(s), dtype=bool)
        if isinstance(target, Disk) and len(mesh.inscribed) < len(s):
            free[mesh.inscribed] = False
        s, q, area = s[free], q[free], SymmetricDirichlet.of(mesh, t).area[free]
        shear = area * np.cosh(s) / area.sum()
        low, high = weighted_quantiles(q / 2, area, DENSITIES)
        dirichlet = np.sqrt((shear @ np.exp(q)) * (shear @ np.exp(-q)))
        return cls(t, float(dirichlet), float(np.exp(high - low)), float(np.exp(s.max())), steps)

    @property
    def name(self) -> str:
        """What is kept, in a word or two."""
        names = {t: name for name, t in KEPT.items()}
        return f"{names[self.keep]} ({self.keep:g})" if self.keep in names else f"{self.keep:.3g}"

    def __str__(self) -> str:
        return (
            f"{self.name}: symmetric Dirichlet energy {self.dirichlet:.4g}, texel density within "
            f"{self.texels:.3g}, stretch at most {self.stretch:.3g}, {self.steps} steps"
        )


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class KeepingMap(MadeMap):
    """A map of one mesh that may keep lengths or areas rather than angles."""

    kept: Kept | None = None

    _target: ClassVar[Target]

    def continued(self, *, keep: float | str) -> Self:
        """Go on to a map that keeps something else.

        From one number to the next it takes a third of the time that it takes from angles.

        Parameters
        ----------
        keep : {"lengths", "areas"}, float or str
            As of the function that made the map; more than 0.

        Returns
        -------
        Of the same type; this map stays as it is. It lies as this one does, as far as it can.

        Raises
        ------
        ValueError
            If `keep` is none of that, or is angles, which the map as it is made keeps.
        MapError
            If no map is certified, or none holds the bound.

        Examples
        --------
        >>> import cdcp_igl
        >>> V, F, _ = cdcp_igl.datasets.spherical_cap(10)
        >>> lengths = cdcp_igl.free_map(V, F, keep="lengths")
        >>> areas = lengths.continued(keep=0.9)
        >>> bool(areas.kept.texels < lengths.kept.texels)
        True
        """
        asked = Keep.of(keep)
        if not asked:
            raise ValueError(f"keep={keep!r}: the map that keeps angles is that without keep")
        before = self._plane_map()

        def turned(f: Complex) -> Complex:
            moment = np.vdot(f, before)
            return f * (moment / abs(moment) if moment else 1)

        return self.keeping(asked, turned, Phases())

    def keeping(self, asked: Keep, placed: Callable[[Complex], Complex], phase: Phases) -> Self:
        """Let a valid map keep what is asked for; `placed` turns it, about its centroid if free."""
        mesh, target, held = self.mesh, self._target, self._held
        f, t, steps = self._plane_map(), self.kept.keep if self.kept else 0.0, 0

        def measured(g: Complex, t: float) -> Kept:
            return Kept.of(mesh, g, t, target, steps)

        def at(t: float, f: Complex, near: bool) -> Complex:
            nonlocal steps
            begins = not near and held is None
            start = self._start(SymmetricDirichlet.of(mesh, t, target=target), f) if begins else f
            descent = keeping(mesh, start, t, target, near=near, held=held)
            g, steps = descent.f, steps + descent.steps
            may_overlap = isinstance(target, Outline) and held is None
            if may_overlap and not certify_outline(mesh, coordinates(g)).simple:
                g, more = keeping_apart(mesh, start, t, near=near)
                steps += more
            return g

        with phase("refine"):
            if asked.texels == np.inf:
                f, t = at(asked.t, f, t > 0), asked.t
            else:
                f, t = _least(asked.texels, f, t, at, lambda g: measured(g, t).texels)
        made = self.moved_to(f if held is not None else placed(f), phase)
        valid_map(replace(made, conformality=NOT_ASKED), "", "Keep less of it, or cut the surface.")
        kept = measured(made._plane_map(), t)
        made = replace(made, kept=kept, conformality=NOT_ASKED)
        if kept.texels > asked.texels:
            raise MapError(
                f"Texel density is within {kept.texels:.3g} at keep={t}, not {asked.texels:g}. Cut "
                "the surface where it is long or branches (cdcp_igl.cut)",
                made,
            )
        return made

    @property
    def _held(self) -> Bools | None:
        """(n,) which vertices stay where they are; None if all may move."""
        return None

    def _kept_steps(self, keep: Sequence[float | str]) -> dict[str, Layout]:
        maps = [self]
        for asked in keep:
            maps.append(maps[-1].continued(keep=asked))
        return {made.kept.name if made.kept else "angles": made._layout() for made in maps}

    def _start(self, energy: SymmetricDirichlet, f: Complex) -> Complex:
        """Return f, which keeps angles, or an embedding: that from which to go down.

        Parts that a conformal map crowds together, along seams above all, are hard to draw apart.
        On the disk they always are; else an embedding costs more than it gives, as a rule.
        """
        on_disk = isinstance(self._target, Disk)
        start = f if on_disk else resized(energy, f)
        if not (on_disk or energy.is_crowded(start)):
            return start
        even = np.zeros_like(f)
        even[self.mesh.loop] = arc_length_map(self.mesh)
        even, _ = embedding(self.mesh, even, on_disk=True)
        if len(flipped_faces(even, self.mesh.F)[0]):
            return start
        even = even if on_disk else resized(energy, even)
        return min(start, even, key=lambda g: np.nan_to_num(energy.value(g), nan=np.inf))

    @abstractmethod
    def _plane_map(self) -> Complex:
        """Return the map (n,) in the unit of ``mesh.V``, or on the disk."""

    @abstractmethod
    def moved_to(self, f: Complex, phase: Phases, known: float = 0.0) -> Self:
        """Return the map f (n,) of this surface, repaired, certified and judged; see `judge`."""

    def _kept_pairs(self) -> list[tuple[str, str]]:
        return [("keeps", str(self.kept))] if self.kept else []

    def _kept_details(self) -> dict[str, Any]:
        return {"kept": self.kept and asdict(self.kept)}

    def _key_figure(self) -> str:
        if self.kept is None:
            return super()._key_figure()
        return f"keeps {self.kept.name}, symmetric Dirichlet energy {self.kept.dirichlet:.4g}"


def _least(
    bound: float,
    f: Complex,
    t: float,
    at: Callable[[float, Complex, bool], Complex],
    texels: Callable[[Complex], float],
) -> tuple[Complex, float]:
    """Find the least t, and a map (n,), at which the density of texels holds a bound.

    `at` goes from a map to one at another t. Where none holds it, the last.
    """
    if t == 0 and texels(f) <= bound:
        return f, t
    low, near = 0.0, t > 0
    for t in TRIED:
        f, near = at(t, f, near), True
        if texels(f) <= bound:
            break
        low = t
    else:
        return f, t
    for _ in range(HALVINGS):
        between = (low + t) / 2
        g = at(between, f, near)
        if texels(g) <= bound:
            f, t = g, between
        else:
            low = between
    return f, t
