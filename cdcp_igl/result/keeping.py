"""Maps that may keep lengths or areas rather than angles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Self

from ..arguments import typed
from ..io.given import tell
from ..plot.layout import Layout
from .made import ComplexMap
from .records import Kept


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class KeepingMap(ComplexMap):
    """A map of one mesh that may keep lengths or areas rather than angles."""

    kept: Kept | None = None

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
        from ..maps.keeping import continued  # a result makes no map

        made = continued(self, keep)
        tell(made, vars(self))
        return made

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
