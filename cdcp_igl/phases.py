"""Seconds per phase, and progress."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from time import perf_counter

Progress = Callable[[str, float], None]


# The phases in order, with their share of the time on a large mesh: what a progress bar
# can honestly show.
PHASES = {
    "check": 0.11,
    "laplacian": 0.02,
    "factor": 0.60,
    "center": 0.05,
    "trace": 0.05,
    "circle": 0.03,
    "extension": 0.06,
    "mobius": 0.05,
    "repair": 0.02,
    "refine": 0.0,
    "certificate": 0.04,
    "distortion": 0.01,
}
REFINEMENT_STEP = 0.5  # share of one step of refinement, by the total of the above


class Phases:
    """Times the phases of a computation and reports them to a callback.

    ``progress(phase, fraction)`` is called when a phase begins or advances, and at the end as
    ``progress("done", 1.0)``; the fraction is the estimated share of the work that is done. The
    phases that are `skipped` will not run, because their result is there already. `seconds` has the
    wall time of each phase that has ended; of all its runs, those that failed included.
    """

    def __init__(
        self,
        progress: Progress | None = None,
        refinement_steps: int = 0,
        skipped: Iterable[str] = (),
    ) -> None:
        self.seconds: dict[str, float] = {}
        self._progress = progress
        self._reached = 0.0
        shares = PHASES | {"refine": REFINEMENT_STEP * refinement_steps}
        shares |= dict.fromkeys(skipped, 0)
        self._shares = {phase: share / sum(shares.values()) for phase, share in shares.items()}

    @contextmanager
    def __call__(self, phase: str) -> Iterator[Callable[[float], None]]:
        """Time the body of a ``with`` statement as one phase.

        Its target is a function to call with the share of the phase that is done.
        """
        before = sum(self._shares[done] for done in self.seconds)

        def advance(done: float) -> None:
            if self._progress:
                fraction = min(before + done * self._shares[phase], 1.0)
                self._reached = max(self._reached, fraction)  # sums are rounded in many ways
                self._progress(phase, self._reached)

        advance(0)
        start = perf_counter()
        try:
            yield advance
        finally:
            self.seconds[phase] = self.seconds.get(phase, 0.0) + perf_counter() - start

    def done(self) -> None:
        """Report the end."""
        if self._progress:
            self._progress("done", 1.0)
