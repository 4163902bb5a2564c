"""The records as tables, figures and findings read them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np
import pandas as pd

from cdcp_igl.arrays import Floats, Ints
from cdcp_igl.reference.case import OK

from .paper import row_of
from .record import OPENED, Record

FROM = 17_000  # vertices of the smallest model to which growth is fitted
NUMBERS = [
    *("mean", "sd", "max", "area_sd", "texels"),
    *("flips", "boundary_error", "seconds", "memory"),
]


class NotMeasured(Exception):
    """What a figure shows has not been measured; says by which command it would be."""


class Section:
    """The records of one command, the latest of each case.

    Parameters
    ----------
    records : iterable of Record
        In the order of measurement.

    Attributes
    ----------
    sizes : dict of str to int
        Vertices of all models, from small to large, with the paper's number where a model is
        not to be had.
    mapped : dict of str to int
        Of those that were mapped, or should have been.
    opened : set of str
        Of those that are no disks, see `Record.mesh`.
    family : dict of str to str
        "disk", "free" or "sphere" of each method that makes maps.
    maps : list of str
        These methods.
    medians : DataFrame
        Over the repeats, by model and method; NaN if one of them failed.
    """

    def __init__(self, records: Iterable[Record]) -> None:
        latest = {(r.model, r.case.method, r.repeat): r for r in records}
        self.records = list(latest.values())
        frame = pd.DataFrame([record.row() for record in self.records])
        cases = frame.groupby(["model", "method"], sort=False)
        self.medians = cases[NUMBERS].median()
        self.medians[cases["outcome"].agg(lambda outcomes: (outcomes != OK).any())] = np.nan
        self._least, self._greatest = cases[NUMBERS].min(), cases[NUMBERS].max()
        self._runs: dict[tuple[str, str], list[Record]] = {}
        for record in self.records:
            self._runs.setdefault((record.model, record.case.method), []).append(record)
        known = {r.model: r.vertices or _published_size(r.model) for r in self.records}
        self.sizes = dict(sorted(known.items(), key=lambda model: model[1]))
        self.opened = {r.model for r in self.records if r.mesh.endswith(OPENED)}
        maps = frame[frame["boundary"] != "none"]
        self.family = dict(zip(maps["method"], maps["boundary"], strict=True))
        self.maps = list(self.family)
        there = set(maps["model"][maps["vertices"] > 0])
        self.mapped = {model: n for model, n in self.sizes.items() if model in there}

    def methods(self, among: Iterable[str]) -> list[str]:
        """Those that were run."""
        run = set(self.medians.index.get_level_values("method"))
        return [method for method in among if method in run]

    def of(self, model: str, method: str) -> list[Record]:
        """All repeats."""
        return self._runs.get((model, method), [])

    def median(self, model: str, method: str, name: str = "seconds") -> float:
        """Median over the repeats, NaN if one of them failed or there is none."""
        return float(self.medians[name].get((model, method), np.nan))

    def everywhere(self, family: str) -> list[str]:
        """Methods of a family that were run on all surfaces on which one of it was."""
        of = [method for method in self.maps if self.family[method] == family]
        models = [model for model in self.mapped if any(self.of(model, method) for method in of)]
        return [method for method in of if all(self.of(model, method) for model in models)]

    def values(self, method: str, name: str) -> Floats:
        """Median over the repeats for each of `mapped`."""
        return self._by_model(self.medians, method, name)

    def spread(self, method: str, name: str) -> Floats:
        """(2, models), least and greatest over the repeats, of each of `mapped`."""
        ends = (self._least, self._greatest)
        return np.stack([self._by_model(end, method, name) for end in ends])

    def _by_model(self, table: pd.DataFrame, method: str, name: str) -> Floats:
        return table[name].reindex([(model, method) for model in self.mapped]).to_numpy(float)

    def failure(self, model: str, method: str) -> str:
        """Why there is no number; empty if there is one."""
        runs = self.of(model, method)
        return next((r.case.outcome for r in runs if not r.ok), "" if runs else "not run")

    def failed(self, method: str) -> list[str]:
        """Models on which the method was run and gave nothing."""
        return [m for m in self.mapped if self.of(m, method) and self.failure(m, method)]


class Measured:
    """What has been measured.

    Parameters
    ----------
    records : iterable of Record
    kept : callable
        ``kept(mesh)`` returns V (n, 3) and F (m, 3) of a digest, or None.
    map : callable
        ``map(record)`` returns uv (n, 2), or None where there is no valid map.

    Attributes
    ----------
    sections : dict of str to Section
    sizes : dict of str to int
        Vertices of each model, from small to large; without those that are not to be had, and
        those on which only growth was measured.
    """

    def __init__(
        self,
        records: Iterable[Record],
        kept: Callable[[str], tuple[Floats, Ints] | None] = lambda mesh: None,
        map: Callable[[Record], Floats | None] = lambda record: None,
    ) -> None:
        known = list(records)
        self.sections = {
            section: Section(record for record in known if record.section == section)
            for section in dict.fromkeys(record.section for record in known)
        }
        # A model may have changed between two sections: "tables" has the maps.
        known.sort(key=lambda record: record.section == "tables")
        sizes = {r.model: r.vertices for r in known if r.vertices and r.section != "growth"}
        self.sizes = dict(sorted(sizes.items(), key=lambda model: model[1]))
        self._meshes = {r.model: r.mesh for r in known if r.case.boundary != "sphere"}
        self._kept, self._map = kept, map

    def surface(self, model: str) -> tuple[Floats, Ints]:
        """V (n, 3) and F (m, 3) of the disk that was mapped; NotMeasured if it is not there."""
        surface = self._kept(self._meshes.get(model, ""))
        if surface is None:
            raise NotMeasured("the surface is not in the work folder any more")
        return surface

    def map(self, model: str, method: str) -> Floats | None:
        """(n, 2) map of the surface, None where there is none."""
        tables = self.sections.get("tables")
        runs = tables.of(model, method) if tables else []
        return next((self._map(run) for run in runs if run.ok and not run.repeat), None)

    def require(self, section: str, wanted: Sequence[str]) -> tuple[Section, list[str]]:
        """Return a section and which of the methods were run; NotMeasured if none was."""
        results = self.sections.get(section)
        there = results.methods(wanted) if results else []
        if not results or not there or not results.mapped:
            raise NotMeasured(f"not measured yet; run: python -m benchmarks {section}")
        return results, there


def growth(n: Floats, values: Floats) -> tuple[float, float]:
    """Fit values = c n^p by least squares, over models with `FROM` vertices or more.

    Returns
    -------
    p, c : float
        NaN if there are fewer than three such models.
    """
    used = np.isfinite(values) & (n >= FROM)
    if used.sum() < 3:
        return np.nan, np.nan
    p, log_c = np.polyfit(np.log(n[used]), np.log(values[used]), 1)
    return float(p), float(np.exp(log_c))


def _published_size(model: str) -> int:
    row = row_of(model)
    return row.vertices if row else 0
