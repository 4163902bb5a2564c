"""What the records say, in sentences; every number is computed from them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .figures.measured import Measured
from .figures.style import style
from .paper import PUBLISHED, published
from .report import FROM, Results, claim, growth

__all__ = ["findings"]


def findings(measured: Measured) -> list[str]:
    """List what has been found, with the failures."""
    found: list[str] = []
    tables = measured.sections.get("tables")
    if tables:
        found.append(f"FDCP, LDCP and CDCP by their means: {claim(tables)}")
        found += [*_validity(measured, tables), *_published(tables)]
        found += [*_refinement(measured, tables), *_times(measured)]
    if "speed" in measured.sections:
        found += _speed(measured)
    if "ablation" in measured.sections:
        found += _mobius(measured)
    return found


def _validity(measured: Measured, tables: Results) -> Iterator[str]:
    counts, failures = [], []
    for method in tables.methods((*PUBLISHED, "double_cover", "harmonic")):
        run = measured.models("tables", method)
        failed = measured.failed("tables", method)
        counts.append(f"{style(method).label} on {len(run) - len(failed)} of {len(run)}")
        if failed:
            failures.append(f"{style(method).label} on {', '.join(failed)}")
    if counts:
        text = f"Valid maps onto the disk, certified: {', '.join(counts)} surfaces."
        yield text + (f" There is none by {'; by '.join(failures)}." if failures else "")
    missing = [r.model for r in tables.records if not r.vertices]
    if missing:
        yield f"Not to be had: {', '.join(dict.fromkeys(missing))}."


def _published(tables: Results) -> Iterator[str]:
    k, compared = PUBLISHED.index("cdcp"), []
    for model in tables.models():
        row = published(model)
        if row and row.own == "own" and not tables.failure(model, "cdcp"):
            mean, sd = (tables.median(model, "cdcp", name) for name in ("mean", "sd"))
            theirs = f"{row.mean[k]:.2f} / {row.sd[k]:.2f}"
            compared.append(f"{row.name} {mean:.3f}° / {sd:.3f}° (published {theirs})")
    if compared:
        yield f"CDCP on the paper's own surfaces, mean / SD: {'; '.join(compared)}."


def _refinement(measured: Measured, tables: Results) -> Iterator[str]:
    if "cdcp refine=5" in tables.methods(("cdcp refine=5",)):
        plain, refined = (
            measured.values("tables", method, "mean") for method in ("cdcp", "cdcp refine=5")
        )
        ratio = refined / plain
        ratio = ratio[np.isfinite(ratio)]
        if len(ratio):
            yield (
                f"Five steps of refinement lower the mean of CDCP by {1 - ratio.max():.0%} to "
                f"{1 - ratio.min():.0%} (median {1 - np.median(ratio):.0%}, {len(ratio)} surfaces)."
            )


def _times(measured: Measured) -> Iterator[str]:
    large = np.array(list(measured.models("tables").values())) >= FROM
    cdcp = measured.values("tables", "cdcp", "seconds")
    for method in ("fdcp", "ldcp"):
        ratio = (measured.values("tables", method, "seconds") / cdcp)[large]
        ratio = ratio[np.isfinite(ratio)]
        if len(ratio):
            yield (
                f"{style(method).label} takes {ratio.min():.1f} to {ratio.max():.1f} times as long "
                f"as CDCP (median {np.median(ratio):.1f}), on {len(ratio)} surfaces with "
                f"{FROM:,} vertices or more. One run each, methods taking turns."
            )


def _speed(measured: Measured) -> Iterator[str]:
    n = np.array(list(measured.models("speed").values()), dtype=float)
    seconds = measured.values("speed", "cdcp", "seconds")
    ratio = seconds / measured.values("speed", "factor", "seconds")
    used = np.isfinite(ratio) & (n >= FROM)
    if used.any():
        yield (
            f"CDCP takes {ratio[used].min():.2f} to {ratio[used].max():.2f} times as long as one "
            f"factorization of the interior Laplacian, on {used.sum()} surfaces of "
            f"{n[used].min():,.0f} to {n[used].max():,.0f} vertices; medians of repeated runs."
        )
    time, _ = growth(n, seconds)
    memory, _ = growth(n, measured.values("speed", "cdcp", "memory"))
    if np.isfinite(time):
        yield f"Time of CDCP grows like n^{time:.2f}, its peak memory like n^{memory:.2f}."


def _mobius(measured: Measured) -> Iterator[str]:
    with_it, without = (
        measured.values("ablation", method, "mean") for method in ("default", "without Möbius")
    )
    gain = (without - with_it)[np.isfinite(without - with_it)]
    if len(gain):
        yield (
            f"The Möbius step lowers the mean angular distortion by {gain.min():.3f}° to "
            f"{gain.max():.3f}° ({len(gain)} surfaces)."
        )
