"""Tables of methods on meshes, for ``cdcp-igl compare``."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from rich.table import Table

from ..reference.case import FIELDS, OK, Case

__all__ = ["table", "write_csv", "write_json"]


def table(title: str, cases: Sequence[Case]) -> Table:
    """One row a method; a method without a map says why."""
    made = Table(title=title, title_justify="left", caption_justify="left")
    made.add_column("method", no_wrap=True)
    for heading in ("mean °", "SD °", "max °", "area", "flips", "boundary", "s", "MiB"):
        made.add_column(heading, justify="right", no_wrap=True)
    made.add_column("", overflow="fold")
    for case in cases:
        remark = case.outcome
        if case.outcome == OK:
            remark = "no disk" if case.boundary == "free" else ""
        made.add_row(case.method, *_numbers(case), remark)
    if any(case.boundary == "free" and case.outcome == OK for case in cases):
        made.caption = "no disk: a map with free boundary; compare it on angles only"
    return made


def _numbers(case: Case) -> list[str]:
    formats: Mapping[str, str] = {
        "mean": ".3f",
        "sd": ".3f",
        "max": ".1f",
        "area": ".3f",
        "flips": ",.0f",
        "boundary_error": ".0e",
        "seconds": ".2f",
        "memory": ",.0f",
    }
    row = []
    for name, form in formats.items():
        value = getattr(case, name)
        off = name == "boundary_error" and case.boundary == "free"
        row.append("–" if np.isnan(value) or off else format(value, form))
    return row


def write_json(path: Path, cases: Mapping[str, Sequence[Case]]) -> None:
    """Write a list of objects, one a case, null where there is no number."""
    rows = [{"mesh": mesh, **case.as_json()} for mesh, of in cases.items() for case in of]
    path.write_text(json.dumps(rows, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")


def write_csv(path: Path, cases: Mapping[str, Sequence[Case]]) -> None:
    """Write one line a case, empty where there is no number."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, ["mesh", *FIELDS])
        writer.writeheader()
        for mesh, of in cases.items():
            writer.writerows({"mesh": mesh, **case.as_json()} for case in of)
