"""What ``cdcp-igl compare`` says of methods on meshes, on the terminal and in files."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import typer

from ..errors import printable
from ..reference.case import FIELDS, OK, Case
from .tables import print_table

__all__ = ["print_cases", "write_csv", "write_json"]

HEADINGS = ("method", "mean °", "SD °", "max °", "area", "flips", "boundary", "s", "MiB")


def print_cases(title: str, cases: Sequence[Case]) -> None:
    """Print a row a method, and below why one has no map."""
    print_table(
        title,
        HEADINGS,
        [[case.method + " *" * _free(case), *_numbers(case)] for case in cases],
    )
    if any(map(_free, cases)):
        typer.echo("* no disk: a map with free boundary; compare it on angles only")
    for case in cases:
        if case.outcome != OK:
            typer.echo(f"{case.method}: {case.outcome}")


def _free(case: Case) -> bool:
    return case.boundary == "free" and case.outcome == OK


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


def write_json(path: Path, cases: Mapping[Path, Sequence[Case]]) -> None:
    """Write a list of objects, one a case, null where there is no number."""
    rows = [
        {"mesh": printable(mesh), **case.as_json()} for mesh, of in cases.items() for case in of
    ]
    path.write_text(json.dumps(rows, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")


def write_csv(path: Path, cases: Mapping[Path, Sequence[Case]]) -> None:
    """Write one line a case, empty where there is no number."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, ["mesh", *FIELDS])
        writer.writeheader()
        for mesh, of in cases.items():
            writer.writerows({"mesh": printable(mesh), **case.as_json()} for case in of)
