"""The paper's fourteen models, its published numbers, and what stands for each here."""

from __future__ import annotations

from dataclasses import dataclass

PUBLISHED = ("fdcp", "ldcp", "cdcp")  # methods, in the order of the numbers below


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
    mean: tuple[float, float, float]
    sd: tuple[float, float, float]
    seconds: tuple[float, float, float]
    model: str
    own: str = "stand-in"


PAPER = (
    Published(
        *("Ear", 367, (5.62, 5.88, 5.44), (5.68, 5.97, 5.39), (0.23, 0.16, 0.03)), "nefertiti_299"
    ),
    Published(
        *("Foot", 10_010, (1.41, 1.40, 1.41), (1.13, 1.14, 1.14), (0.42, 0.29, 0.20)),
        "camelhead_11381",
    ),
    Published(
        *("Chinese Lion", 17_334, (1.42, 1.42, 1.42), (2.04, 2.05, 2.05), (1.54, 0.56, 0.47)),
        *("chinese_lion", "own"),
    ),
    Published(
        *("Femur", 21_699, (0.94, 0.94, 0.94), (0.75, 0.75, 0.75), (1.73, 0.75, 0.54)),
        "bimba_22838",
    ),
    Published(
        *("Stanford Bunny", 31_593, (1.03, 1.03, 1.03), (1.52, 1.52, 1.52), (2.83, 1.19, 0.99)),
        *("stanford_bunny_31593", "own"),
    ),
    Published(
        *("Max Planck", 41_588, (0.62, 0.62, 0.62), (0.87, 0.87, 0.88), (2.93, 1.45, 1.11)),
        "bulldog_40073",
    ),
    Published(
        *("Human Brain", 48_463, (1.46, 1.57, 1.46), (1.59, 1.62, 1.59), (4.17, 1.71, 1.62)),
        *("human_brain", "own"),
    ),
    Published(
        *("Left Hand", 53_011, (1.20, 1.20, 1.20), (1.17, 1.18, 1.17), (7.54, 2.30, 2.15)),
        *("left_hand", "another version, 53,054 vertices"),
    ),
    Published(
        *("Knit Cap Man", 59_561, (0.55, 0.55, 0.55), (0.94, 0.94, 0.94), (9.05, 2.79, 2.28)), ""
    ),
    Published(
        *("Face Ho", 81_065, (0.16, 0.16, 0.16), (0.30, 0.30, 0.30), (12.74, 4.20, 2.94)),
        "itokawa_93920",
    ),
    Published(
        *("Face Lin", 140_085, (0.19, 0.41, 0.18), (0.86, 1.05, 0.87), (25.04, 7.86, 4.73)),
        "cthead_115491",
    ),
    Published(
        *("Bimba Statue", 216_873, (0.36, 0.41, 0.36), (0.66, 0.66, 0.66), (55.16, 16.24, 9.31)),
        "gcanyon_216196",
    ),
    Published(
        *("Buddha", 473_362, (0.29, 0.30, 0.29), (0.44, 0.45, 0.44), (118.74, 43.12, 29.64)),
        "nefertiti_750281",
    ),
    Published(
        *("Nefertiti Statue", 996_838, (0.31, 0.95, 0.31), (0.52, 0.72, 0.52)),
        *((274.22, 75.96, 44.75), "gcanyon_996999"),
    ),
)


def published(model: str) -> Published | None:
    """Row of the paper that a model stands for."""
    return next((row for row in PAPER if row.model == model), None)


def row_of(model: str) -> Published | None:
    """Row of the paper that a model stands for, or whose name it has where nothing does."""
    return published(model) or next((row for row in PAPER if row.name == model), None)
