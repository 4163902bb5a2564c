"""What can be chosen about a map, checked before anything is computed."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from .arguments import is_real, is_whole
from .arrays import Ints
from .solve.solvers import SolverName, checked
from .steps.center import METHODS, CenterMethod
from .steps.mobius import MobiusMethod

KEPT = {"angles": 0.0, "lengths": 0.5, "areas": 0.99}
MOST = KEPT["areas"]  # areas alone leave the shape open
TEXELS = "texels<"


@dataclass(frozen=True)
class Keep:
    """What a map is to keep: a number `t`, or the least at which densities of texels are bounded.

    `texels` bounds the density that 95 percent of the surface have at most, by that of 5 percent.
    """

    t: float = 0.0
    texels: float = np.inf

    @classmethod
    def of(cls, keep: object) -> Keep:
        """Read what is asked for; ValueError if it is nothing of that kind."""
        if isinstance(keep, str):
            if keep in KEPT:
                return cls(KEPT[keep])
            bounds = keep.startswith(TEXELS)
            with suppress(ValueError):
                number = float(keep.removeprefix(TEXELS))
                if bounds and 1 < number < np.inf:
                    return cls(texels=number)
                if not bounds and 0 <= number <= 1:
                    return cls(min(number, MOST))
        elif is_real(keep) and 0 <= keep <= 1:  # type: ignore[operator]
            return cls(min(float(keep), MOST))  # type: ignore[arg-type]
        names = ", ".join(f'"{name}"' for name in KEPT)
        raise ValueError(
            f'keep must be {names}, a number from 0 to 1, or a bound like "{TEXELS}2", not {keep!r}'
        )

    def __bool__(self) -> bool:
        """Whether it is more than angles."""
        return self.t > 0 or self.texels < np.inf


@dataclass(frozen=True, eq=False)
class Options:
    """The options of `disk_map`; ValueError if one is none of those allowed."""

    center: CenterMethod | int = "torsion"
    mobius: Literal["angle", "area"] | None = "angle"
    align: int | ArrayLike | None = None
    refine: int | None = None
    refine_norm: float = 1.5
    refine_seconds: float = np.inf
    preset: Literal["paper"] | None = None
    solver: SolverName | None = None
    keep: float | str = "angles"

    def __post_init__(self) -> None:
        if not (self.center in METHODS if isinstance(self.center, str) else is_whole(self.center)):
            known = ", ".join(f'"{method}"' for method in METHODS)
            raise ValueError(f"center must be {known} or a row of F, not {self.center!r}")
        if self.preset not in (None, "paper"):
            raise ValueError(f'preset must be "paper" or None, not {self.preset!r}')
        if self.mobius not in ("angle", "area", None):
            raise ValueError(f'mobius must be "angle", "area" or None, not {self.mobius!r}')
        if self.refine is not None and not (is_whole(self.refine) and self.refine >= 0):
            raise ValueError(
                "refine must be a number of steps, 0 or more, or None (as needed), "
                f"not {self.refine!r}"
            )
        if not (is_real(self.refine_norm) and 1 <= self.refine_norm <= 2):
            raise ValueError(f"refine_norm must be from 1 to 2, not {self.refine_norm!r}")
        if not (is_real(self.refine_seconds) and self.refine_seconds >= 0):
            raise ValueError(f"refine_seconds must be 0 or more, not {self.refine_seconds!r}")
        if self.solver is not None:
            checked(self.solver)
        self._check_keep()
        if self.preset and (self.center, self.mobius) != ("torsion", "angle"):
            raise ValueError('preset="paper" sets center and mobius itself')
        if self.align is not None and not is_whole(self.align):
            direction = np.asarray(self.align)
            if direction.shape != (3,) or direction.dtype.kind not in "iuf":
                raise ValueError(
                    f"align must be a boundary vertex or a 3-vector, not {self.align!r}"
                )
            if not (np.isfinite(direction).all() and direction.any()):
                raise ValueError(f"align={self.align!r} is no direction")

    def _check_keep(self) -> None:
        for name in ("refine", "preset"):
            if self.kept and getattr(self, name):
                raise ValueError(f"{name} is for angles, which keep trades: leave one of them out")

    def check_rows(self, m: int, loop: Ints) -> None:
        """Raise ValueError if `center` or `align` is none of m faces or of the boundary loop."""
        if not isinstance(self.center, str) and not 0 <= self.center < m:
            raise ValueError(f"center is face {self.center}; the mesh has faces 0..{m - 1}")
        if is_whole(self.align) and self.align not in loop:
            raise ValueError(f"align={self.align} is not a boundary vertex")

    @property
    def mobius_method(self) -> MobiusMethod | None:
        """What chooses the Möbius transformation."""
        if self.kept and self.mobius:
            return "area"  # from there it is not far to lengths
        return "nelder-mead" if self.preset == "paper" else self.mobius

    @property
    def kept(self) -> Keep:
        """What the map is to keep."""
        return Keep.of(self.keep)

    @property
    def first_steps(self) -> tuple[CenterMethod | int, str | None]:
        """What the harmonic map of Algorithm 1 depends on, before its normalisation."""
        return self.center, self.preset
