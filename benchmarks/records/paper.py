"""The paper's fourteen models, its published numbers, and what stands for each here."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

PUBLISHED = ("fdcp", "ldcp", "cdcp")  # methods, in the order of the numbers


@dataclass(frozen=True)
class Published:
    """One row of the paper's Tables 1 and 2.

    Attributes
    ----------
    name : str
        The paper's.
    vertices : int
    mean, sd : tuple of float
        Angular distortion in degrees of FDCP, LDCP and CDCP.
    seconds : tuple of float
        Of the same, MATLAB on a 2.30 GHz laptop.
    model : str
        What is measured here; empty if there is nothing of similar size.
    own : str
        ``"own"`` if that is the paper's model, ``"stand-in"`` if it is another surface of
        similar size, or a note.
    """

    name: str
    vertices: int
    mean: tuple[float, ...]
    sd: tuple[float, ...]
    seconds: tuple[float, ...]
    model: str
    own: str


def _rows() -> Iterator[Published]:
    with Path(__file__).with_name("paper.csv").open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            mean, sd, seconds = (
                tuple(float(row[f"{method} {name}"]) for method in PUBLISHED)
                for name in ("mean", "sd", "seconds")
            )
            size = int(row["vertices"])
            yield Published(row["name"], size, mean, sd, seconds, row["model"], row["own"])


PAPER = tuple(_rows())


def published(model: str) -> Published | None:
    """Row of the paper that a model stands for."""
    return next((row for row in PAPER if row.model == model), None)


def row_of(model: str) -> Published | None:
    """Row of the paper that a model stands for, or whose name it has where nothing does."""
    return published(model) or next((row for row in PAPER if row.name == model), None)
