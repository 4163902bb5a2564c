"""Maps that may keep lengths or areas rather than angles."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, ClassVar, Self, TypeVar

import numpy as np

from ..arguments import typed
from ..arrays import Bools, Complex
from ..descent.targets import Target
from ..descent.tradeoff import Tradeoff, measured
from ..errors import MapError
from ..io.given import tell
from ..options import Keep
from ..phases import Phases
from ..plot.layout import Layout
from ..records import Kept
from ..verdict.conformality import NOT_ASKED
from .base import valid_map
from .made import ComplexMap


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class KeepingMap(ComplexMap):
    """A map of one mesh that may keep lengths or areas rather than angles."""

    kept: Kept | None = None

    _target: ClassVar[Target]

    @typed
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

        def turned(f: Complex) -> Complex:
            moment = np.vdot(f, self._f)
            return f * (moment / abs(moment) if moment else 1)

        made = kept_map(self, asked, turned, Phases())
        tell(made, vars(self))
        return made

    @abstractmethod
    def _moved(self, f: Complex, phase: Phases) -> Self:
        """Return this map moved to f (n,): repaired, certified and judged."""

    @property
    def _held(self) -> Bools | None:
        """(n,) which vertices stay where they are; None if all may move."""
        return None

    def _kept_steps(self, keep: Sequence[float | str]) -> dict[str, Layout]:
        maps = [self]
        for asked in keep:
            maps.append(maps[-1].continued(keep=asked))
        return {made.kept.name if made.kept else "angles": made._layout() for made in maps}

    def _kept_pairs(self) -> list[tuple[str, str]]:
        return [("keeps", str(self.kept))] if self.kept else []

    def _kept_details(self) -> dict[str, Any]:
        return {"kept": self.kept and asdict(self.kept)}

    def _key_figure(self) -> str:
        if self.kept is None:
            return super()._key_figure()
        return f"keeps {self.kept.name}, symmetric Dirichlet energy {self.kept.dirichlet:.4g}"


Map = TypeVar("Map", bound=KeepingMap)


def kept_map(made: Map, asked: Keep, placed: Callable[[Complex], Complex], phase: Phases) -> Map:
    """Let a valid map keep what is asked for; `placed` turns it, about its centroid if free.

    Vertices that are pinned stay. MapError if no map is certified, or none holds the bound.
    """
    descent = Tradeoff(made.mesh, made._target, made._held)
    f, t = made._f, made.kept.keep if made.kept else 0.0
    with phase("refine"):
        if asked.texels == np.inf:
            f, t = descent.at(asked.t, f, near=t > 0), asked.t
        else:
            f, t = descent.least(asked.texels, f, t)
    f = f if descent.held is not None else placed(f)
    made = replace(made._moved(f, phase), conformality=NOT_ASKED)
    valid_map(made, "", "Keep less of it, or cut the surface.")
    kept = measured(made.mesh, made._f, t, made._target, descent.steps)
    made = replace(made, kept=kept)
    if kept.texels > asked.texels:
        raise MapError(
            f"Texel density is within {kept.texels:.3g} at keep={t}, not {asked.texels:g}. Cut "
            "the surface where it is long or branches (cdcp_igl.cut)",
            made,
        )
    return made
