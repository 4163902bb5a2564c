"""Statistics over many surfaces: how often, how good, how fast, and whether that is chance."""

from __future__ import annotations

from dataclasses import dataclass
from operator import itemgetter

import numpy as np
import pandas as pd

from cdcp_igl.arrays import Floats

from .results import Section

QUANTITIES = ("mean", "sd", "area_sd", "texels", "seconds", "memory")
TIE = 1e-6  # relative difference below which two numbers differ by rounding only


def summary(results: Section) -> pd.DataFrame:
    """Sum up each method over the surfaces.

    Returns
    -------
    DataFrame
        One row a method: ``surfaces`` on which it was run, the shares ``mapped`` and
        ``unflipped``, and for each of `QUANTITIES` a column for each quartile,
        ``"mean 0.25"``, ``"mean 0.5"`` and so on, over the surfaces that it mapped.
    """
    rows: dict[str, dict[str, float]] = {}
    for method in results.maps:
        run = [model for model in results.mapped if results.of(model, method)]
        # Areas are infinitely uneven where a face has none; files have no infinite numbers.
        there = results.medians.reindex([(model, method) for model in run]).replace(np.inf, np.nan)
        rows[method] = {
            "surfaces": len(run),
            "mapped": there["mean"].notna().mean(),
            "unflipped": (there["flips"] == 0).mean(),
            **{
                f"{name} {q:g}": value
                for name in QUANTITIES
                for q, value in there[name].quantile([0.25, 0.5, 0.75]).items()
            },
        }
    return pd.DataFrame.from_dict(rows, orient="index")


def profiles(results: Section, methods: list[str], name: str) -> dict[str, Floats]:
    """Compute performance profiles.

    Parameters
    ----------
    results : Section
    methods : list of str
        That are compared: a surface's least value among them is 1.
    name : str
        Column of `Section.medians`, the less the better.

    Returns
    -------
    dict of str to (surfaces,) float64
        For each method its ratio to the best, from small to large, infinite where it failed or
        has flipped faces.
        The k-th is the least factor within which it is on a share k / surfaces of them.

    References
    ----------
    E. D. Dolan, J. J. Moré. Benchmarking optimization software with performance profiles.
    Math. Program. 91, 2002.
    """
    values = np.array([results.values(method, name) for method in methods])
    flips = np.array([results.values(method, "flips") for method in methods])
    values[flips > 0] = np.nan  # no map to be compared with
    values = values[:, np.isfinite(values).any(axis=0)]
    least = np.nanmin(values, axis=0, initial=np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = np.where(values == least, 1, values / least)
    ratios[np.isnan(ratios)] = np.inf
    return dict(zip(methods, np.sort(ratios, axis=1), strict=True))


def ranking(results: Section, family: str, name: str) -> list[tuple[str, float, float]]:
    """Order the methods of a family that were run everywhere, the best first.

    Returns
    -------
    list of (str, float, float)
        Method, median over the surfaces of its ratio to the best of them, and the share of
        surfaces on which it is that, see `profiles`.
    """
    methods = results.everywhere(family)
    ratios = profiles(results, methods, name) if methods else {}
    found = [
        (m, float(np.quantile(r, 0.5, method="higher")), float((r <= 1 + TIE).mean()))
        for m, r in ratios.items()
        if len(r)
    ]
    return sorted(found, key=itemgetter(1))


@dataclass(frozen=True)
class Paired:
    """One method against another, on the surfaces that both have mapped.

    Attributes
    ----------
    lower, higher, ties : int
        Surfaces on which the first has less, more, or as much as the other.
    median : float
        Of the differences, first less other.
    sign, signed_rank : float
        Two-sided p-values of the sign test and of Wilcoxon's signed-rank test; 1 if all tie.
    """

    lower: int
    higher: int
    ties: int
    median: float
    sign: float
    signed_rank: float


def paired(results: Section, method: str, other: str, name: str) -> Paired:
    """Compare two methods surface by surface."""
    from scipy.stats import binomtest, wilcoxon  # slow to import

    first, second = results.values(method, name), results.values(other, name)
    both = np.isfinite(first) & np.isfinite(second)
    first, second = first[both], second[both]
    difference = first - second
    difference[abs(difference) <= TIE * np.maximum(abs(first), abs(second))] = 0
    lower, higher = int((difference < 0).sum()), int((difference > 0).sum())
    sign = signed_rank = 1.0
    if lower + higher:
        sign = binomtest(lower, lower + higher).pvalue
        signed_rank = wilcoxon(difference[difference != 0]).pvalue
    median = float(np.median(difference)) if len(difference) else np.nan
    return Paired(lower, higher, len(difference) - lower - higher, median, sign, signed_rank)
