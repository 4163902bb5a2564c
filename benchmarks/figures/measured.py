"""The records as the figures read them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from cdcp_igl.arrays import Floats, Ints

from ..report import Results
from ..store import Record

__all__ = ["Measured", "NotMeasured"]


class NotMeasured(Exception):
    """What a figure shows has not been measured; says by which command it would be."""


class Measured:
    """What has been measured.

    Parameters
    ----------
    records : iterable of Record
    surface : callable
        ``surface(model)`` returns V (n, 3) and F (m, 3).
    map : callable
        ``map(model, method)`` returns uv (n, 2), or None where there is no valid map.

    Attributes
    ----------
    sections : dict of str to Results
    sizes : dict of str to int
        Vertices of each model, from small to large; without those that are not to be had.
    """

    def __init__(
        self,
        records: Iterable[Record],
        surface: Callable[[str], tuple[Floats, Ints]],
        map: Callable[[str, str], Floats | None],
    ) -> None:
        known = list(records)
        self.sections = {
            section: Results(known, section)
            for section in dict.fromkeys(record.section for record in known)
        }
        sizes = {record.model: record.vertices for record in known}
        self.sizes = {model: n for model, n in sorted(sizes.items(), key=lambda s: s[1]) if n}
        self.surface, self.map = surface, map

    def models(self, section: str, method: str | None = None) -> dict[str, int]:
        """Models of a section with maps, and their sizes; or those on which a method was run."""
        records = self.sections[section].records
        run = {r.model for r in records if (r.method == method if method else r.boundary != "none")}
        return {model: n for model, n in self.sizes.items() if model in run}

    def require(self, section: str, wanted: Sequence[str]) -> list[str]:
        """Which of the methods were run in a section; NotMeasured if none was."""
        results = self.sections.get(section)
        there = results.methods(wanted) if results else []
        if not there or not self.models(section):
            raise NotMeasured(f"not measured yet; run: python -m benchmarks {section}")
        return there

    def values(self, section: str, method: str, name: str) -> Floats:
        """Median over repeats for each model of the section; NaN where there is none."""
        results = self.sections[section]
        return np.array([results.median(model, method, name) for model in self.models(section)])

    def spread(self, section: str, method: str, name: str) -> Floats:
        """(2, models), least and greatest over repeats; NaN where one failed or there is none."""
        of = self.sections[section].of
        repeats = [[getattr(r, name) for r in of(m, method)] for m in self.models(section)]
        values = [runs or [np.nan] for runs in repeats]
        return np.array([[np.min(runs), np.max(runs)] for runs in values]).T

    def failed(self, section: str, method: str) -> list[str]:
        """Models of the section on which the method was run and gave nothing."""
        failure = self.sections[section].failure
        return [model for model in self.models(section, method) if failure(model, method)]
