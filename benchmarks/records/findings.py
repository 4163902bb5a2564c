"""What the records say, in sentences; every number is computed from them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from .paper import PUBLISHED, published
from .results import FROM, Measured, Section, growth

MARGIN = 0.005  # degrees by which CDCP's mean may be above that of FDCP or LDCP
NAMED = 12  # surfaces, of more; the tables have them all


def sentences(measured: Measured) -> list[str]:
    """List what has been found, with the failures."""
    found: list[str] = []
    if tables := measured.sections.get("tables"):
        if set(PUBLISHED) <= set(tables.maps):
            found.append(f"FDCP, LDCP and CDCP by their means: {_comparison(tables)}")
        found += [*_validity(tables), *_published(tables), *_refinement(tables), *_times(tables)]
    if speed := measured.sections.get("speed"):
        found += _factorizations(speed)
    if grown := measured.sections.get("growth"):
        found += _growth(grown)
    if ablation := measured.sections.get("ablation"):
        found += _mobius(ablation)
    return found


def _listed(names: Sequence[str], between: str = ", ") -> str:
    """Join names, or the first of many."""
    others = len(names) - NAMED
    return between.join(names[:NAMED]) + (f" and {others:,} more" if others > 0 else "")


def _comparison(tables: Section) -> str:
    """Whether CDCP's mean is at most those of FDCP and LDCP plus the margin."""
    compared, above = [], []
    for model in tables.sizes:
        means = {m: tables.median(model, m, "mean") for m in PUBLISHED}
        if np.isfinite(list(means.values())).all():
            compared.append(model)
            above += [
                f"{model}: {means['cdcp']:.4f} against {means[m]:.4f} of {m.upper()}"
                for m in ("fdcp", "ldcp")
                if not means["cdcp"] <= means[m] + MARGIN
            ]
    skipped = [model for model in tables.sizes if model not in compared]
    text = f"All three are valid on {len(compared)} surfaces."
    if above:
        text += f" CDCP's mean is more than {MARGIN} degrees above on: {_listed(above, '; ')}."
    elif compared:
        text += f" On each of them CDCP's mean is at most {MARGIN} degrees above both."
    if skipped:
        text += f" Not compared, because one is missing or failed: {_listed(skipped)}."
    return text


def _validity(tables: Section) -> Iterator[str]:
    counts, failures = [], []
    for method in tables.methods((*PUBLISHED, "double_cover", "harmonic")):
        run = [model for model in tables.mapped if tables.of(model, method)]
        failed = tables.failed(method)
        name = method.upper() if method in PUBLISHED else method.replace("_", " ")
        counts.append(f"{name} on {len(run) - len(failed)} of {len(run)}")
        if failed:
            failures.append(f"{name} on {_listed(failed)}")
    if counts:
        text = f"Valid maps onto the disk, certified: {', '.join(counts)} surfaces."
        yield text + (f" There is none by {'; by '.join(failures)}." if failures else "")
    missing = [r.model for r in tables.records if not r.vertices]
    if missing:
        yield f"Not to be had: {_listed(list(dict.fromkeys(missing)))}."


def _published(tables: Section) -> Iterator[str]:
    k, compared = PUBLISHED.index("cdcp"), []
    for model in tables.sizes:
        row = published(model)
        if row and row.own == "own" and not tables.failure(model, "cdcp"):
            mean, sd = (tables.median(model, "cdcp", name) for name in ("mean", "sd"))
            theirs = f"{row.mean[k]:.2f} / {row.sd[k]:.2f}"
            compared.append(f"{row.name} {mean:.3f}° / {sd:.3f}° (published {theirs})")
    if compared:
        yield f"CDCP on the paper's own surfaces, mean / SD: {'; '.join(compared)}."


def _refinement(tables: Section) -> Iterator[str]:
    ratio = tables.values("cdcp refine=5", "mean") / tables.values("cdcp", "mean")
    ratio = ratio[np.isfinite(ratio)]
    if len(ratio):
        yield (
            f"Five steps of refinement lower the mean of CDCP by {1 - ratio.max():.0%} to "
            f"{1 - ratio.min():.0%} (median {1 - np.median(ratio):.0%}, {len(ratio)} surfaces)."
        )


def _times(tables: Section) -> Iterator[str]:
    large = np.array(list(tables.mapped.values())) >= FROM
    for method in ("fdcp", "ldcp"):
        ratio = (tables.values(method, "seconds") / tables.values("cdcp", "seconds"))[large]
        ratio = ratio[np.isfinite(ratio)]
        if len(ratio):
            yield (
                f"{method.upper()} takes {ratio.min():.1f} to {ratio.max():.1f} times as long "
                f"as CDCP (median {np.median(ratio):.1f}), on {len(ratio)} surfaces with "
                f"{FROM:,} vertices or more. One run each, methods taking turns."
            )


def _factorizations(speed: Section) -> Iterator[str]:
    n = np.array(list(speed.mapped.values()))
    ratio = speed.values("cdcp", "seconds") / speed.values("factor", "seconds")
    used = np.isfinite(ratio) & (n >= FROM)
    if used.any():
        yield (
            f"CDCP takes {ratio[used].min():.2f} to {ratio[used].max():.2f} times as long as one "
            f"factorization of the interior Laplacian, on {used.sum()} surfaces of "
            f"{n[used].min():,} to {n[used].max():,} vertices; medians of repeated runs."
        )


def _growth(grown: Section) -> Iterator[str]:
    n = np.array(list(grown.sizes.values()), dtype=float)
    for name, method in (("CDCP", "cdcp"), ("one factorization", "factor")):
        (time, _), (memory, _) = (growth(n, grown.values(method, q)) for q in ("seconds", "memory"))
        if np.isfinite(time):
            yield f"Time of {name} grows like n^{time:.2f}, its peak memory like n^{memory:.2f}."


def _mobius(ablation: Section) -> Iterator[str]:
    gain = ablation.values("without Möbius", "mean") - ablation.values("default", "mean")
    gain = gain[np.isfinite(gain)]
    if len(gain):
        yield (
            f"The Möbius step lowers the mean angular distortion by {gain.min():.3f}° to "
            f"{gain.max():.3f}° ({len(gain)} surfaces)."
        )
